//! Functions and files without a twin, each with the reason; and twins that have another name.

/// A file with its entries: a function, and its reason or the name of its twin.
pub(crate) type Listed = (&'static str, &'static [(&'static str, &'static str)]);

/// Folders of which every Rust file is checked.
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

/// Further files: those that read a compressed volume, and normals.
pub(crate) const FILES: [&str; 4] =
    ["core/src/node.rs", "core/src/volume.rs", "core/src/box_record.rs", "core/src/octahedral.rs"];

const FRONT: &str = "a front end: finds boxes by another search than the twin's";
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
    ("box.rint", "the intersection shader of the ray tracing pipeline"),
    ("nothing.rmiss", "the miss shader that a pipeline must have"),
    ("trace_rays.glsl", "traces rays from a table, for tests"),
    ("probe_words.glsl", "words in and out, for tests"),
    ("probe.comp", "calls functions one by one, for tests"),
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
    ("cpu-renderer/src/cpu_renderer.rs", "the interface of a renderer; src/renderer.rs is its counterpart"),
    ("transport/src/emitters/faces.rs", "which faces are sampled: prepared before a ray is traced"),
    ("transport/src/emitters/gather.rs", "which surfaces are sampled: prepared before a ray is traced"),
    ("cpu-renderer/src/lib.rs", NAMES),
    ("cpu-renderer/src/traverse/ray_box_mask.rs", MASKS),
    ("cpu-renderer/src/traverse/ray_box_mask/avx2.rs", MASKS),
    ("cpu-renderer/src/traverse/ray_box_mask/avx512.rs", MASKS),
    ("cpu-renderer/src/traverse/mirrored.rs", MASKS),
    ("cpu-renderer/src/traverse/f64x4.rs", WIDE),
    ("cpu-renderer/src/traverse/avx.rs", WIDE),
    ("cpu-renderer/src/traverse/volume_tracer/making.rs", READY),
    ("transport/src/geometry/mesh_grid.rs", "corners and bounds: prepared before a ray is traced"),
    ("transport/src/scene_lights.rs", "lights are prepared before a ray is traced"),
    ("transport/src/geometry/visible_boxes.rs", READY),
    ("transport/src/geometry/label_of_box.rs", IN_PARTS),
    ("transport/src/geometry/brick_fields.rs", IN_PARTS),
    ("cpu-renderer/src/traverse/volume_tracer/drawn_boxes.rs", READY),
    ("transport/src/geometry/contacts.rs", READY),
    ("transport/src/geometry/neighbors.rs", "which boxes are near: prepared before a ray is traced"),
    ("cpu-renderer/src/traverse/mod.rs", NAMES),
    ("transport/src/geometry/mod.rs", "unrolls loops over axes for the compiler"),
    ("transport/src/lib.rs", NAMES),
    ("transport/src/geometry/bvh/build.rs", READY),
    ("picture/src/cryptomatte.rs", "names, and the mattes that the host computes from counts"),
    ("picture/src/exr_file.rs", FILE_FORMAT),
    ("picture/src/exr_header.rs", FILE_FORMAT),
    ("picture/src/exr_read.rs", FILE_FORMAT),
    ("picture/src/png_file.rs", FILE_FORMAT),
    ("picture/src/provenance_paths.rs", FILE_FORMAT),
    ("picture/src/provenance_text.rs", FILE_FORMAT),
    ("picture/src/radiance_file.rs", FILE_FORMAT),
    ("picture/src/sample_pictures.rs", "pictures for tests of files"),
    ("picture/src/image.rs", "pictures on the host"),
    ("picture/src/picture.rs", "pictures on the host"),
    ("picture/src/resting.rs", "the host decides which pixels rest, and sends a word for each"),
    ("picture/src/passes.rs", "which sums are kept, and the passes that the host computes from them"),
    ("picture/src/film_memory.rs", "how much memory a film takes on the host"),
    ("picture/src/picture_labels.rs", "what a finished picture tells of its labels"),
    ("picture/src/shadow_catcher.rs", "the host computes shadows from the sums of catchers"),
    ("transport/src/palette.rs", COLORS),
    ("transport/src/farthest_colors.rs", COLORS),
    ("cpu-renderer/src/traverse/volume_tracer/showing.rs", READY),
    ("picture/src/lib.rs", NAMES),
    ("transport/src/renderer.rs", "the interface of all renderers"),
    ("transport/src/loaded_scene.rs", "a scene with its data, before a renderer has it"),
    ("transport/src/scene_plan.rs", "which parts an edit rebuilds, decided before anything is built"),
    ("picture/src/view_transform.rs", "display colours of a finished picture"),
];

const WIDE: &str = "the same operations with the SIMD instructions of a kind of CPU";
const MASKS: &str =
    "a mask of all parts that a ray passes through; on a device a ray steps from part to part";
const READY: &str = "prepared before a ray is traced, for both renderers";
const READ: &str = "returns a field, which the shader reads directly";
const IN_PARTS: &str = "saves memory on the host; on a device, parts and fields have what it finds";
const COUNTED: &str = "counts memory or items on the host";
const BOX_KNOWN: &str = "a surface has the number of its box in the shader";
const CARRIED: &str = "adds what a scene does not need, for measurements; on a device `pack` does";
const COMPILED: &str = "whether a feature is needed: a specialisation constant of the shader";
const SHOWN: &str = "the host computes it from the sums, for both renderers";

/// Functions that only the host computes.
pub(crate) const HOST_FUNCTIONS: &[Listed] = &[
    (
        "core/src/box_record.rs",
        &[
            ("BoxRecord::new", "belongs to the compressor"),
            ("BoxRecord::node", "box_place extracts its bits"),
        ],
    ),
    ("core/src/octahedral.rs", &[("encode", "words are prepared before a ray is traced")]),
    (
        "core/src/node.rs",
        &[
            ("NodeRef::words", COUNTED),
            ("NodeRef::solid", "belongs to the compressor"),
            ("NodeRef::fields", READY),
            ("NodeRef::flipped_fields", READY),
            ("NodeRef::classes", "divides nodes into arrays, for files"),
            ("NodeRef::references", "divides nodes into arrays, for files"),
            ("FlippedFields::next", READY),
            ("node_words", "belongs to the compressor"),
            ("write_node", "belongs to the compressor"),
            ("extent_of", "tight bounds for the hierarchy: prepared before a ray is traced"),
        ],
    ),
    (
        "core/src/volume.rs",
        &[
            ("CompressedVolume::empty", "an empty volume has no box to read"),
            ("CompressedVolume::resident_parts", COUNTED),
            ("CompressedVolume::bytes", COUNTED),
            ("CompressedVolume::holds", "which labels were read: checked before anything is drawn"),
            ("CompressedVolume::is_whole", "which labels were read: checked before anything is drawn"),
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
            ("CompressedVolume::holds", "which labels were read: checked before anything is drawn"),
            ("CompressedVolume::is_whole", "which labels were read: checked before anything is drawn"),
            (
                "CompressedVolume::for_each_box",
                "packing and building hierarchies visit all boxes; rays do not",
            ),
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
            ("Emitters::radius", READ),
            ("Emitters::bytes", COUNTED),
        ],
    ),
    ("transport/src/lens.rs", &[("Lens::new", READY)]),
    (
        "transport/src/lights.rs",
        &[
    (
        "transport/src/sampler.rs",
        &[
            (
                "PixelSampler::set_sample",
                "keeps what a pixel's samples share; a device computes a sample at a time",
            ),
            (
                "PixelSampler::spread_set",
                "keeps what a pixel's samples share; a device computes a sample at a time",
            ),
        ],
    ),
            ("Lights::new", READY),
            ("Lights::with_lamps", READY),
            ("Lights::with_emitters", READY),
            ("Lights::has_sampled_light", READY),
            ("Lights::emitters", READ),
            ("Lights::sky_irradiance", READ),
            ("Lights::with_strategy", READY),
            ("Lights::sky", READ),
            ("Lights::suns", READ),
            ("Lights::lamps", READ),
            ("Lights::backdrop", READ),
            ("Lights::strategy", READ),
        ],
    ),
    (
        "transport/src/material_table.rs",
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
            ("MaterialTable::has_transparent", "a specialisation constant: NEEDS_TRANSPARENT"),
            ("MaterialTables::has_transparent", "a specialisation constant: NEEDS_TRANSPARENT"),
            ("MaterialTables::from", READ),
            ("MaterialTables::deref", READ),
            ("MaterialTables::deref_mut", READ),
            ("MaterialTable::is_emissive", "a specialisation constant: NEEDS_EMITTERS"),
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
            ("PathTracer::advance", "schedules samples; src/slices.rs and src/renderer.rs do it for devices"),
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
            ("Placement::normal", "prepared before a ray is traced: a table of three"),
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
            ("SceneTracer::with_contacts", READY),
            ("SceneTracer::contact_distance", READ),
            ("SceneTracer::mesh", "edits keep what is built"),
            ("SceneTracer::volumes", READ),
            ("SceneTracer::meshes", READ),
            ("SceneTracer::box_origin", BOX_KNOWN),
            ("SceneTracer::is_smooth", COMPILED),
            ("SceneTracer::bytes", COUNTED),
            ("SceneTracer::label_at", "a query about a voxel, not about a ray"),
        ],
    ),
    (
        "cpu-renderer/src/traverse/brick_walk.rs",
        &[
            ("BlockWalk::correct", "in brick_walk_begin, without a guess before it"),
            ("for_each_brick_along", "on a device the front end finds the bricks of a label"),
            ("steps_of", MASKS),
        ],
    ),
    (
        "transport/src/geometry/bricks.rs",
        &[
            ("Bricks::new", READY),
            ("Bricks::without", READY),
            ("Bricks::empty", READY),
            ("Bricks::finish", READY),
            ("Bricks::origin", READY),
            ("Bricks::mark", READY),
            ("Bricks::copy", READY),
            ("Bricks::next_brick", READY),
            ("Bricks::add", READY),
            ("Bricks::blocks", READ),
            ("Bricks::bricks", READ),
            ("Bricks::fields", READ),
            ("Bricks::items", READ),
            ("Bricks::items_of", READ),
            ("Bricks::sections_of", IN_PARTS),
            ("Bricks::range_of", IN_PARTS),
            ("Bricks::boxes_near", IN_PARTS),
            ("Bricks::label_of", IN_PARTS),
            ("Bricks::brick_with", "in item_in_bricks"),
            ("section_of", IN_PARTS),
            ("for_each_cell", READY),
            ("Bricks::level", "a field of the instance"),
            ("Bricks::bytes", COUNTED),
            ("boxes_by_brick", READY),
            ("f64x4", READY),
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
            ("VolumeTracer::label_at", "a query about a voxel, not about a ray"),
        ],
    ),
    (
        "cpu-renderer/src/traverse/volume_tracer/search.rs",
        &[("Search::found", "the caller of the twin looks the label up")],
    ),
    (
        "cpu-renderer/src/traverse/volume_tracer/surfaces.rs",
        &[(
            "VolumeTracer::for_each_box_near",
            "the twin asks bricks, or a search at one point, in item_with",
        )],
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
            ("EnvironmentTable::above", READY),
            ("pixel_solid_angle", READY),
            ("cell_solid_angle", READY),
        ],
    ),
    (
        "picture/src/film.rs",
        &[
            ("variance_known", SHOWN),
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
            ("FilmBuffer::clear", "a command clears the device's memory"),
            (
                "FilmBuffer::rest_by",
                "a command clears the device's memory, and the host decides which pixels rest",
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
    ("transport/src/lamp/mod.rs", &[("ReadyLamp::new", READY), ("ReadyLamp::intensity_of", READY)]),
    (
        "transport/src/sun.rs",
        &[
            ("ReadySun::new", READY),
            ("ReadySun::is_delta", "the shader tests whether cone_pdf is 0"),
            ("ReadySun::irradiance", READY),
            ("ReadySun::sin_half_angle", READY),
            ("ReadySun::cone_pdf", READY),
        ],
    ),
];

/// Functions whose twin has another name: GLSL has no methods that would distinguish two `new`, and one function there handles several
/// queries for which the CPU has separate functions.
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
            ("Bricks::box_with", "brick_part"),
            ("cell_of", "place_in"),
        ],
    ),
    (
        "cpu-renderer/src/traverse/volume_tracer/search.rs",
        &[
            ("VolumeTracer::nearest_in_bricks", "found_in_brick"),
            ("VolumeTracer::nearest_of_label", "visit_brick"),
        ],
    ),
    (
        "cpu-renderer/src/traverse/volume_tracer/surfaces.rs",
        &[
            ("VolumeTracer::coarse_element_end", "element_end"),
            ("VolumeTracer::face_out", "box_behind"),
            ("VolumeTracer::hit", "hit_of"),
        ],
    ),
    (
        "cpu-renderer/src/crossing.rs",
        // One loop there traces both the ray and the short rays through places where instances touch.
        &[
            ("visibility", "follow"),
            ("visibility_through", "follow"),
            ("first_hit", "next_hit"),
            ("next_hit_in_contact", "next_hit"),
            ("front_at", "next_hit"),
        ],
    ),
    (
        "transport/src/lights.rs",
        &[
            ("Lights::probability", "light_probability"),
            ("LightOdds::share", "light_probability"),
            ("Lights::weight", "light_weight"),
            ("Lights::all", "light_count"),
            ("Lights::odds", "light_odds"),
            ("Lights::choose", "choose_light"),
            ("Lights::lamp_emission_to_camera", "lamp_emission"),
        ],
    ),
    (
        "transport/src/environment.rs",
        &[("row_angles", "environment_sample"), ("rows_around", "environment_sample")],
    ),
    ("transport/src/lamp/ball.rs", &[("smoothstep", "smoothstep_of")]),
    ("transport/src/material_table.rs", &[("MaterialTable::material", "material_of")]),
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
        // GLSL has one type of film sample: where light is not divided, only the sum is compiled.
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
        // The searches are those of volumes; the items that they test differ.
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
            ("Nearest::comes_first", "comes_before"),
            ("SceneTracer::near", "scene_ask"),
            ("SceneTracer::first_volume_besides", "scene_ask"),
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
            ("any_will_do", "volume_ask"),
            ("VolumeTracer::box_of", "visit"),
            ("VolumeTracer::label_of", "visit"),
        ],
    ),
    (
        "transport/src/geometry/bvh.rs",
        &[("order_table", "in_order"), ("Node::child_bounds", "child_may_hold")],
    ),
    ("picture/src/film.rs", &[("FilmBuffer::rows_mut", "film_add")]),
    ("transport/src/sampler.rs", &[("mix", "mix64"), ("hashed_upward", "owen_scramble")]),
    (
        "transport/src/trace.rs",
        // The trait declares these and the tracers implement them; the twin defines a hit.
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
            ("Tracer::contact_distance", "is_hit"),
            ("Arc::contact_distance", "is_hit"),
            ("Tracer::first_volume_besides", "is_hit"),
            ("Arc::first_volume_besides", "is_hit"),
            ("Tracer::are_one", "is_hit"),
            ("Arc::are_one", "is_hit"),
        ],
    ),
];
