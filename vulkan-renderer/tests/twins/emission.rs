//! Tests `light_tree.glsl`, `emitters.glsl`, and the sampling of emitters in `lights.glsl`.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3, Vec3};
use pumice_core::{
    BoxRecord, CompressedVolume, LabelBuffer, LabelType, MeshData, VolumeInfo, compress_labels,
};
use pumice_cpu::emitters_of;
use pumice_cpu::traverse::{MeshTracer, SceneTracer, TracedInstance};
use pumice_scene::{LabelStyle, Material, Sun};
use pumice_transport::bsdf::tables::TABLES;
use pumice_transport::geometry::LodChoice;
use pumice_transport::{
    Hit, Lights, MaterialTable, PathOrigin, RayInWorld, ReadySun, Sky, SurfaceKind, Tracer,
};
use pumice_vulkan::layout::{NONE, SceneHeader};
use pumice_vulkan::pack::{self, PackedBoxes, PackedEmitters, PackedMaterials, PackedNodes};

use super::gpu::Gpu;
use super::gpu::scene::{Form, Uploaded};
use super::lighting::{receiver, row_of};
use super::words::{Random, Reader, Row, close};

/// Touching lumps of six labels, in several boxes.
fn volume() -> Arc<CompressedVolume> {
    let mut random = Random(61);
    let lumps: Vec<u32> = (0..6 * 6 * 6).map(|_| random.below(12)).collect();
    let dims = [22u32, 24, 20];
    let at = |i: u32| {
        let p = [i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]];
        lumps[(p[0] / 4 + 6 * (p[1] / 4) + 36 * (p[2] / 4)) as usize] % 7 * u32::from(random.below(9) > 0)
    };
    let ids = (0..dims[0] * dims[1] * dims[2]).map(at).collect();
    let info = VolumeInfo::new(dims, LabelType::U32);
    Arc::new(compress_labels(info, LabelBuffer::U32(ids)).expect("compressed"))
}

fn mesh() -> Arc<MeshData> {
    let positions =
        vec![[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [1.0, 0.5, 1.5], [1.0, 2.0, 0.0], [0.5, 3.0, -1.0]];
    Arc::new(MeshData::new(positions, vec![[0, 1, 2], [1, 3, 2], [0, 3, 4]], vec![1, 0, 1]).expect("a mesh"))
}

/// Placements within the unit ball about the origin; receivers are within three of it.
fn places() -> [DAffine3; 2] {
    let sheared = DMat3::from_cols_array(&[0.04, 0.01, 0.0, -0.01, 0.05, -0.01, 0.01, 0.0, 0.09]);
    let mirrored = DMat3::from_diagonal(DVec3::new(-0.05, 0.05, 0.05));
    [
        DAffine3::from_mat3_translation(sheared, DVec3::new(-0.6, -0.5, -1.0)),
        DAffine3::from_mat3_translation(mirrored, DVec3::new(1.2, 0.1, -0.2)),
    ]
}

/// Number, among the boxes on the device, of the box that holds a face.
fn box_number(packed: &PackedBoxes, label: u32, origin: [u32; 3]) -> u32 {
    let is_it = |&i: &usize| {
        let chunk = packed.chunks.partition_point(|c| c.first_box as usize <= i) - 1;
        let cell = BoxRecord(packed.boxes[i]).cell();
        let lowest = [0, 1, 2].map(|a| packed.chunks[chunk].origin[a] + 4 * cell[a]);
        packed.labels[i] == label && lowest == origin
    };
    (0..packed.boxes.len()).find(is_it).expect("a box that is drawn") as u32
}

/// Which emitter is chosen, and which face of a box, depends on comparisons of floats. Where these differ in the last bits, a few choices
/// in a million differ. Otherwise the probability at a level of the tree is correct up to a root and three divisions of 2.5 units in the
/// last place each, about 1e-6; ten levels, the distance and its cube give 5e-5. A coat's table and its power are correct to 2e-4.
#[test]
fn emitters_are_the_same() {
    let gpu = Gpu::new();
    let (volume, mesh) = (volume(), mesh());
    let visible = vec![true; volume.labels().len()];
    let traced = places().map(|world_from_index| TracedInstance {
        volume: Arc::clone(&volume),
        world_from_index,
        visible: visible.clone(),
        lod: LodChoice::Voxels,
    });
    let shines = Material { emission: [3.0, 2.0, 1.0], ..Material::default() };
    let coated =
        Material { coat: 0.7, coat_roughness: 0.4, coat_tint: [0.9, 0.6, 0.4], alpha: 0.6, ..shines };
    let dim = Material { emission: [0.0, 0.1, 0.3], ..shines };
    let style = LabelStyle {
        materials: volume
            .labels()
            .ids()
            .iter()
            .copied()
            .zip([shines, coated, Material::default(), dim])
            .collect(),
        ..LabelStyle::default()
    };
    let of_labels = Arc::new(MaterialTable::new(&style, volume.labels().ids(), std::iter::empty(), &visible));
    let materials =
        [Arc::clone(&of_labels), of_labels, Arc::new(MaterialTable::of_mesh(&[Material::default(), shines]))];
    let mesh_place =
        DAffine3::from_mat3_translation(DMat3::from_diagonal(DVec3::splat(0.3)), DVec3::splat(-0.4));

    // On the CPU.
    let triangles = MeshTracer::new(0, 2, &mesh, mesh_place).expect("a mesh");
    let tracer =
        SceneTracer::without_bricks(&traced).expect("a tracer").with_meshes(vec![Arc::new(triangles)]);
    let emitters = Arc::new(emitters_of(&tracer, &materials).expect("emitters").expect("some"));
    assert!(
        emitters.emitters().len() > 20
            && emitters.triangles().len() == 2
            && emitters.emissive_instances().len() == 3
    );
    let sun = Sun { direction: [0.0, 0.0, -1.0], strength: 2.0, color: [1.0; 3], angle_rad: 0.1 };
    let lights = Lights::new(Sky::Constant(Vec3::ZERO), vec![ReadySun::new(&sun)], None);
    let lights = lights.with_emitters(Some(Arc::clone(&emitters)));

    // On the device.
    let mut uploaded = Uploaded::new(&gpu, &traced, Form::Bricks);
    uploaded.add_mesh(&gpu, &mesh, mesh_place);
    for (i, materials) in materials.iter().enumerate() {
        let packed = PackedMaterials::new(materials);
        let materials = uploaded.put(&gpu, &packed.materials);
        let of_label = uploaded.put(&gpu, &packed.of_label);
        packed.describe(&mut uploaded.instances[i], materials, of_label, 0);
    }
    let packed = PackedEmitters::new(&emitters);
    let parts = packed.parts().map(|(_, part)| uploaded.put(&gpu, part));
    let suns = uploaded.put(&gpu, &pack::suns(&lights));
    let header = SceneHeader {
        tables: uploaded.put(&gpu, &TABLES),
        lights: pack::lights(&lights, [suns, 0, 0, 0]),
        emitters: packed.record(parts),
        ..SceneHeader::default()
    };
    let scene = uploaded.header(&gpu, header);
    let boxes =
        PackedBoxes::new(&volume, &PackedNodes::new(&volume, &visible), &visible, true).expect("packed");

    let mut random = Random(62);
    let inputs: Vec<_> = (0..20_000)
        .map(|_| {
            let from = receiver(&mut random);
            let numbers = [0; 5].map(|_| random.unit());
            let [choice, a, b, c, d] = numbers;
            let sample = emitters.sample(&from, choice, [a, b], [c, d]);
            // What a ray meets in the sampled direction, or in any.
            let direction = sample.map_or(-from.point.normalize(), |s| s.direction);
            let ray = RayInWorld { origin: from.point, direction };
            let hit = tracer.first_hit(&ray, PathOrigin::Free, f64::INFINITY);
            let number = hit.map_or(NONE, |Hit { surface: s, .. }| match s.kind {
                SurfaceKind::Triangle => NONE,
                _ => box_number(&boxes, s.label, tracer.box_origin(&s).expect("a box")),
            });
            (from, numbers, sample, hit, number, random.below(emitters.tree().len()))
        })
        .collect();
    let rows: Vec<_> = inputs
        .iter()
        .map(|(from, numbers, _, hit, number, emitter)| {
            let row = numbers.iter().fold(row_of(Row::default(), from), |row, &n| row.float(n));
            let row = match hit {
                None => row.word(NONE).word(0).word(0).word(0).word(0).word(0).word(0).word(0).word(0),
                Some(Hit { surface: s, .. }) => {
                    let row =
                        s.voxel.iter().fold(row.word(s.instance).word(s.kind as u32), |r, &v| r.word(v));
                    row.word(s.axis.into()).word(s.positive.into()).word(s.plane).word(s.label)
                }
            };
            row.word(*number).double(hit.map_or(0.0, |h| h.t)).word(*emitter).0
        })
        .collect();
    let (mut parted, mut found, mut met) = (0, 0, 0);
    for ((from, numbers, sample, hit, _, emitter), row) in
        inputs.iter().zip(gpu.probe(gpu.native_today(), 21, scene, &rows, 19))
    {
        let [choice, a, b, c, d] = *numbers;
        let mut r = Reader(&row);
        let tree = emitters.tree();
        let seen_from = tree.seen_from(from.point, from.normal, from.both_sides);
        let chosen = tree.choose(&seen_from, [choice, a]);
        let (number, chance) = (r.word(), r.float());
        match chosen {
            Some((e, p)) if e == number => close(chance, p, 5e-5, "chance of the choice"),
            None if chance == 0.0 => {}
            _ => parted += 1,
        }
        close(r.float(), tree.probability(&seen_from, *emitter), 5e-5, "chance");
        let is_found = r.word() != 0;
        let got = DVec3::new(r.double(), r.double(), r.double());
        let distance = r.double();
        let radiance = [r.float(), r.float(), r.float()];
        let pdf = r.float();
        match sample {
            Some(s) if is_found && (got - s.direction).length() < 1e-5 => {
                found += 1;
                assert!((distance / s.distance - 1.0).abs() < 1e-5, "{distance} instead of {}", s.distance);
                for (n, e) in radiance.into_iter().zip(s.radiance.to_array()) {
                    close(n, e, 2e-4, "radiance");
                }
                close(pdf, s.pdf, 2e-4, "density");
            }
            None if !is_found => {}
            _ => parted += 1,
        }
        let expected = hit.map_or(0.0, |h| {
            let inside = h.is_seen_from_within();
            if inside { 0.0 } else { emitters.pdf(from, &h.surface, || tracer.box_origin(&h.surface), h.t) }
        });
        let got = r.float();
        let Some(hit) = hit.filter(|h| !h.is_seen_from_within()) else { continue };
        met += usize::from(expected > 0.0);
        close(got, expected, 2e-4, "density of what is met");
        let odds = lights.odds(from);
        close(r.float(), lights.emission_weight(&tracer, from, &odds, &hit, hit.t, choice), 1e-3, "weight");
        let aimed = lights
            .sample_light(from, &odds, choice, [c, d], || [a, b, 0.0])
            .and_then(|s| s.pdf)
            .unwrap_or(0.0);
        let got = r.float();
        parted += usize::from((got - aimed).abs() > 1e-3 * aimed);
    }
    assert!(found > 8_000 && met > 4_000, "{found} samples, {met} of them met");
    assert!(parted <= 6, "{parted} of {} choices fall the other way", inputs.len());
}
