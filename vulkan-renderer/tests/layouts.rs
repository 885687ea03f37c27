//! Compares the structures of `src/layout.rs` with those that the compiled shaders read: name, offset and type of every field.
//!
//! On the Rust side it takes the compiler's own offsets of all fields, by a pattern that names each (if one is missing, it does not
//! compile). On the SPIR-V side it takes the decorations of every checked-in module. No device is needed.

#![allow(clippy::expect_used, clippy::panic, reason = "tests")]

#[path = "layouts/reflection.rs"]
mod reflection;

use std::collections::BTreeSet;
use std::mem::offset_of;
use std::path::Path;

use bytemuck::{Pod, Zeroable};
use pumice_scene::PartSet;
use pumice_transport::Bvh;
use pumice_transport::geometry::bvh::BoxBounds;
use pumice_vulkan::layout::{
    Brick, BrickBlock, BrickPart, Camera, Chunk, Cone, CutPlane, Denoise, DenoiseStep, EmissiveInstance,
    EmissiveTriangle, Emitter, Emitters, Environment, Filter, Guide, HitRecord, Instance, InstanceTree,
    LOD_BY_DISTANCE, LOD_CATCHER, LOD_TRIANGLES, Lamp, Launch, LightNode, LightTree, Lights, Material, NONE,
    PAGE_COUNTS, PagedBox, PixelLight, Question, RayRecord, Resolve, ResolveStep, SCRATCH_BYTES, SceneHeader,
    Settings, Sun, SurfaceAovsRecord, SurfaceRecord,
};
use pumice_vulkan::pack::{FLOATS_FIRST, ShaderNeeds};
use reflection::{Field, Layout, constants_read, layouts};

/// The shaders' name of a type. Doubles are integers there.
trait Shape {
    fn shape() -> String;
}

macro_rules! shapes {
    ($($rust:ty => $glsl:literal),*) => {
        $(impl Shape for $rust {
            fn shape() -> String {
                $glsl.to_owned()
            }
        })*
    };
}

shapes!(u32 => "u32", f32 => "f32", u64 => "u64", f64 => "u64", Camera => "CameraRecord", Filter => "Filter",
    Settings => "Settings", Lights => "Lights", Environment => "Environment", Emitters => "Emitters", LightTree => "LightTree", InstanceTree => "InstanceTree", SurfaceRecord => "SurfaceRecord");

impl<T: Shape, const N: usize> Shape for [T; N] {
    fn shape() -> String {
        format!("[{}; {N}]", T::shape())
    }
}

/// The shaders' name of a field's type.
fn shape_of<T: Shape>(_: &T) -> String {
    T::shape()
}

/// Lists the fields of a Rust structure under their names in GLSL.
macro_rules! twin {
    ($glsl:literal, $rust:ident { $($field:ident $(as $other:literal)?),* $(,)? }) => {{
        // Names all fields, or it does not compile.
        let $rust { $($field),* } = $rust::zeroed();
        let mut fields = vec![$(Field {
            name: [$($other,)? stringify!($field)][0].to_owned(),
            offset: offset_of!($rust, $field),
            shape: shape_of(&$field),
        }),*];
        fields.sort_by_key(|f| f.offset);
        Layout { name: $glsl.to_owned(), fields, end: size_of::<$rust>(), strides: vec![size_of::<$rust>()] }
    }};
}

/// A node as documented in `pumice_transport::geometry::bvh`, whose own type is private. `hierarchies_lie_as_drawn` compares it with real
/// nodes.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct BvhNode {
    origin: [f32; 3],
    exponents_and_inner: u32,
    first_child: u32,
    first_item: u32,
    meta: [u32; 2],
    lo: [[u32; 2]; 3],
    hi: [[u32; 2]; 3],
}

fn twins() -> Vec<Layout> {
    vec![
        twin!(
            "Launch",
            Launch {
                scene,
                input as "source",
                output as "target",
                scratch,
                resting,
                page_requests,
                samples_done,
                tile_x,
                tile_y,
                tile_width,
                tile_height,
                first_sample,
                samples,
                count,
                wanted,
            }
        ),
        twin!(
            "CameraRecord",
            Camera {
                position,
                right,
                up,
                forward,
                half as "half_extent",
                shift,
                size,
                clip,
                orthographic,
                lens_blades,
                pixel_aspect,
                fitted,
                lens_radius,
                lens_inverse_focus,
                lens_rotation_rad,
                lens_inverse_ratio,
            }
        ),
        twin!("Filter", Filter { inverse as "inverse_table", width, steps }),
        twin!(
            "Settings",
            Settings {
                seed,
                ao_distance,
                mode,
                bounces,
                russian_roulette,
                kept,
                clamp_direct,
                clamp_indirect
            }
        ),
        twin!(
            "Lights",
            Lights {
                suns,
                lamps,
                lamp_tree,
                sun_count,
                lamp_count,
                strategy,
                sky,
                has_backdrop,
                backdrop,
                sky_mean,
                sky_constant,
                sky_linear,
                sky_squared,
                emitters_irradiance,
                is_sampled,
                lamp_tree_irradiance,
                reserved,
            }
        ),
        twin!(
            "Sun",
            Sun {
                towards,
                tangent,
                bitangent,
                one_minus_cos_half_angle,
                radiance,
                cone_pdf,
                irradiance,
                sin_half_angle
            }
        ),
        twin!(
            "Lamp",
            Lamp {
                position,
                kind,
                axis,
                sides,
                half as "half_extent",
                radiance,
                one_minus_cos_half_angle,
                inverse_blend,
                tan_half_spread,
                spread_factor,
                soft,
                visible_to_camera,
                intensity,
            }
        ),
        twin!(
            "Environment",
            Environment {
                pixels,
                row_cdf,
                column_cdf,
                row_density,
                rotation_rad,
                width,
                height,
                strength,
                floor,
            }
        ),
        twin!("LightNode", LightNode { lo, hi, power }),
        twin!("Cone", Cone { axis, cos_spread, cos_reach }),
        twin!("LightTree", LightTree { nodes, cones, middle, scale, count, reserved }),
        twin!("Emitter", Emitter { emissive_instance, label, origin, first, ends, planes }),
        twin!(
            "EmissiveInstance",
            EmissiveInstance { world_from_index, units_per_world, areas, instance, is_mesh, keys, reserved }
        ),
        twin!("EmissiveTriangle", EmissiveTriangle { corners, area }),
        twin!(
            "Emitters",
            Emitters {
                tree,
                emitters,
                faces,
                triangles,
                by_key,
                emissive_instances,
                emissive_instance_of,
                radius,
                emissive_instance_of_count,
                reserved,
            }
        ),
        twin!(
            "SceneHeader",
            SceneHeader {
                instances,
                tables,
                camera,
                filter as "film_filter",
                settings,
                lights,
                environment,
                emitters,
                instance_tree,
                instance_count,
                film_width,
                contact_distance,
            }
        ),
        twin!(
            "InstanceTree",
            InstanceTree {
                nodes,
                items,
                translation,
                cells_a_unit,
                slack_a_unit,
                slack,
                lo,
                hi,
                pad,
                reserved,
            }
        ),
        twin!(
            "Material",
            Material {
                base_color,
                metallic,
                roughness,
                specular,
                ior,
                emission,
                specular_tint,
                transmission,
                coat,
                coat_roughness,
                coat_ior,
                coat_tint,
                sheen,
                sheen_roughness,
                sheen_tint,
                alpha,
                multiscatter
            }
        ),
        twin!("Chunk", Chunk { node_base, leaves, origin, first_box }),
        twin!("BrickBlock", BrickBlock { occupied, first_brick, page }),
        twin!("Brick", Brick { occupied, full, first_field, first_part }),
        twin!("BrickPart", BrickPart { cells, box_number, label }),
        twin!("PagedBox", PagedBox { record, label, page }),
        twin!(
            "Instance",
            Instance {
                chunks,
                boxes,
                labels,
                nodes,
                leaves,
                bvh_nodes,
                bvh_items,
                acceleration,
                materials,
                material_of_label,
                cut_planes,
                matte_ids,
                neighbors,
                blocks,
                bricks,
                brick_fields,
                brick_parts,
                brick_corners,
                page_marks,
                translation,
                adjugate,
                determinant,
                normals,
                lo,
                hi,
                dims,
                chunk_count,
                pad,
                label_count,
                lod,
                box_count,
                cut_plane_count,
                eye_in_index,
                edges_from_index,
                coarser_from_squared,
                last_matte_id,
                body,
                reserved,
            }
        ),
        twin!("CutPlane", CutPlane { normal, offset, normal_in_world, axis, ends_part }),
        twin!("SurfaceRecord", SurfaceRecord { instance, voxel, face, plane, label, box_number }),
        twin!(
            "RayRecord",
            RayRecord { origin, direction, t_max, from, question, only, only_instance, reserved }
        ),
        twin!("HitRecord", HitRecord { t, normal, surface, from_inside, reserved }),
        twin!("FirstRecord", SurfaceAovsRecord { depth, label, instance, albedo, normal, position }),
        twin!(
            "Denoise",
            Denoise {
                surfaces,
                guides,
                sums,
                resting,
                image,
                variance,
                light,
                light_variance,
                pooled_variance,
                smooth_mean,
                width,
                height,
                samples,
                is_variance_known,
                t_squared,
                wide_t_squared,
                wide_steps,
            }
        ),
        twin!("Resolve", Resolve { sums, pass_sums, resting, result, width, height, samples, pass_stride }),
        twin!("Guide", Guide { normal, albedo, label, instance, is_surface }),
        twin!("PixelLight", PixelLight { mean, takes_part }),
        twin!("BvhNode", BvhNode { origin, exponents_and_inner, first_child, first_item, meta, lo, hi }),
    ]
}

/// The first difference between a shader's structure and its twin.
fn difference(shader: &Layout, twin: &Layout) -> Option<String> {
    let name = &twin.name;
    let pairs = shader.fields.len().max(twin.fields.len());
    for i in 0..pairs {
        let (s, t) = (shader.fields.get(i), twin.fields.get(i));
        if s != t {
            return Some(format!("{name}, field {i}: the shader has {s:?}, layout.rs {t:?}"));
        }
    }
    if shader.end != twin.end {
        return Some(format!("{name} ends at byte {} in the shader, {} in layout.rs", shader.end, twin.end));
    }
    let stride = shader.strides.iter().find(|&&s| s != twin.end)?;
    Some(format!("{name}s lie {stride} bytes apart in the shader, {} in layout.rs", twin.end))
}

fn folder(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

fn words_of(path: &Path) -> Vec<u32> {
    let bytes = std::fs::read(path).expect("a shader");
    bytes.chunks_exact(4).map(|w| u32::from_le_bytes([w[0], w[1], w[2], w[3]])).collect()
}

/// Each checked-in module, with its file's name.
fn modules() -> Vec<(String, Vec<Layout>)> {
    let entries = std::fs::read_dir(folder("spirv")).expect("compiled shaders");
    let paths = entries.map(|e| e.expect("an entry").path());
    let compiled = paths.filter(|p| p.extension().is_some_and(|e| e == "spv"));
    let modules: Vec<_> =
        compiled.map(|path| (path.display().to_string(), layouts(&words_of(&path)))).collect();
    assert!(modules.len() >= 20, "{} modules", modules.len());
    modules
}

fn layout_glsl() -> String {
    std::fs::read_to_string(folder("shaders/layout.glsl")).expect("layout.glsl")
}

#[test]
fn structures_lie_as_the_shaders_read_them() {
    let twins = twins();
    let mut seen = BTreeSet::new();
    for (module, structs) in modules() {
        for s in &structs {
            let Some(twin) = twins.iter().find(|t| t.name == s.name) else { continue };
            assert_eq!(difference(s, twin), None, "{module}");
            seen.insert(s.name.clone());
        }
    }
    // Each structure was compared in some module, and each structure of layout.glsl is among them.
    let source = layout_glsl();
    let declared = source.lines().filter_map(|l| l.strip_prefix("struct ")?.strip_suffix(" {"));
    let declared: BTreeSet<String> = declared.map(str::to_owned).collect();
    assert_eq!(declared, seen);
    assert_eq!(declared.len(), twins.len());
}

/// The search state that a ray of the ray tracing pipeline keeps in scratch memory fits there.
#[test]
fn searches_fit_into_scratch_memory() {
    let mut seen = 0;
    for (module, structs) in modules() {
        for search in structs.iter().filter(|s| s.name == "Search") {
            // It contains doubles, so the next search state must begin at a multiple of 8.
            assert!(search.end as u64 <= SCRATCH_BYTES && SCRATCH_BYTES.is_multiple_of(8), "{module}");
            seen += 1;
        }
    }
    assert!(seen >= 6, "{seen} modules keep searches");
}

#[test]
fn constants_are_the_shaders() {
    let source = layout_glsl();
    let mut declared: Vec<(String, u64)> = Vec::new();
    for line in source.lines() {
        let Some(line) = line.strip_prefix("const ") else { continue };
        let words: Vec<_> = line.split_whitespace().collect();
        let [_, name, "=", value] = words[..] else { panic!("{line}") };
        let value = value.trim_end_matches([';', 'u', 'U', 'L']);
        let number = match value.strip_prefix("0x") {
            Some(hex) => u64::from_str_radix(hex, 16),
            None => value.parse(),
        };
        declared.push((name.to_owned(), number.expect("a number")));
    }
    let expected = [
        ("NONE", u64::from(NONE)),
        ("SCRATCH_BYTES", SCRATCH_BYTES),
        ("PAGE_COUNTS", PAGE_COUNTS as u64),
        ("LOD_BY_DISTANCE", u64::from(LOD_BY_DISTANCE)),
        ("LOD_TRIANGLES", u64::from(LOD_TRIANGLES)),
        ("LOD_CATCHER", u64::from(LOD_CATCHER)),
        ("INSTANCE_BYTES", size_of::<Instance>() as u64),
        ("QUESTION_FIRST_HIT", Question::FirstHit as u64),
        ("QUESTION_OCCLUDED", Question::Occluded as u64),
        ("QUESTION_NEXT_BOUNDARY", Question::NextBoundary as u64),
        ("RESOLVE_COLOR", ResolveStep::Color as u64),
        ("RESOLVE_ALPHA", ResolveStep::Alpha as u64),
        ("RESOLVE_SQUARED_ERRORS", ResolveStep::SquaredErrors as u64),
        ("DENOISE_GUIDES", DenoiseStep::Guides as u64),
        ("DENOISE_LIGHT", DenoiseStep::Light as u64),
        ("DENOISE_POOLED", DenoiseStep::Pooled as u64),
        ("DENOISE_FIRST_WINDOW", DenoiseStep::FirstWindow as u64),
        ("DENOISE_SECOND_WINDOW", DenoiseStep::SecondWindow as u64),
        ("DENOISE_THIRD_WINDOW", DenoiseStep::ThirdWindow as u64),
        ("DENOISE_SHRINK", DenoiseStep::Shrink as u64),
    ];
    assert_eq!(declared, expected.map(|(name, value)| (name.to_owned(), value)));
}

/// What first surfaces leave out, their shaders do not read. They read the constant for catchers in a condition with
/// `false`.
#[test]
fn first_surfaces_read_no_needs_of_light() {
    const CATCHERS: u32 = 16;
    let all =
        ShaderNeeds { parts: PartSet::ALL, instance_tree: true, bricks: true, boxes: true, pages: true };
    let kept = |n: &u32| {
        [CATCHERS, FLOATS_FIRST as u32].contains(n) || all.of_surfaces().constants()[*n as usize] != 0
    };
    for (front, least) in [("first_bvh.comp", 8), ("first_query.comp", 8), ("first.rgen", 8), ("box.rint", 4)]
    {
        for module in [format!("{front}.spv"), format!("{front}.f64.spv")] {
            let read = constants_read(&words_of(&folder("spirv").join(&module)));
            assert!(read.iter().all(kept) && read.len() >= least, "{module}: {read:?}");
            assert!(read.contains(&(FLOATS_FIRST as u32)), "{module}: {read:?}");
        }
    }
    // Negative control: paths read what they leave out.
    let read = constants_read(&words_of(&folder("spirv").join("path_bvh.comp.spv")));
    assert_eq!(read.iter().filter(|n| !kept(n)).count(), 11, "{read:?}");
}

/// A hierarchy of one box, read from its bytes through the structure that the shaders read.
#[test]
fn hierarchies_lie_as_drawn() {
    let bounds = BoxBounds { lo: [100, 2_000, 30_000], hi: [116, 2_300, 30_001] };
    let bvh = Bvh::build(vec![(bounds, 7)]).expect("a hierarchy");
    let bytes = bvh.node_bytes();
    assert_eq!(bytes.len(), size_of::<BvhNode>());
    let node: BvhNode = bytemuck::pod_read_unaligned(bytes);
    let byte = |words: [u32; 2], c: usize| (words[c / 4] >> (8 * (c % 4))) & 0xFF;
    let child = (0..8).find(|&c| byte(node.meta, c) != 0).expect("a child");
    assert_eq!(byte(node.meta, child), 1 << 5, "one item, the first");
    assert_eq!((node.exponents_and_inner >> 24, node.first_item), (0, 0), "no inner child");
    for a in 0..3 {
        let exponent = (node.exponents_and_inner >> (8 * a)) & 0xFF;
        let plane = |words: [u32; 2]| node.origin[a] as u32 + (byte(words, child) << exponent);
        let step = 1 << exponent;
        let (lo, hi) = (plane(node.lo[a]), plane(node.hi[a]));
        assert!(lo <= bounds.lo[a] && bounds.lo[a] < lo + step, "axis {a}: {lo}");
        assert!(bounds.hi[a] <= hi && hi < bounds.hi[a] + step, "axis {a}: {hi}");
    }
}

/// Negative control: a missing field, two swapped fields, another type, another name and another stride are reported.
#[test]
fn other_layouts_are_told_apart() {
    let twins = twins();
    let instance = twins.iter().find(|t| t.name == "Instance").expect("an instance");
    assert_eq!(difference(instance, instance), None);
    let faults: [fn(&mut Layout); 6] = [
        |l| drop(l.fields.pop()),
        |l| l.fields.swap(3, 4),
        |l| l.fields[20].offset += 4,
        |l| l.fields[11].shape = "[[u32; 3]; 3]".to_owned(),
        |l| l.fields[0].name = "boxes".to_owned(),
        |l| l.strides.push(l.end + 8),
    ];
    for (i, fault) in faults.into_iter().enumerate() {
        let mut broken = instance.clone();
        fault(&mut broken);
        assert!(difference(&broken, instance).is_some(), "fault {i}");
    }
    // The same in compiled form: every changed offset or stride of a module is reported.
    let words = words_of(&folder("spirv/trace_rays_bvh.comp.spv"));
    let departs = |words: &[u32]| {
        let all = layouts(words);
        let found = |l: &Layout| difference(l, twins.iter().find(|t| t.name == l.name)?);
        all.iter().find_map(found)
    };
    assert_eq!(departs(&words), None);
    let places = reflection::decorations(&words);
    assert!(places.len() > 80, "{} offsets and strides", places.len());
    for place in places {
        let mut broken = words.clone();
        broken[place] += 4;
        assert!(layouts(&broken) != layouts(&words), "word {place}");
        broken[place] -= 4;
    }
    let mut broken = words;
    let instances = reflection::decorations(&broken)[20];
    broken[instances] += 4;
    assert!(departs(&broken).is_some(), "an offset of Instance");
}
