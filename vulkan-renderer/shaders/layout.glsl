// The structures that host and shaders share: twin of src/layout.rs, field by field.
//
// Doubles are stored as 64-bit integers (F64Bits); f64.glsl computes with them. All memory is accessed by address.
#ifndef LAYOUT_GLSL
#define LAYOUT_GLSL

#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require

#define F64Bits uint64_t
#define Address uint64_t

const uint NONE = 0xFFFFFFFFu;

struct Launch {
    Address scene;
    Address source;
    Address target;
    Address scratch;
    Address resting;
    Address page_requests;
    Address samples_done;
    uint tile_x;
    uint tile_y;
    uint tile_width;
    uint tile_height;
    uint first_sample;
    uint samples;
    uint count;
    uint wanted;
};

const uint SCRATCH_BYTES = 200u;

const uint PAGE_COUNTS = 2u;

struct CameraRecord {
    F64Bits position[3];
    F64Bits right[3];
    F64Bits up[3];
    F64Bits forward[3];
    F64Bits half_extent;
    F64Bits shift[2];
    F64Bits size[2];
    F64Bits clip[2];
    uint orthographic;
    uint lens_blades;
    F64Bits pixel_aspect;
    F64Bits fitted;
    F64Bits lens_radius;
    F64Bits lens_inverse_focus;
    float lens_rotation_rad;
    float lens_inverse_ratio;
};

struct Filter {
    Address inverse_table;
    float width;
    uint steps;
};

struct Settings {
    uint64_t seed;
    F64Bits ao_distance;
    uint mode;
    uint bounces;
    uint russian_roulette;
    uint kept;
    float clamp_direct;
    float clamp_indirect;
};

struct LightTree {
    Address nodes;
    Address cones;
    F64Bits middle[3];
    F64Bits scale;
    uint count;
    uint reserved;
};

struct Lights {
    Address suns;
    Address lamps;
    LightTree lamp_tree;
    uint sun_count;
    uint lamp_count;
    uint strategy;
    float sky[3];
    uint has_backdrop;
    float backdrop[2][3];
    float sky_mean;
    float sky_constant;
    float sky_linear[3];
    float sky_squared[6];
    float emitters_irradiance;
    uint is_sampled;
    float lamp_tree_irradiance;
    uint reserved;
};

struct Sun {
    F64Bits towards[3];
    F64Bits tangent[3];
    F64Bits bitangent[3];
    F64Bits one_minus_cos_half_angle;
    float radiance[3];
    float cone_pdf;
    float irradiance;
    float sin_half_angle;
};

struct Lamp {
    F64Bits position[3];
    uint kind;
    float axis[3];
    float sides[2][3];
    float half_extent[2];
    float radiance[3];
    float one_minus_cos_half_angle;
    float inverse_blend;
    float tan_half_spread;
    float spread_factor;
    uint soft;
    uint visible_to_camera;
    float intensity;
};

struct Environment {
    Address pixels;
    Address row_cdf;
    Address column_cdf;
    Address row_density;
    F64Bits rotation_rad;
    uint width;
    uint height;
    float strength;
    float floor;
};

struct LightNode {
    float lo[3];
    float hi[3];
    float power;
};

struct Cone {
    float axis[3];
    float cos_spread;
    float cos_reach;
};

struct Emitter {
    uint emissive_instance;
    uint label;
    uint origin[3];
    uint first;
    uint ends[3];
    uint planes;
};

struct EmissiveInstance {
    F64Bits world_from_index[3][3];
    F64Bits units_per_world;
    float areas[3];
    uint instance;
    uint is_mesh;
    uint keys[2];
    uint reserved;
};

struct EmissiveTriangle {
    float corners[3][3];
    float area;
};

struct Emitters {
    LightTree tree;
    Address emitters;
    Address faces;
    Address triangles;
    Address by_key;
    Address emissive_instances;
    Address emissive_instance_of;
    F64Bits radius;
    uint emissive_instance_of_count;
    uint reserved;
};

struct InstanceTree {
    Address nodes;
    Address items;
    F64Bits translation[3];
    F64Bits cells_a_unit;
    F64Bits slack_a_unit;
    F64Bits slack;
    uint lo[3];
    uint hi[3];
    float pad;
    uint reserved;
};

struct SceneHeader {
    Address instances;
    Address tables;
    CameraRecord camera;
    Filter film_filter;
    Settings settings;
    Lights lights;
    Environment environment;
    Emitters emitters;
    InstanceTree instance_tree;
    uint instance_count;
    uint film_width;
    F64Bits contact_distance;
};

struct Material {
    float base_color[3];
    float metallic;
    float roughness;
    float specular;
    float ior;
    float emission[3];
    float specular_tint[3];
    float transmission;
    float coat;
    float coat_roughness;
    float coat_ior;
    float coat_tint[3];
    float sheen;
    float sheen_roughness;
    float sheen_tint[3];
    float alpha;
    uint multiscatter;
};

struct Chunk {
    uint64_t node_base;
    uint64_t leaves;
    uint origin[3];
    uint first_box;
};

// A block of 64³ voxels; blocks are in x-first order. It has the mask of its bricks that hold a voxel, and the number of the first of
// these.
struct BrickBlock {
    uint64_t occupied;
    uint first_brick;
    uint page;
};

// A brick of 16³ voxels: the masks of cells that hold a voxel and of full cells, and where the fields of the other cells and the parts
// begin.
struct Brick {
    uint64_t occupied;
    uint64_t full;
    uint first_field;
    uint first_part;
};

// A part of a brick: the cells of the brick that one box covers.
struct BrickPart {
    uint64_t cells;
    uint box_number;
    uint label;
};

// A box of a page.
struct PagedBox {
    uint64_t record;
    uint label;
    uint page;
};

struct Instance {
    Address chunks;
    Address boxes;
    Address labels;
    Address nodes;
    Address leaves;
    Address bvh_nodes;
    Address bvh_items;
    Address acceleration;
    Address materials;
    Address material_of_label;
    Address cut_planes;
    Address matte_ids;
    Address neighbors;
    Address blocks;
    Address bricks;
    Address brick_fields;
    Address brick_parts;
    Address brick_corners;
    Address page_marks;
    F64Bits translation[3];
    F64Bits adjugate[3][3];
    F64Bits determinant;
    F64Bits normals[3][3];
    uint lo[3];
    uint hi[3];
    uint dims[3];
    uint chunk_count;
    float pad;
    uint label_count;
    uint lod;
    uint box_count;
    uint cut_plane_count;
    float eye_in_index[3];
    float edges_from_index[3][3];
    float coarser_from_squared[2];
    uint last_matte_id;
    uint body;
    uint reserved;
};

struct CutPlane {
    F64Bits normal[3];
    F64Bits offset;
    F64Bits normal_in_world[3];
    uint axis;
    uint ends_part;
};

const uint LOD_BY_DISTANCE = 3u;
// The instance is a mesh.
const uint LOD_TRIANGLES = 4u;
// The instance is a mesh that is a shadow catcher.
const uint LOD_CATCHER = 5u;
const uint64_t INSTANCE_BYTES = 456UL;

struct SurfaceRecord {
    uint instance;
    uint voxel[3];
    uint face;
    uint plane;
    uint label;
    uint box_number;
};

const uint QUESTION_FIRST_HIT = 0u;
const uint QUESTION_OCCLUDED = 1u;
const uint QUESTION_NEXT_BOUNDARY = 2u;

struct RayRecord {
    F64Bits origin[3];
    F64Bits direction[3];
    F64Bits t_max;
    SurfaceRecord from;
    uint question;
    uint only;
    uint only_instance;
    uint reserved;
};

struct HitRecord {
    F64Bits t;
    F64Bits normal[3];
    SurfaceRecord surface;
    uint from_inside;
    uint reserved;
};

struct FirstRecord {
    float depth;
    uint label;
    uint instance;
    float albedo[3];
    float normal[3];
    float position[3];
};

// What `denoise` does with each pixel, by `Launch.wanted`.
const uint RESOLVE_COLOR = 0u;
const uint RESOLVE_ALPHA = 1u;
const uint RESOLVE_SQUARED_ERRORS = 2u;

struct Resolve {
    Address sums;
    Address pass_sums;
    Address resting;
    Address result;
    uint width;
    uint height;
    uint samples;
    uint pass_stride;
};

const uint DENOISE_GUIDES = 0u;
const uint DENOISE_LIGHT = 1u;
const uint DENOISE_POOLED = 2u;
const uint DENOISE_FIRST_WINDOW = 3u;
const uint DENOISE_SECOND_WINDOW = 4u;
const uint DENOISE_THIRD_WINDOW = 5u;
const uint DENOISE_SHRINK = 6u;

struct Denoise {
    Address surfaces;
    Address guides;
    Address sums;
    Address resting;
    Address image;
    Address variance;
    Address light;
    Address light_variance;
    Address pooled_variance;
    Address smooth_mean;
    uint width;
    uint height;
    uint samples;
    uint is_variance_known;
    float t_squared[3];
    float wide_t_squared[3];
    uint wide_steps[2];
};

struct Guide {
    float normal[3];
    float albedo[3];
    uint label;
    uint instance;
    uint is_surface;
};

struct PixelLight {
    float mean[3];
    uint takes_part;
};

// A node of the bounding volume hierarchy, 80 bytes as documented in pumice_transport::geometry::bvh; bytes are extracted from words.
struct BvhNode {
    float origin[3];
    uint exponents_and_inner;
    uint first_child;
    uint first_item;
    uint meta[2];
    uint lo[3][2];
    uint hi[3][2];
};

layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Words { uint at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer Longs { uint64_t at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Floats { float at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer SceneRef { SceneHeader it; };
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer Instances { Instance at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer Chunks { Chunk at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer BrickBlocks { BrickBlock at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer Bricks { Brick at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer PagedBoxes { PagedBox at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer BrickParts { BrickPart at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer CutPlanes { CutPlane at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer Suns { Sun at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer Lamps { Lamp at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer LightNodes { LightNode at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Cones { Cone at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer EmitterRecords { Emitter at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer EmissiveInstances { EmissiveInstance at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer EmissiveTriangles { EmissiveTriangle at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Materials { Material at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer BvhNodes { BvhNode at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer RayRecords { RayRecord at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) buffer HitRecords { HitRecord at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer FirstRecords { FirstRecord at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer DenoiseRef { Denoise it; };
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer ResolveRef { Resolve it; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Guides { Guide at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer PixelLights { PixelLight at[]; };

// A reference to an instance is the address of its record, the first element of the referenced array.
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer InstanceRef { Instance it; };

#endif
