//! Collects the emitters of everything that is drawn.

use std::f64::consts::PI;
use std::sync::Arc;

use crate::RenderError;
use glam::{DVec3, Vec3};
use pumice_core::{CompressedVolume, MeshData};
use pumice_scene::Material;

use super::faces::{Occupied, append_faces};
use crate::light_tree::{Bounded, Cone};

use super::{EmissiveInstance, EmissiveTriangle, Emitter, Emitters};
use crate::MaterialTable;
use crate::bsdf::luminance;
use crate::geometry::{Cuts, Detail, DetailLevel, MeshGrid, Placement};

/// An instance or mesh with at least one emissive material ([`MaterialTable::is_emissive`]).
#[derive(Debug)]
pub enum EmissiveGeometry<'a> {
    /// Labels of a volume.
    Volume {
        /// Index of the instance, as in [`crate::Surface`].
        instance: u32,
        /// The volume.
        volume: &'a CompressedVolume,
        /// Indices of the drawn boxes, in any order.
        drawn: Vec<u32>,
        /// Placement in the world.
        placement: Placement,
        /// Levels of detail of its boxes.
        detail: Detail,
        /// Parts that are cut away.
        cuts: &'a Cuts,
        /// Materials by label.
        materials: &'a Arc<MaterialTable>,
    },
    /// Triangles of a mesh.
    Mesh {
        /// Index of the instance, as in [`crate::Surface`].
        instance: u32,
        /// The mesh.
        mesh: &'a MeshData,
        /// Its grid.
        grid: &'a MeshGrid,
        /// Placement of the grid in the world.
        placement: Placement,
        /// Materials of its triangles.
        materials: &'a Arc<MaterialTable>,
    },
}

/// Luminance of a material's emission along the normal, for choosing among emitters.
pub(crate) fn emission_luminance(m: &Material) -> f64 {
    f64::from(luminance(Vec3::from_array(m.emission)) * m.alpha)
}

#[derive(Default)]
struct Gathered {
    emissive_instances: Vec<EmissiveInstance>,
    emitters: Vec<Emitter>,
    bounded: Vec<Bounded>,
    faces: Vec<u16>,
    triangles: Vec<EmissiveTriangle>,
}

pub(super) fn gather(shining: &[EmissiveGeometry<'_>]) -> Result<Option<Emitters>, RenderError> {
    let mut all = Gathered::default();
    for one in shining {
        let before = all.emitters.len();
        match one {
            EmissiveGeometry::Volume { instance, volume, drawn, placement, detail, cuts, materials } => {
                all.begin(*instance, placement, false, materials);
                all.add_volume(volume, drawn, detail, cuts, materials);
            }
            EmissiveGeometry::Mesh { instance, mesh, grid, placement, materials } => {
                all.begin(*instance, placement, true, materials);
                all.add_mesh(mesh, grid, materials);
            }
        }
        if all.emitters.len() == before {
            all.emissive_instances.pop();
        }
        // Node indices go up to twice this number.
        let (emitters, faces) = (all.emitters.len(), all.faces.len());
        if emitters >= 1 << 30 || faces as u64 > u64::from(u32::MAX) {
            return Err(RenderError::Scene(format!(
                "{emitters} emissive boxes and triangles with {faces} faces are more than the limits of 2^30 and 2^32: make fewer \
                 labels emissive"
            )));
        }
    }
    if all.emitters.is_empty() {
        return Ok(None);
    }
    let Gathered { emissive_instances: places, mut emitters, bounded, mut faces, triangles } = all;
    emitters.shrink_to_fit();
    faces.shrink_to_fit();
    Ok(Some(Emitters::of(places, &emitters, &bounded, faces, triangles)))
}

impl Gathered {
    fn begin(&mut self, instance: u32, placement: &Placement, is_mesh: bool, materials: &Arc<MaterialTable>) {
        let side = placement.determinant.cbrt();
        let areas = placement.adjugate.map(|row| (row / side).length() / side);
        self.emissive_instances.push(EmissiveInstance {
            instance,
            placement: *placement,
            units_per_world: 1.0 / side,
            areas: areas.map(|a| a as f32),
            is_mesh,
            keys: [0; 2],
            materials: Arc::clone(materials),
        });
    }

    /// Adds an emitter whose power is `power` for each unit area of index space, as seen along the normal.
    fn push(&mut self, emitter: Emitter, power: f64, corners: impl Iterator<Item = DVec3>) {
        let (mut lo, mut hi) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let place = &self.emissive_instances[emitter.emissive_instance as usize];
        for corner in corners {
            let at = place.placement.world_from_index.transform_point3(corner);
            (lo, hi) = (lo.min(at), hi.max(at));
        }
        let side = 1.0 / place.units_per_world;
        self.bounded.push(Bounded { lo, hi, power: PI * power * side * side, cone: Cone::ALL });
        self.emitters.push(emitter);
    }

    fn add_volume(
        &mut self,
        volume: &CompressedVolume,
        drawn: &[u32],
        detail: &Detail,
        cuts: &Cuts,
        materials: &MaterialTable,
    ) {
        let shines = |i: &u32| {
            let material = materials.material(volume.label_of_box(*i as usize));
            emission_luminance(material) > 0.0 && {
                let b = volume.place_of_box(*i as usize);
                detail.level(b.origin, b.extent) == DetailLevel::Voxels
            }
        };
        let mut near: Vec<u32> = drawn.iter().copied().filter(shines).collect();
        near.sort_unstable();
        if near.is_empty() {
            return;
        }
        let around = Occupied::new(volume, drawn, &near);
        let place = self.emissive_instances.len() as u32 - 1;
        let areas = self.emissive_instances[place as usize].areas;
        for i in near {
            let b = volume.get_box(i as usize);
            let label = volume.label_of_box(i as usize);
            let first = self.faces.len() as u32;
            let ends = append_faces(&b, &around, cuts, &mut self.faces);
            let list = &self.faces[first as usize..];
            if list.is_empty() {
                continue;
            }
            // Planes of each direction, and bounds of all faces.
            let (mut planes, mut area, mut start) = (0, 0.0, 0);
            let (mut lo, mut hi) = ([16u32; 3], [0u32; 3]);
            for direction in 0..6 {
                let (axis, positive) = (direction / 2, direction % 2 == 1);
                let of_direction = &list[usize::from(start)..usize::from(ends[direction])];
                start = ends[direction];
                let at = |code: &u16, a: usize| u32::from(code >> (4 * a) & 15);
                let along = of_direction.iter().map(|c| at(c, axis));
                let plane =
                    if positive { along.min().map_or(0, |v| v + 1) } else { along.max().unwrap_or(0) };
                planes |= plane << (5 * direction);
                area += of_direction.len() as f64 * f64::from(areas[axis]);
                for code in of_direction {
                    for a in 0..3 {
                        lo[a] = lo[a].min(at(code, a));
                        hi[a] = hi[a].max(at(code, a) + 1);
                    }
                }
            }
            let emitter = Emitter { emissive_instance: place, label, origin: b.origin, first, ends, planes };
            let corners = (0..8).map(|corner| {
                DVec3::from([0, 1, 2].map(|a: usize| {
                    f64::from(b.origin[a] + if corner >> a & 1 == 1 { hi[a] } else { lo[a] })
                }))
            });
            self.push(emitter, emission_luminance(materials.material(label)) * area, corners);
        }
    }

    fn add_mesh(&mut self, mesh: &MeshData, grid: &MeshGrid, materials: &MaterialTable) {
        let place = self.emissive_instances.len() as u32 - 1;
        for (number, triangle) in (0u32..).zip(mesh.triangles()) {
            let label = mesh.material(number as usize);
            let shine = emission_luminance(materials.material(label));
            let mut triangle =
                EmissiveTriangle { corners: triangle.map(|c| grid.corners[c as usize]), area: 0.0 };
            let (corners, normal) = triangle.shape();
            let EmissiveInstance { placement, units_per_world, .. } =
                &self.emissive_instances[place as usize];
            let [x, y, z] = placement.adjugate;
            let area = (x * normal.x + y * normal.y + z * normal.z) * *units_per_world;
            triangle.area = (area * *units_per_world).length() as f32;
            if shine <= 0.0 || triangle.area <= 0.0 {
                continue;
            }
            let first = self.triangles.len() as u32;
            self.triangles.push(triangle);
            let emitter = Emitter {
                emissive_instance: place,
                label,
                origin: [number, 0, 0],
                first,
                ends: [0; 6],
                planes: 0,
            };
            // Both sides emit.
            self.push(emitter, 2.0 * shine * f64::from(triangle.area), corners.into_iter());
        }
    }
}
