//! The structures that host and shaders share: twins of `shaders/layout.glsl`, field by field.
//!
//! ```text
//! Launch (push constants) ─ scene ──► SceneHeader ─ instances ──► Instance[] ─ boxes, nodes, leaves, hierarchy, materials
//!        │ input, output, scratch                 ├ lights.ends, lights.suns
//!        ▼                                        ├ environment.pixels, …
//!        rays in, hits out, film sums             └ filter.inverse, tables
//! ```
//! GLSL's `scalar` layout equals C's for these: members in order, each aligned to its own size, no implicit padding (a test compares the
//! offsets with those in the compiled shaders). Addresses are device addresses, 0 where there is nothing. Shaders read a double as a 64-bit
//! integer, so that GPUs without doubles can emulate them (`shaders/f64.glsl`).

use bytemuck::{Pod, Zeroable};

/// A device address.
pub type Address = u64;

/// Stands for the absence of a box, label or instance.
pub const NONE: u32 = u32::MAX;

/// Push constants of every entry point. The host fills what the entry point reads and leaves the rest 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Launch {
    /// [`SceneHeader`].
    pub scene: Address,
    /// `trace_rays`: [`RayRecord`]s. `probe`: words. `path`: sums of render passes of the whole film, `PassSums::stride` floats a
    /// pixel; 0 where the film keeps none. `denoise`: [`Denoise`]. `resolve`: [`Resolve`].
    pub input: Address,
    /// `trace_rays`: [`HitRecord`]s. `probe`: words. `path`: sums of the whole film, `STRIDE` floats a pixel, rows from the top.
    /// `first`: [`SurfaceAovsRecord`]s or [`HitRecord`]s, in the order of the tile's pixels.
    pub output: Address,
    /// Ray tracing pipeline: [`SCRATCH_BYTES`] for each ray of the launch, uninitialised.
    pub scratch: Address,
    /// `path`: one word a pixel of the film, the samples with which it rests (has converged), or 0 where it does not rest; 0 where no pixel
    /// rests.
    pub resting: Address,
    /// `path`, `first`, where volumes are drawn in pages: [`PAGE_COUNTS`] words, then the marks of pages; else 0.
    pub page_requests: Address,
    /// `path`, with such volumes: one word a pixel of the film, the number of samples that it has been given.
    pub samples_done: Address,
    /// `path`, `first`, `denoise`, `resolve`: left edge of the tile in pixels of the film; in strips for [`ResolveStep::SquaredErrors`].
    pub tile_x: u32,
    /// Upper edge.
    pub tile_y: u32,
    /// Width of the tile in pixels. An invocation beyond it does nothing.
    pub tile_width: u32,
    /// Height of the tile in pixels.
    pub tile_height: u32,
    /// `path`: number of the first sample to add.
    pub first_sample: u32,
    /// `path`: how many samples to add.
    pub samples: u32,
    /// `trace_rays`, `probe`: how many rays or inputs there are.
    pub count: u32,
    /// What `first` writes: 0 [`SurfaceAovsRecord`]s, 1 [`HitRecord`]s (their t is the depth). `denoise`: [`DenoiseStep`]. `resolve`:
    /// [`ResolveStep`].
    pub wanted: u32,
}

/// Words before the marks of pages: pixels that lacked a page, and samples that were added.
pub const PAGE_COUNTS: usize = 2;

/// Bytes of scratch memory for each ray of a launch of the ray tracing pipeline. It holds the search state that ray generation and
/// intersection shader share.
pub const SCRATCH_BYTES: u64 = 200;

/// Twin of `CameraRays` and `Lens`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs, reason = "as in CameraRays and Lens")]
pub struct Camera {
    pub position: [f64; 3],
    pub right: [f64; 3],
    pub up: [f64; 3],
    pub forward: [f64; 3],
    pub half: f64,
    pub shift: [f64; 2],
    pub size: [f64; 2],
    pub clip: [f64; 2],
    pub orthographic: u32,
    pub lens_blades: u32,
    pub pixel_aspect: f64,
    pub fitted: f64,
    /// 0 for a pinhole camera, whose other lens fields are not read.
    pub lens_radius: f64,
    pub lens_inverse_focus: f64,
    pub lens_rotation_rad: f32,
    pub lens_inverse_ratio: f32,
}

/// Twin of `FilterTable`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Filter {
    /// Inverse cdf, `steps + 1` floats; 0 for a box filter.
    pub inverse: Address,
    /// Width in pixels.
    pub width: f32,
    /// Steps of the table; 0 for a box filter.
    pub steps: u32,
}

/// Twin of `Settings`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs, reason = "as in Settings")]
pub struct Settings {
    pub seed: u64,
    pub ao_distance: f64,
    /// 0 path, 1 one bounce, 2 ambient occlusion.
    pub mode: u32,
    pub bounces: u32,
    pub russian_roulette: u32,
    /// Which sums of render passes the film keeps: `PassSums::bits`.
    pub kept: u32,
    pub clamp_direct: f32,
    pub clamp_indirect: f32,
}

/// Twin of `pumice_transport::light_tree::LightTree`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct LightTree {
    /// [`LightNode`]s.
    pub nodes: Address,
    /// [`Cone`]s of the nodes; 0 where all emitters shine to all sides.
    pub cones: Address,
    /// Middle of all emitters in the world; coordinates in the tree count from it.
    pub middle: [f64; 3],
    /// Factor from world units to units of the tree.
    pub scale: f64,
    /// Number of emitters; 0 where there is no tree.
    pub count: u32,
    /// 0.
    pub reserved: u32,
}

/// Twin of `Lights`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Lights {
    /// [`Sun`]s.
    pub suns: Address,
    /// [`Lamp`]s.
    pub lamps: Address,
    /// Tree over the lamps; of 0 emitters where there are few lamps.
    pub lamp_tree: LightTree,
    /// Number of suns.
    pub sun_count: u32,
    /// Number of lamps.
    pub lamp_count: u32,
    /// 0 MIS of both, 1 light sampling alone, 2 BSDF sampling alone.
    pub strategy: u32,
    /// Radiance of a constant sky.
    pub sky: [f32; 3],
    /// 1 where the camera sees a backdrop instead of the sky.
    pub has_backdrop: u32,
    /// Colours of the backdrop: bottom, top.
    pub backdrop: [[f32; 3]; 2],
    /// Irradiance of the sky: its mean over all normals, 0 where it is not sampled; twin of `SkyIrradiance`, as are the next three.
    pub sky_mean: f32,
    /// What no component of the normal changes.
    pub sky_constant: f32,
    /// Factors of the normal's components.
    pub sky_linear: [f32; 3],
    /// Factors of their products: xx, yy, zz, xy, yz, zx.
    pub sky_squared: [f32; 6],
    /// Irradiance around all emissive surfaces; 0 where there are none.
    pub emitters_irradiance: f32,
    /// 1 where some light is sampled.
    pub is_sampled: u32,
    /// Irradiance in the world for an importance of 1 in the tree over lamps.
    pub lamp_tree_irradiance: f32,
    /// 0.
    pub reserved: u32,
}

/// Twin of `ReadyLamp`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs, reason = "as in ReadyLamp")]
pub struct Lamp {
    pub position: [f64; 3],
    /// 0 ball, 1 spot, 2 rectangle, 3 ellipse.
    pub kind: u32,
    pub axis: [f32; 3],
    pub sides: [[f32; 3]; 2],
    pub half: [f32; 2],
    pub radiance: [f32; 3],
    pub one_minus_cos_half_angle: f32,
    pub inverse_blend: f32,
    pub tan_half_spread: f32,
    pub spread_factor: f32,
    pub soft: u32,
    pub visible_to_camera: u32,
    pub intensity: f32,
}

/// Twin of `ReadySun`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs, reason = "as in ReadySun")]
pub struct Sun {
    pub towards: [f64; 3],
    pub tangent: [f64; 3],
    pub bitangent: [f64; 3],
    pub one_minus_cos_half_angle: f64,
    pub radiance: [f32; 3],
    /// Density within the cone; 0 for a single direction.
    pub cone_pdf: f32,
    pub irradiance: f32,
    pub sin_half_angle: f32,
}

/// Twin of `EnvironmentTable`; width 0 where the sky is constant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Environment {
    /// Three floats a pixel.
    pub pixels: Address,
    /// Cdf of rows of cells: height + 2 doubles.
    pub row_cdf: Address,
    /// Cdf within each row of cells: width + 1 floats a row.
    pub column_cdf: Address,
    /// Density of a row of cells where excess and sine are 1: height + 1 floats.
    pub row_density: Address,
    /// Rotation about +z, counter-clockwise.
    pub rotation_rad: f64,
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Factor on the radiance of the pixels.
    pub strength: f32,
    /// Brightness of pixels above which they are sampled, without `strength`.
    pub floor: f32,
}

/// Twin of `pumice_transport::light_tree::LightNode`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs, reason = "as there")]
pub struct LightNode {
    pub lo: [f32; 3],
    pub hi: [f32; 3],
    pub power: f32,
}

/// Twin of `pumice_transport::light_tree::Cone`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs, reason = "as there")]
pub struct Cone {
    pub axis: [f32; 3],
    pub cos_spread: f32,
    pub cos_reach: f32,
}

/// Twin of `pumice_transport::emitters::Emitter`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs, reason = "as there")]
pub struct Emitter {
    pub emissive_instance: u32,
    pub label: u32,
    pub origin: [u32; 3],
    pub first: u32,
    /// Two numbers of 16 bits each, the first in the lower half.
    pub ends: [u32; 3],
    pub planes: u32,
}

/// Twin of `pumice_transport::emitters::Place`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs, reason = "as there")]
pub struct EmissiveInstance {
    /// Columns of the matrix.
    pub world_from_index: [[f64; 3]; 3],
    pub units_per_world: f64,
    pub areas: [f32; 3],
    pub instance: u32,
    pub is_mesh: u32,
    pub keys: [u32; 2],
    pub reserved: u32,
}

/// Twin of `pumice_transport::emitters::EmissiveTriangle`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs, reason = "as there")]
pub struct EmissiveTriangle {
    pub corners: [[f32; 3]; 3],
    pub area: f32,
}

/// Twin of `pumice_transport::Emitters`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Emitters {
    /// Tree over all emitters.
    pub tree: LightTree,
    /// [`Emitter`]s, in the tree's order.
    pub emitters: Address,
    /// Face codes of boxes, 16 bits each.
    pub faces: Address,
    /// [`EmissiveTriangle`]s.
    pub triangles: Address,
    /// Numbers of emitters, sorted by key.
    pub by_key: Address,
    /// [`EmissiveInstance`]s.
    pub emissive_instances: Address,
    /// Index into `emissive_instances` by instance.
    pub emissive_instance_of: Address,
    /// Radius of the ball around all emitters, in the world.
    pub radius: f64,
    /// Entries of `emissive_instance_of`.
    pub emissive_instance_of_count: u32,
    /// 0.
    pub reserved: u32,
}

/// Twin of `pumice_transport::geometry::InstanceTree`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs, reason = "as there")]
pub struct InstanceTree {
    /// Nodes of its `pumice_transport::Bvh`; 0 where there is no tree and shaders test the instances one by one.
    pub nodes: Address,
    /// Numbers of instances.
    pub items: Address,
    pub translation: [f64; 3],
    pub cells_a_unit: f64,
    pub slack_a_unit: f64,
    pub slack: f64,
    /// Bounds of all instances, in cells: lower corner.
    pub lo: [u32; 3],
    /// Bounds of all instances, in cells: upper corner.
    pub hi: [u32; 3],
    /// `Bvh::pad`.
    pub pad: f32,
    /// 0.
    pub reserved: u32,
}

/// The root structure: shaders reach everything from it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs, reason = "as its types say")]
pub struct SceneHeader {
    /// [`Instance`]s.
    pub instances: Address,
    /// Albedo tables of the BSDF: `pumice_transport::bsdf::tables::TABLES`.
    pub tables: Address,
    pub camera: Camera,
    pub filter: Filter,
    pub settings: Settings,
    pub lights: Lights,
    pub environment: Environment,
    pub emitters: Emitters,
    pub instance_tree: InstanceTree,
    pub instance_count: u32,
    /// Pixels across the film, for addressing its rows.
    pub film_width: u32,
    /// `pumice_transport::geometry::Contacts::distance`; 0 where there are no contacts.
    pub contact_distance: f64,
}

/// Twin of the scene's `Material`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs, reason = "as in Material")]
pub struct Material {
    pub base_color: [f32; 3],
    pub metallic: f32,
    pub roughness: f32,
    pub specular: f32,
    pub ior: f32,
    pub emission: [f32; 3],
    pub specular_tint: [f32; 3],
    pub transmission: f32,
    pub coat: f32,
    pub coat_roughness: f32,
    pub coat_ior: f32,
    pub coat_tint: [f32; 3],
    pub sheen: f32,
    pub sheen_roughness: f32,
    pub sheen_tint: [f32; 3],
    pub alpha: f32,
    pub multiscatter: u32,
}

/// Twin of `Chunk`, over the boxes that are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Chunk {
    /// Word of the packed nodes from which the node numbers of its boxes count.
    pub node_base: u64,
    /// Byte offset of the leaves of its nodes among the instance's leaves.
    pub leaves: u64,
    /// Lowest voxel.
    pub origin: [u32; 3],
    /// Its first box among the drawn boxes.
    pub first_box: u32,
}

/// Twin of `Block` of `pumice_transport::geometry::Bricks`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct BrickBlock {
    /// One bit for each of its bricks, set where the brick holds a voxel.
    pub occupied: u64,
    /// Number of the first of these bricks; [`NONE`] where they are in a page that is not on the device.
    pub first_brick: u32,
    /// Number of that page among the volume's pages; 0 where there are none.
    pub page: u32,
}

/// Twin of `Brick` of `pumice_transport::geometry::Bricks`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Brick {
    /// Cells that hold a voxel, one bit each.
    pub occupied: u64,
    /// Cells that are full, one bit each.
    pub full: u64,
    /// Index of its first field among `brick_fields`.
    pub first_field: u32,
    /// Index of its first part among `brick_parts`.
    pub first_part: u32,
}

/// Twin of `BrickPart` of `pumice_transport::geometry::Bricks`, over the drawn boxes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct BrickPart {
    /// The cells of the brick that the box covers, one bit each.
    pub cells: u64,
    /// Number of the box.
    pub box_number: u32,
    /// Dense label of the box.
    pub label: u32,
}

/// A box of a page.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct PagedBox {
    /// The record as compressed.
    pub record: u64,
    /// Dense label.
    pub label: u32,
    /// Number of its page, which has the number of a chunk in the instance's list.
    pub page: u32,
}

/// Twin of `VolumeTracer` with its `Placement`: what is drawn of a volume, and its placement in the world.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Instance {
    /// [`Chunk`]s, in Morton order.
    pub chunks: Address,
    /// Box records as compressed, in Morton order.
    pub boxes: Address,
    /// Dense label of each box.
    pub labels: Address,
    /// Nodes as compressed, of drawn labels, with at least 4 bytes more behind them.
    pub nodes: Address,
    /// Slices and patterns of leaves.
    pub leaves: Address,
    /// Hierarchy for compute shaders: nodes of `pumice_transport::Bvh`, in their format; 0 where hardware traces.
    pub bvh_nodes: Address,
    /// Box number of each of its items.
    pub bvh_items: Address,
    /// Address of the top-level acceleration structure over this instance alone, in index space, placed by the identity; else 0.
    pub acceleration: Address,
    /// [`Material`]s.
    pub materials: Address,
    /// Material number by dense label; 0 where all labels have the first material.
    pub material_of_label: Address,
    /// [`CutPlane`]s, or 0.
    pub cut_planes: Address,
    /// Cryptomatte ids of each label: two floats, by label and by type; 0 where there are no mattes.
    pub matte_ids: Address,
    /// For a volume with smooth voxel normals: the end of each box's list of neighbours, then the lists; else 0.
    pub neighbors: Address,
    /// [`BrickBlock`]s of the whole volume, x first; 0 where boxes are drawn one by one.
    pub blocks: Address,
    /// [`Brick`]s, and one more that marks the end of the last one's parts.
    pub bricks: Address,
    /// Voxels of cells that are neither empty nor full, 8 bytes each.
    pub brick_fields: Address,
    /// [`BrickPart`]s.
    pub brick_parts: Address,
    /// Lowest voxel of each brick, three words each, where hardware finds bricks; else 0.
    pub brick_corners: Address,
    /// One bit for each page of the volume, set where a ray asked for it; 0 where the whole volume is on the device. With pages, `boxes`,
    /// `nodes`, `bricks`, `brick_fields` and `brick_parts` are the memory that all pages share, `boxes` are [`PagedBox`]es, and `chunks`
    /// has one entry for each page.
    pub page_marks: Address,
    /// World position of the origin of index space.
    pub translation: [f64; 3],
    /// Rows of the adjugate, times the determinant's sign.
    pub adjugate: [[f64; 3]; 3],
    /// Absolute determinant.
    pub determinant: f64,
    /// Unit normals of the upper faces in the world.
    pub normals: [[f64; 3]; 3],
    /// Bounds of all drawn boxes: lowest voxel.
    pub lo: [u32; 3],
    /// One past the highest voxel; where `lo` is not below it, there is no box.
    pub hi: [u32; 3],
    /// The volume's size in voxels.
    pub dims: [u32; 3],
    /// Number of chunks.
    pub chunk_count: u32,
    /// Pad of the hierarchy: how far its planes are moved outward, in voxels (`Bvh::pad`). Hardware's boxes are padded by this much.
    pub pad: f32,
    /// Number of entries of `material_of_label`; labels past them have the first material.
    pub label_count: u32,
    /// Level of detail of all boxes, or [`LOD_BY_DISTANCE`].
    pub lod: u32,
    /// Number of boxes.
    pub box_count: u32,
    /// Number of cut planes.
    pub cut_plane_count: u32,
    /// Fields of `pumice_transport::geometry::ByDistance`.
    pub eye_in_index: [f32; 3],
    /// As in `ByDistance`.
    pub edges_from_index: [[f32; 3]; 3],
    /// As in `ByDistance`: the squared distances from which on cells, and whole boxes, are drawn.
    pub coarser_from_squared: [f32; 2],
    /// Index of the last entry of `matte_ids`, which stands for all labels past it.
    pub last_matte_id: u32,
    /// Number of the body that the instance is part of (`pumice_transport::geometry::Contacts::body`).
    pub body: u32,
    /// 0.
    pub reserved: u32,
}

const _: () = assert!(size_of::<Instance>() == 456, "INSTANCE_BYTES of layout.glsl");

/// Twin of `CutPlane`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs, reason = "as in CutPlane")]
pub struct CutPlane {
    pub normal: [f64; 3],
    pub offset: f64,
    pub normal_in_world: [f64; 3],
    pub axis: u32,
    pub ends_part: u32,
}

/// [`Instance::lod`] where each box has a level of its own, chosen by distance.
pub const LOD_BY_DISTANCE: u32 = 3;

/// [`Instance::lod`] of a mesh; `pack::PackedMesh` documents the meaning of the other fields.
pub const LOD_TRIANGLES: u32 = 4;

/// [`Instance::lod`] of a mesh that is a shadow catcher.
pub const LOD_CATCHER: u32 = 5;

/// A surface that a path leaves or that a ray hit: twin of `Surface`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs, reason = "as in Surface")]
pub struct SurfaceRecord {
    /// [`NONE`] where there is no surface: a free point, or nothing was hit.
    pub instance: u32,
    pub voxel: [u32; 3],
    /// Axis in bits 0 and 1, `positive` in bit 2, the kind (`SurfaceKind`) above.
    pub face: u32,
    pub plane: u32,
    pub label: u32,
    /// The box that holds the voxel, or [`NONE`] where that is not known.
    pub box_number: u32,
}

/// Kind of a ray query.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Question {
    /// `Tracer::first_hit`.
    FirstHit = 0,
    /// `Tracer::occluded`: the record says only whether something was hit.
    Occluded = 1,
    /// `next_boundary` of `only` in instance `only_instance`.
    NextBoundary = 2,
}

/// One ray of `trace_rays`.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct RayRecord {
    /// World position at t = 0.
    pub origin: [f64; 3],
    /// World direction, of any length above 0.
    pub direction: [f64; 3],
    /// Hits at or beyond this t do not count.
    pub t_max: f64,
    /// The surface that the ray leaves; `instance` is [`NONE`] for a free point.
    pub from: SurfaceRecord,
    /// [`Question`].
    pub question: u32,
    /// Label of [`Question::NextBoundary`].
    pub only: u32,
    /// Instance of [`Question::NextBoundary`].
    pub only_instance: u32,
    /// 0.
    pub reserved: u32,
}

/// Result of a ray.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct HitRecord {
    /// Distance in units of the ray's direction.
    pub t: f64,
    /// Outward normal in the world.
    pub normal: [f64; 3],
    /// The surface; `instance` is [`NONE`] where nothing was hit.
    pub surface: SurfaceRecord,
    /// 1 where the ray came from within the object, else 0.
    pub from_inside: u32,
    /// 0.
    pub reserved: u32,
}

/// Passes of the first surface through the centre of a pixel: twin of `SurfaceAovs`.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs, reason = "as the passes are called")]
pub struct SurfaceAovsRecord {
    pub depth: f32,
    /// Dense label + 1; 0 on meshes and where nothing was hit.
    pub label: u32,
    /// Instance of that label; 0 where there is none.
    pub instance: u32,
    pub albedo: [f32; 3],
    pub normal: [f32; 3],
    pub position: [f32; 3],
}

/// What `resolve` finds, by [`Launch::wanted`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum ResolveStep {
    /// Mean of a pixel's samples: three floats.
    Color,
    /// Share of a pixel's samples that hit a surface: a float.
    Alpha,
    /// Sum of the squared relative errors in a strip of the film: a double.
    SquaredErrors,
}

/// A film that is resolved. Arrays have an element for each pixel, rows from the top.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Resolve {
    /// Sums of the film, `STRIDE` floats a pixel.
    pub sums: Address,
    /// Sums of passes, `pass_stride` floats a pixel; the first is alpha's for [`ResolveStep::Alpha`].
    pub pass_sums: Address,
    /// Which pixels rest, as [`Launch::resting`].
    pub resting: Address,
    /// What is found, in the order of the pixels, or of the strips.
    pub result: Address,
    /// Width of the film in pixels.
    pub width: u32,
    /// Height of the film in pixels.
    pub height: u32,
    /// Samples of each pixel that does not rest.
    pub samples: u32,
    /// `PassSums::stride`.
    pub pass_stride: u32,
}

/// What `denoise` does with each pixel of its tile, by [`Launch::wanted`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum DenoiseStep {
    /// Reads the tile's first surfaces, and writes the guides of these pixels.
    Guides,
    /// Takes mean and variance from the film's sums where there are some, and divides both by the base colour.
    Light,
    /// Pools the variance of a pixel with those around it.
    Pooled,
    /// Finds the mean of a pixel's first window and the variance of that mean.
    FirstWindow,
    /// Finds the mean of a pixel's second window and the variance of that mean, and puts them in place of the light's.
    SecondWindow,
    /// Replaces the picture's pixel by the mean of its third window; where the variance is known, it keeps the noisy pixel and compares both.
    ThirdWindow,
    /// Gives a filtered pixel its share of the noisy one, where the variance is known.
    Shrink,
}

/// A picture that is denoised. Arrays have an element for each pixel, rows from the top, unless another order is said.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Denoise {
    /// [`SurfaceAovsRecord`]s in the order of the tile's pixels, for [`DenoiseStep::Guides`].
    pub surfaces: Address,
    /// [`Guide`]s.
    pub guides: Address,
    /// Sums of the film, `STRIDE` floats a pixel; 0 where `image` and `variance` have what the host computed.
    pub sums: Address,
    /// Which pixels rest, as [`Launch::resting`].
    pub resting: Address,
    /// The picture, three floats a pixel: its mean until [`DenoiseStep::ThirdWindow`], filtered after it.
    pub image: Address,
    /// Variance of that mean, three floats a pixel.
    pub variance: Address,
    /// [`PixelLight`]s; after [`DenoiseStep::SecondWindow`] their means are those of the second window.
    pub light: Address,
    /// Variance of the light, three floats a pixel; after [`DenoiseStep::FirstWindow`] that of the first window's means. After
    /// [`DenoiseStep::ThirdWindow`], two of the three are noise and change of a pixel.
    pub light_variance: Address,
    /// Variance of the light that [`DenoiseStep::Pooled`] finds, three floats a pixel; after [`DenoiseStep::SecondWindow`] that of the second
    /// window's means.
    pub pooled_variance: Address,
    /// Means that [`DenoiseStep::FirstWindow`] finds, three floats a pixel; after [`DenoiseStep::ThirdWindow`] the noisy picture.
    pub smooth_mean: Address,
    /// Width of the picture in pixels.
    pub width: u32,
    /// Height of the picture in pixels.
    pub height: u32,
    /// Samples of each pixel that does not rest.
    pub samples: u32,
    /// 0 where no variance is known; then `variance` is not read.
    pub is_variance_known: u32,
    /// `WelchTest::t_squared` of the first window's test.
    pub t_squared: [f32; 3],
    /// The same of the wide windows'.
    pub wide_t_squared: [f32; 3],
    /// Pixels from one of a wide window to the next, of the second window and the third, as `wide_steps` says.
    pub wide_steps: [u32; 2],
}

/// The first surface of a pixel: one pixel of `pumice_picture::Guides`.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs, reason = "as in Guides")]
pub struct Guide {
    pub normal: [f32; 3],
    pub albedo: [f32; 3],
    pub label: u32,
    pub instance: u32,
    pub is_surface: u32,
}

/// Mean of the light of a pixel without its surface's colour, and whether it takes part.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
#[allow(missing_docs, reason = "as in the denoiser's Light")]
pub struct PixelLight {
    pub mean: [f32; 3],
    pub takes_part: u32,
}
