//! What has no twin, with the reason; and twins of other names.

/// A file, and its entries: a function, and its reason or its other name.
pub(crate) type Listed = (&'static str, &'static [(&'static str, &'static str)]);

/// Folders of which every Rust file is looked at.
pub(crate) const FOLDERS: [&str; 11] = [
    "cpu-renderer/src",
    "cpu-renderer/src/traverse",
    "cpu-renderer/src/traverse/ray_box_mask",
    "cpu-renderer/src/traverse/volume_tracer",
    "picture/src",
    "transport/src",
    "transport/src/bsdf",
    "transport/src/emitters",
    "transport/src/geometry",
    "transport/src/geometry/bvh",
    "transport/src/lamp",
];

/// Files besides: what reads a compressed volume, and normals.
pub(crate) const FILES: [&str; 4] =
    ["core/src/node.rs", "core/src/volume.rs", "core/src/box_record.rs", "core/src/octahedral.rs"];

const FRONT: &str = "a front end: the twin's hierarchy in its place, asked in another way";
const ENTRY: &str = "an entry point: includes a twin and calls it once a pixel or ray";

/// Shaders without a file of their own on the CPU.
pub(crate) const SHADERS_ALONE: &[(&str, &str)] = &[
    ("dvec3.glsl", "the CPU has glam's DVec3"),
    ("f64.glsl", "the CPU has the language's doubles"),
    ("trigonometry.glsl", "the CPU has the language's functions"),
    ("launch.glsl", "push constants"),
    ("front_bvh.glsl", FRONT),
    ("front_query.glsl", FRONT),
    ("front_pipeline.glsl", FRONT),
    ("hardware_ray.glsl", FRONT),
    ("box.rint", "what visits boxes in the ray tracing pipeline"),
    ("nothing.rmiss", "a pipeline must have one"),
    ("trace_rays.glsl", "rays in, hits out, for tests"),
    ("probe.comp", "functions one by one, for tests"),
    ("trace_rays.rgen", ENTRY),
    ("trace_rays_bvh.comp", ENTRY),
    ("trace_rays_query.comp", ENTRY),
    ("first.rgen", ENTRY),
    ("first_bvh.comp", ENTRY),
    ("first_query.comp", ENTRY),
    ("path.rgen", ENTRY),
    ("path_bvh.comp", ENTRY),
    ("path_query.comp", ENTRY),
];

const FILE_FORMAT: &str = "reads or writes files";
const NAMES: &str = "names modules or types";
const COLORS: &str = "colours of labels are found before a ray is traced";

/// Files that trace no ray.
pub(crate) const HOST_FILES: &[(&str, &str)] = &[
    (
        "cpu-renderer/src/cpu_renderer.rs",
        "what a renderer is asked from outside; src/renderer.rs is beside it",
    ),
    ("transport/src/emitters/faces.rs", "which faces are aimed at: made ready before a ray is traced"),
    ("transport/src/emitters/gather.rs", "what is aimed at: made ready before a ray is traced"),
    ("cpu-renderer/src/lib.rs", NAMES),
    ("cpu-renderer/src/traverse/ray_box_mask.rs", MASKS),
    ("cpu-renderer/src/traverse/ray_box_mask/avx2.rs", MASKS),
    ("cpu-renderer/src/traverse/ray_box_mask/avx512.rs", MASKS),
    ("cpu-renderer/src/traverse/mirrored.rs", MASKS),
    ("cpu-renderer/src/traverse/f64x4.rs", WIDE),
    ("cpu-renderer/src/traverse/avx.rs", WIDE),
    ("cpu-renderer/src/traverse/volume_tracer/making.rs", READY),
    ("transport/src/geometry/mesh_grid.rs", "corners and bounds: made ready before a ray is traced"),
    ("transport/src/scene_lights.rs", "lights are made ready before a ray is traced"),
    ("transport/src/geometry/visible_boxes.rs", READY),
    ("transport/src/geometry/neighbors.rs", "which boxes are near: made ready before a ray is traced"),
    ("cpu-renderer/src/traverse/mod.rs", NAMES),
    ("transport/src/geometry/mod.rs", "unrolls loops over axes for the compiler"),
    ("transport/src/lib.rs", NAMES),
    ("transport/src/geometry/bvh/build.rs", READY),
    ("picture/src/atomic_file.rs", FILE_FORMAT),
    ("picture/src/cryptomatte.rs", "names, and what is made of counts on the host"),
    ("picture/src/exr_file.rs", FILE_FORMAT),
    ("picture/src/exr_header.rs", FILE_FORMAT),
    ("picture/src/exr_read.rs", FILE_FORMAT),
    ("picture/src/png_file.rs", FILE_FORMAT),
    ("picture/src/provenance_text.rs", FILE_FORMAT),
    ("picture/src/sample_pictures.rs", "pictures for tests of files"),
    ("picture/src/image.rs", "pictures on the host"),
    ("picture/src/picture.rs", "pictures on the host"),
    ("picture/src/preview.rs", "filters live pictures on the host"),
    ("picture/src/resting.rs", "the host materials at the film; a device is told who rests, word by word"),
    ("picture/src/passes.rs", "which sums are kept, and what is made of them on the host"),
    ("picture/src/shadow_catcher.rs", "what is made of catchers' sums on the host"),
    ("transport/src/palette.rs", COLORS),
    ("picture/src/lib.rs", NAMES),
    ("transport/src/renderer.rs", "the interface of all renderers"),
    ("transport/src/loaded_scene.rs", "a scene with its data, before a renderer has it"),
    ("transport/src/scene_plan.rs", "what an edit makes anew, decided before anything is built"),
    ("picture/src/view_transform.rs", "what a screen shows of a finished picture"),
];

const WIDE: &str = "the same operations by what a kind of processor has for several numbers at once";
const MASKS: &str = "all that a ray passes through at once; on a device a ray goes from one to the next";
const READY: &str = "made ready before a ray is traced, for both renderers";
const READ: &str = "hands out a field, which the shader reads itself";
const COUNTED: &str = "counts memory or items of the host's";
const BOX_KNOWN: &str = "surfaces know the number of their box there";
const CARRIED: &str = "puts in what a scene does not need, to be measured; on a device `pack` does";
const COMPILED: &str = "whether to ask at all: there a constant of the shader";
const SHOWN: &str = "what is made of the sums is the host's, for both renderers";

/// Functions that the host alone computes.
pub(crate) const HOST_FUNCTIONS: &[Listed] = &[
    (
        "core/src/box_record.rs",
        &[("BoxRecord::new", "the compressor's"), ("BoxRecord::node", "its bits are taken out in box_place")],
    ),
    ("core/src/octahedral.rs", &[("encode", "words are made before a ray is traced")]),
    (
        "core/src/node.rs",
        &[
            ("NodeRef::words", COUNTED),
            ("NodeRef::solid", "the compressor's"),
            ("NodeRef::fields", READY),
            ("NodeRef::flipped_fields", READY),
            ("NodeRef::classes", "takes nodes apart, for files"),
            ("NodeRef::references", "takes nodes apart, for files"),
            ("FlippedFields::next", READY),
            ("node_words", "the compressor's"),
            ("write_node", "the compressor's"),
            ("extent_of", "tight bounds for the hierarchy: ready before"),
        ],
    ),
    (
        "core/src/volume.rs",
        &[
            ("CompressedVolume::empty", "an empty volume has no box to read"),
            ("CompressedVolume::resident_parts", COUNTED),
            ("CompressedVolume::bytes", COUNTED),
            ("CompressedVolume::holds", "which labels were read: asked before anything is drawn"),
            ("CompressedVolume::is_whole", "the same"),
            ("CompressedVolume::info", READ),
            ("CompressedVolume::labels", READ),
            ("CompressedVolume::chunks", READ),
            ("CompressedVolume::runs", READ),
            ("CompressedVolume::boxes", READ),
            ("CompressedVolume::nodes", READ),
            ("CompressedVolume::leaves", READ),
            ("CompressedVolume::of", COUNTED),
            ("CompressedVolume::mapped_bytes", COUNTED),
            ("CompressedVolume::note", "texts about labels"),
            ("CompressedVolume::holds", "which labels were read is asked before anything is drawn"),
            ("CompressedVolume::is_whole", "which labels were read is asked before anything is drawn"),
            ("CompressedVolume::for_each_box", "packing and hierarchies walk over all; rays do not"),
        ],
    ),
    ("transport/src/bsdf/tables.rs", &[("floats", READY)]),
    (
        "transport/src/camera_rays.rs",
        &[("CameraRays::new", READY), ("CameraRays::near", READ), ("fitted_side", READY)],
    ),
    (
        "transport/src/emitters/light_tree.rs",
        &[
            ("LightTree::new", READY),
            ("LightTree::nodes", READ),
            ("LightTree::len", COUNTED),
            ("LightTree::is_empty", COUNTED),
            ("LightTree::bytes", COUNTED),
            ("fill", READY),
        ],
    ),
    (
        "transport/src/emitters/mod.rs",
        &[
            ("Emitters::new", READY),
            ("Emitters::of", READY),
            ("Emitters::emissive_instances", READ),
            ("Emitters::emissive_instance_of", READ),
            ("Emitters::emitters", READ),
            ("Emitters::faces", READ),
            ("Emitters::triangles", READ),
            ("Emitters::by_key", READ),
            ("Emitters::tree", READ),
            ("Emitters::irradiance", READY),
            ("Emitters::bytes", COUNTED),
        ],
    ),
    ("transport/src/lens.rs", &[("Lens::new", READY)]),
    (
        "transport/src/lights.rs",
        &[
            ("Lights::new", READY),
            ("Lights::with_lamps", READY),
            ("Lights::with_emitters", READY),
            ("Lights::probability_of_emitters", READY),
            ("Lights::powers", READY),
            ("Lights::emitters", READ),
            ("Lights::emitters_probability", READ),
            ("light_cdf", READY),
            ("Lights::with_strategy", READY),
            ("Lights::sky", READ),
            ("Lights::suns", READ),
            ("Lights::lamps", READ),
            ("Lights::backdrop", READ),
            ("Lights::cdf", READ),
            ("Lights::strategy", READ),
        ],
    ),
    (
        "transport/src/materials.rs",
        &[
            ("MaterialTable::same", READY),
            ("MaterialTables::new", READY),
            ("MaterialTable::catching", READY),
            ("MaterialTable::new", READY),
            ("MaterialTable::of_mesh", READY),
            ("MaterialTable::materials", READ),
            ("MaterialTable::of_label", READ),
            ("MaterialTable::with_ids", READY),
            ("MaterialTable::ids", READ),
            ("MaterialTable::has_transparent", "a need, known before: NEEDS_TRANSPARENT"),
            ("MaterialTables::has_transparent", "a need, known before: NEEDS_TRANSPARENT"),
            ("MaterialTables::from", READ),
            ("MaterialTables::deref", READ),
            ("MaterialTables::deref_mut", READ),
            ("MaterialTable::is_emissive", "a need, known before: NEEDS_EMITTERS"),
            ("MaterialTable::bytes", COUNTED),
        ],
    ),
    (
        "cpu-renderer/src/path_tracer.rs",
        &[
            ("PathTracer::new", READY),
            ("PathTracer::restart", READY),
            ("PathTracer::sort_into_aovs", CARRIED),
            ("PathTracer::tracer", READ),
            ("PathTracer::film", READ),
            ("PathTracer::around", READ),
            ("PathTracer::rays", READ),
            ("PathTracer::advance", "when samples are taken; src/slices.rs and src/renderer.rs for devices"),
            ("PathTracer::error_estimate", SHOWN),
            ("PathTracer::picture", SHOWN),
        ],
    ),
    (
        "transport/src/geometry/cuts.rs",
        &[("CutPlane::new", READY), ("Cuts::new", READY), ("Cuts::is_empty", READ), ("Cuts::planes", READ)],
    ),
    (
        "transport/src/geometry/placement.rs",
        &[
            ("Placement::of_instance", READY),
            ("Placement::new", READY),
            ("Placement::normal", "ready before: a table of three"),
        ],
    ),
    (
        "transport/src/geometry/instance_tree.rs",
        &[
            ("WorldBounds::new", READY),
            ("InstanceTree::new", READY),
            ("InstanceTree::bvh", READ),
            ("InstanceTree::bytes", COUNTED),
        ],
    ),
    (
        "transport/src/geometry/lod.rs",
        &[
            ("LodChoice::new", READY),
            ("LodChoice::placed", READY),
            ("LodChoice::with_level_bounds", CARRIED),
            ("Detail::everywhere", READY),
            ("ByDistance::is_aligned", READY),
        ],
    ),
    (
        "cpu-renderer/src/traverse/mesh_tracer.rs",
        &[
            ("MeshTracer::instance", READ),
            ("MeshTracer::new", READY),
            ("MeshTracer::again", READY),
            ("MeshTracer::mesh", READ),
            ("MeshTracer::placement", READ),
            ("MeshTracer::is_smooth", COMPILED),
            ("MeshTracer::world_bounds", READY),
            ("MeshTracer::hierarchy_address", COUNTED),
            ("MeshTracer::bytes", COUNTED),
        ],
    ),
    (
        "cpu-renderer/src/traverse/scene_tracer.rs",
        &[
            ("SceneTracer::new", READY),
            ("SceneTracer::of", READY),
            ("SceneTracer::without_bricks", READY),
            ("SceneTracer::brick_bytes", COUNTED),
            ("SceneTracer::own_volumes", COUNTED),
            ("SceneTracer::with_meshes", READY),
            ("SceneTracer::with_tree", READY),
            ("SceneTracer::with_tree_of", READY),
            ("SceneTracer::tree", READ),
            ("SceneTracer::world_bounds", READY),
            ("SceneTracer::with_catchers", READY),
            ("SceneTracer::mesh", "edits keep what is built"),
            ("SceneTracer::volumes", READ),
            ("SceneTracer::meshes", READ),
            ("SceneTracer::box_origin", BOX_KNOWN),
            ("SceneTracer::is_smooth", COMPILED),
            ("SceneTracer::bytes", COUNTED),
            ("SceneTracer::label_at", "asked about a voxel, not by a ray"),
        ],
    ),
    (
        "cpu-renderer/src/traverse/brick_walk.rs",
        &[("BlockWalk::correct", "in brick_walk_begin, without a guess before it"), ("steps_of", MASKS)],
    ),
    (
        "transport/src/geometry/bricks.rs",
        &[
            ("Bricks::new", READY),
            ("Bricks::next_brick", READY),
            ("Bricks::add", READY),
            ("Bricks::blocks", READ),
            ("Bricks::bricks", READ),
            ("Bricks::fields", READ),
            ("Bricks::parts", READ),
            ("Bricks::level", "the instance's"),
            ("Bricks::bytes", COUNTED),
            ("boxes_by_brick", READY),
            ("four", READY),
            ("within", READY),
            ("bounds_of", READY),
        ],
    ),
    (
        "cpu-renderer/src/traverse/volume_tracer.rs",
        &[
            ("VolumeTracer::is_hidden", CARRIED),
            ("VolumeTracer::box_origin", BOX_KNOWN),
            ("VolumeTracer::is_smooth", COMPILED),
            ("VolumeTracer::label_at", "asked about a voxel, not by a ray"),
        ],
    ),
    (
        "transport/src/geometry/bvh.rs",
        &[
            ("BoxBounds::union", READY),
            ("BoxBounds::pad", READY),
            ("BoxBounds::contains", READY),
            ("Bvh::build", READY),
            ("Bvh::build_within", READY),
            ("Bvh::depth", COUNTED),
            ("Bvh::bounds", READ),
            ("Bvh::len", COUNTED),
            ("Bvh::is_empty", COUNTED),
            ("Bvh::bytes", COUNTED),
            ("Bvh::node_bytes", READ),
            ("Bvh::items", READ),
            ("Bvh::pad", READ),
        ],
    ),
    (
        "transport/src/environment.rs",
        &[
            ("EnvironmentTable::new", READY),
            ("EnvironmentTable::total_radiance", READY),
            ("pixel_solid_angle", READY),
        ],
    ),
    (
        "picture/src/film.rs",
        &[
            ("FilmBuffer::new", READY),
            ("FilmBuffer::with_passes", READY),
            ("FilmBuffer::kept", READ),
            ("FilmBuffer::pass_sums", READ),
            ("FilmBuffer::pass_sums_mut", READ),
            ("FilmBuffer::samples_of", COUNTED),
            ("FilmBuffer::sums", READ),
            ("FilmBuffer::sums_mut", READ),
            ("FilmBuffer::size", READ),
            ("FilmBuffer::bytes", COUNTED),
            ("FilmBuffer::clear", "a device's memory is cleared by a command"),
            (
                "FilmBuffer::rest_by",
                "a device's memory is cleared by a command, and who rests is the host's business",
            ),
            ("FilmBuffer::spp", COUNTED),
            ("FilmBuffer::mean_spp", COUNTED),
            ("FilmBuffer::moments", SHOWN),
            ("FilmBuffer::mean", SHOWN),
            ("FilmBuffer::variance", SHOWN),
            ("FilmBuffer::picture_of", SHOWN),
            ("FilmBuffer::error_estimate_of", SHOWN),
            ("FilmBuffer::squared_errors_of", SHOWN),
            ("FilmBuffer::error_estimate", SHOWN),
        ],
    ),
    (
        "transport/src/filter.rs",
        &[
            ("FilterTable::new", READY),
            ("FilterTable::width", READ),
            ("FilterTable::inverse", READ),
            ("half_distribution", READY),
        ],
    ),
    ("transport/src/lamp/mod.rs", &[("ReadyLamp::new", READY), ("ReadyLamp::power", READY)]),
    (
        "transport/src/sun.rs",
        &[
            ("ReadySun::new", READY),
            ("ReadySun::is_delta", "the shader asks whether cone_pdf is 0"),
            ("ReadySun::irradiance", READY),
            ("ReadySun::cone_pdf", READY),
        ],
    ),
];

/// Functions whose twin has another name: GLSL has no methods to tell two `new` apart, and one function there answers questions that
/// the CPU compiles apart.
pub(crate) const OTHER_NAMES: &[Listed] = &[
    ("transport/src/emitters/mod.rs", &[("Emitter::key", "key_is_before")]),
    ("core/src/box_record.rs", &[("BoxRecord::cell", "box_place"), ("BoxRecord::extent", "box_place")]),
    (
        "core/src/volume.rs",
        &[
            ("CompressedVolume::place_of_box", "box_place"),
            ("CompressedVolume::box_at", "box_view"),
            ("place_of", "box_place"),
        ],
    ),
    (
        "cpu-renderer/src/traverse/brick_walk.rs",
        &[
            ("BlockWalk::begin", "brick_walk_begin"),
            ("BlockWalk::step", "brick_walk_step"),
            ("BrickSearch::first_of_brick", "first_of_walk"),
        ],
    ),
    (
        "transport/src/geometry/bricks.rs",
        &[
            ("Bricks::occupied", "block_at"),
            ("Bricks::brick", "block_brick"),
            ("Bricks::field", "brick_field"),
            ("Bricks::part", "brick_part"),
        ],
    ),
    ("cpu-renderer/src/traverse/volume_tracer.rs", &[("VolumeTracer::nearest_in_bricks", "found_in_brick")]),
    ("cpu-renderer/src/crossing.rs", &[("visibility", "follow"), ("visibility_through", "follow")]),
    (
        "transport/src/lights.rs",
        &[("Lights::probability", "light_probability"), ("Lights::lamp_emission_to_camera", "lamp_emission")],
    ),
    ("transport/src/lamp/ball.rs", &[("smoothstep", "smoothstep_of")]),
    ("transport/src/materials.rs", &[("MaterialTable::material", "material_of")]),
    (
        "cpu-renderer/src/path.rs",
        &[("radiance", "follow"), ("ambient", "follow"), ("path", "follow"), ("Way::lamps", "follow")],
    ),
    (
        "cpu-renderer/src/path_tracer.rs",
        &[("PathTracer::pick", "first_of_pixel"), ("PathTracer::first", "first_of_pixel")],
    ),
    (
        "cpu-renderer/src/film_sample.rs",
        // One film sample there: where nothing is sorted, it is compiled to the sum alone.
        &[
            ("ColorSample::add_emission", "film_sample_add_emission"),
            ("ColorSample::add_background", "film_sample_add_background"),
            ("ColorSample::add_direct_light", "film_sample_add_direct_light"),
            ("ColorSample::scatter", "film_sample_scatter"),
            ("ColorSample::write_aovs", "film_sample_write_aovs"),
            ("ColorSample::write_ids", "film_sample_write_ids"),
            ("AovSample::write_ids", "film_sample_write_ids"),
            ("AovSample::new", "film_sample_new"),
            ("AovSample::clamped", "film_sample_clamped"),
            ("AovSample::deal", "film_sample_deal"),
            ("AovSample::add_to", "film_sample_add_to"),
            ("AovSample::add_emission", "film_sample_add_emission"),
            ("AovSample::add_background", "film_sample_add_background"),
            ("AovSample::add_direct_light", "film_sample_add_direct_light"),
            ("AovSample::scatter", "film_sample_scatter"),
            ("AovSample::write_aovs", "film_sample_write_aovs"),
            ("AovSample::among_catchers", "film_sample_among_catchers"),
            ("AovSample::put", "film_sample_put"),
            ("AovSample::caught", "film_sample_caught"),
            ("AovSample::catches", "film_sample_catches"),
        ],
    ),
    (
        "cpu-renderer/src/traverse/index_ray.rs",
        // The adjugate and the translation of a placement are uploaded; a scale by a power of two is f64.glsl's.
        &[
            ("IndexRay::in_mesh_grid", "index_ray_new"),
            ("Moved::new", "placement_moved"),
            ("Moved::scaled_from_world", "index_ray_new"),
            ("f64x4_from_world", "index_from_world"),
            ("Moved::start_along_face", "start_on_face"),
            ("IndexRay::clip_by", "clip"),
            ("IndexRay::t_of_each", "t_of"),
            ("turned_finite", "index_ray_new"),
            ("scaled_f64x4", "scaled"),
            ("surface_of", "index_ray_new"),
        ],
    ),
    (
        "transport/src/geometry/power_of_two.rs",
        &[("scaled_extreme", "scaled"), ("exponent", "scaled"), ("exp2", "scaled")],
    ),
    ("cpu-renderer/src/traverse/cut_ray.rs", &[("crossing", "cut_plane_crossing")]),
    (
        "transport/src/geometry/lod.rs",
        &[
            ("Detail::level", "lod_level"),
            ("ByDistance::level", "lod_level"),
            ("ByDistance::distance_squared", "lod_level"),
        ],
    ),
    (
        "cpu-renderer/src/traverse/mesh_tracer.rs",
        // Searches are those of volumes; what is looked at differs.
        &[
            ("MeshTracer::nearest", "visit_triangle"),
            ("MeshTracer::first_hit", "visit_triangle"),
            ("MeshTracer::first_hit_within", "visit_triangle"),
            ("MeshTracer::occluded", "visit_triangle"),
        ],
    ),
    ("cpu-renderer/src/traverse/box_walk.rs", &[("Walk::whole_box", "walk_first_solid")]),
    (
        "cpu-renderer/src/traverse/scene_tracer.rs",
        &[
            ("SceneTracer::instance", "instance_at"),
            ("SceneTracer::next_boundary", "scene_ask"),
            ("SceneTracer::first_hit", "scene_ask"),
            ("SceneTracer::occluded", "scene_ask"),
            ("SceneTracer::ask", "scene_ask"),
            ("SceneTracer::occludes", "scene_ask"),
            ("SceneTracer::left", "scene_ask"),
            ("SceneTracer::first_hit_by_tree", "scene_ask"),
            ("SceneTracer::occluded_by_tree", "scene_ask"),
            ("Nearest::new", "scene_ask"),
            ("Nearest::see", "scene_ask"),
            ("SceneTracer::catchers", "scene_ask"),
        ],
    ),
    (
        "cpu-renderer/src/traverse/volume_tracer.rs",
        &[
            ("VolumeTracer::next_boundary", "volume_ask"),
            ("VolumeTracer::surface_along", "volume_ask"),
            ("VolumeTracer::kept_surface_along", "volume_ask"),
            ("VolumeTracer::face_hit", "volume_ask"),
            ("VolumeTracer::first_hit", "volume_ask"),
            ("VolumeTracer::first_hit_by", "volume_ask"),
            ("VolumeTracer::surface_of_nearest", "volume_ask"),
            ("VolumeTracer::first_hit_within", "volume_ask"),
            ("VolumeTracer::occluded", "volume_ask"),
            ("VolumeTracer::occluded_by", "volume_ask"),
            ("VolumeTracer::coarse_element_end", "element_end"),
            ("any_will_do", "volume_ask"),
            ("VolumeTracer::hit", "hit_of"),
            ("VolumeTracer::box_of", "visit"),
            ("VolumeTracer::label_of", "visit"),
        ],
    ),
    (
        "transport/src/geometry/bvh.rs",
        &[("order_table", "in_order"), ("Node::child_bounds", "child_may_hold")],
    ),
    ("picture/src/film.rs", &[("FilmBuffer::rows_mut", "film_add")]),
    ("transport/src/sampler.rs", &[("mix", "mix64")]),
    (
        "transport/src/trace.rs",
        // Declared here, answered in the tracers: what a hit is, is the twin's.
        &[
            ("Tracer::first_hit", "is_hit"),
            ("Tracer::occluded", "is_hit"),
            ("Arc::first_hit", "is_hit"),
            ("Arc::occluded", "is_hit"),
            ("Tracer::box_origin", "surface_from_record"),
            ("Arc::box_origin", "surface_from_record"),
            ("Tracer::smooth_normal", "on_side_of"),
            ("Arc::smooth_normal", "on_side_of"),
            ("Tracer::shading_normal", "on_side_of"),
            ("Tracer::is_smooth", "is_hit"),
            ("Arc::is_smooth", "is_hit"),
            ("Tracer::catchers", "no_surface"),
            ("Arc::catchers", "no_surface"),
        ],
    ),
];
