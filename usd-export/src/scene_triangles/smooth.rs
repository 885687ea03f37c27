//! Smoothed surfaces in world space as PLY, OBJ and STL: the files of exact ones, with normals where the format has them.
//!
//! ```text
//! ply   vertex  x y z nx ny nz f32, red green blue u8      27 bytes; faces share vertices
//!       face    as of exact surfaces                        25 bytes
//! obj   v, vn, and faces "f POINT//NORMAL …"                points are shared by the faces of a label
//! stl   two triangles a face, flat
//! ```
//! Each file says that it is not exact: in a comment, and STL in its header.

use std::io::Write;
use std::path::Path;

use glam::{DMat3, DVec3};
use pumice_core::reserve::{collected, sort_by_key};
use pumice_core::{Error, Job};
use pumice_transport::LoadedScene;

use super::check_range;
use super::obj::{group_name, material_name, write_material};
use super::ply::{srgb, write_labels_of};
use super::stl::{put_triangle, write_header};
use crate::budget::fits_32_bits;
use crate::drawn::Drawn;
use crate::labelled_surface::FACES;
use crate::smooth_mesh::NOT_EXACT;
use crate::smooth_surface::SmoothSurface;
use crate::voxel_region::nothing_shown;
use crate::whole_file::{write_whole, write_with_beside};
use crate::{Budget, ExportOptions, FileFormat, Result, SmoothMesh};

/// Vertices and faces that are produced at a time.
const PIECE: usize = 4096;

/// The smoothed surfaces of a scene, each with what is drawn of its volume.
pub(crate) struct SmoothSurfaces<'a> {
    all: Vec<(Drawn<'a>, SmoothSurface)>,
}

impl<'a> SmoothSurfaces<'a> {
    /// The surfaces of all volumes, taken from `budget`.
    ///
    /// # Errors
    /// As [`Surfaces::of_scene`](super::Surfaces::of_scene).
    pub(crate) fn of_scene(
        scene: &'a LoadedScene,
        options: &ExportOptions,
        budget: &mut Budget,
        job: &Job,
    ) -> Result<Self> {
        let mut all = Vec::new();
        for place in 0..scene.volumes().len() {
            let drawn = Drawn::new(scene, place, options.region);
            let surface = SmoothSurface::new(&drawn, budget, job)?;
            if !surface.mesh.quads.is_empty() {
                check_range(&drawn)?;
                all.push((drawn, surface));
            }
        }
        if all.is_empty() {
            return Err(nothing_shown(options.region).into());
        }
        Ok(Self { all })
    }

    /// Writes a file of one of these formats; an `.obj` and its `.mtl` both, or neither. Returns the bytes written.
    ///
    /// # Errors
    /// [`Error::Limit`] for more vertices or triangles than the format counts; [`Error::Caller`] for the name of an `.obj` that is not in
    /// UTF-8, or for another format; [`Error::Io`]; [`Error::Cancelled`].
    pub(crate) fn write(&self, format: FileFormat, path: &Path, job: &Job) -> Result<u64> {
        match format {
            FileFormat::Ply => write_whole(path, job, |out| self.write_ply(out)),
            FileFormat::Stl => write_whole(path, job, |out| self.write_stl(out)),
            FileFormat::Obj => {
                let obj = |materials_in: &str, out: &mut dyn Write| self.write_obj(materials_in, out);
                write_with_beside(path, "mtl", job, |out| self.write_mtl(out), obj)
            }
            other => {
                let ending = other.ending();
                Err(Error::Caller(format!("expected a .ply, .obj or .stl file, got .{ending}")).into())
            }
        }
    }

    fn faces(&self) -> u64 {
        self.all.iter().map(|(_, surface)| surface.mesh.quads.len() as u64).sum()
    }

    fn write_ply(&self, out: &mut dyn Write) -> Result<()> {
        let vertices = self.all.iter().map(|(_, surface)| surface.mesh.vertices.len() as u64).sum();
        let vertices = fits_32_bits("vertices of a PLY file", vertices)?;
        writeln!(out, "ply\nformat binary_little_endian 1.0")?;
        writeln!(out, "comment Written by pumice {}", env!("CARGO_PKG_VERSION"))?;
        writeln!(out, "comment not exact: {NOT_EXACT}")?;
        for (drawn, surface) in &self.all {
            write_labels_of(drawn, surface.mesh.vertices.iter().map(|vertex| vertex.label), out)?;
        }
        writeln!(out, "element vertex {vertices}")?;
        for axis in ["x", "y", "z", "nx", "ny", "nz"] {
            writeln!(out, "property float {axis}")?;
        }
        for color in ["red", "green", "blue"] {
            writeln!(out, "property uchar {color}")?;
        }
        writeln!(out, "element face {}", self.faces())?;
        writeln!(
            out,
            "property list uchar uint vertex_indices\nproperty uint label\nproperty uint volume\nend_header"
        )?;
        for (drawn, surface) in &self.all {
            let (mesh, world) = (&surface.mesh, InWorld::new(drawn));
            let color_of =
                |label: u32| drawn.materials[drawn.material_of[label as usize] as usize].base_color;
            in_pieces(&mesh.vertices, out, |vertex, buffer| {
                put(world.position(mesh.points[vertex.point as usize]), buffer);
                put(world.normal(vertex.normal), buffer);
                buffer.extend_from_slice(&color_of(vertex.label).map(srgb));
            })?;
        }
        let mut first = 0;
        for (drawn, SmoothSurface { mesh, .. }) in &self.all {
            let world = InWorld::new(drawn);
            in_pieces(&mesh.quads, out, |quad, buffer| {
                buffer.push(4);
                let [a, b, c, d] = world.turned(*quad).map(|vertex| first + vertex);
                for number in [a, b, c, d, mesh.label(quad), drawn.instance.id] {
                    buffer.extend_from_slice(&number.to_le_bytes());
                }
            })?;
            // All vertices of the file have numbers of 32 bits.
            first += mesh.vertices.len() as u32;
        }
        Ok(())
    }

    fn write_obj(&self, materials_in: &str, out: &mut dyn Write) -> Result<()> {
        writeln!(out, "# Written by pumice {}\n# not exact: {NOT_EXACT}", env!("CARGO_PKG_VERSION"))?;
        writeln!(out, "mtllib {materials_in}")?;
        // Numbers count from 1 through the whole file.
        let (mut first_point, mut first_normal) = (1u64, 1u64);
        for (drawn, SmoothSurface { mesh, .. }) in &self.all {
            let world = InWorld::new(drawn);
            writeln!(out, "o {}", drawn.name())?;
            for point in &mesh.points {
                let [x, y, z] = world.position(*point).as_vec3().to_array();
                writeln!(out, "v {x} {y} {z}")?;
            }
            for vertex in &mesh.vertices {
                let [x, y, z] = world.normal(vertex.normal).as_vec3().to_array();
                writeln!(out, "vn {x} {y} {z}")?;
            }
            let mut by_label = collected(mesh.quads.len(), &mesh.quads, FACES).map_err(Error::from)?;
            sort_by_key(&mut by_label, |quad| mesh.label(quad), FACES).map_err(Error::from)?;
            for group in by_label.chunk_by(|a, b| mesh.label(a) == mesh.label(b)) {
                let label = mesh.label(group[0]);
                writeln!(out, "g {}", group_name(drawn, label))?;
                writeln!(out, "usemtl {}", material_name(drawn, drawn.material_of[label as usize] as usize))?;
                for quad in group {
                    let corner = |vertex: u32| {
                        let point = u64::from(mesh.vertices[vertex as usize].point);
                        format!("{}//{}", first_point + point, first_normal + u64::from(vertex))
                    };
                    writeln!(out, "f {}", world.turned(**quad).map(corner).join(" "))?;
                }
            }
            first_point += mesh.points.len() as u64;
            first_normal += mesh.vertices.len() as u64;
        }
        Ok(())
    }

    fn write_mtl(&self, out: &mut dyn Write) -> Result<()> {
        writeln!(out, "# Written by pumice {}", env!("CARGO_PKG_VERSION"))?;
        for (drawn, surface) in &self.all {
            let shown = drawn.materials.iter().zip(&surface.of_material).enumerate();
            for (number, (material, _)) in shown.filter(|(_, (_, faces))| !faces.is_empty()) {
                write_material(&material_name(drawn, number), material, out)?;
            }
        }
        Ok(())
    }

    fn write_stl(&self, out: &mut dyn Write) -> Result<()> {
        let triangles = fits_32_bits("triangles of an STL file", 2 * self.faces())?;
        write_header(", not exact: smoothed", triangles, out)?;
        for (drawn, SmoothSurface { mesh, .. }) in &self.all {
            let world = InWorld::new(drawn);
            in_pieces(&mesh.quads, out, |quad, buffer| {
                let [a, b, c, d] = world.turned(*quad).map(|vertex| world.corner(mesh, vertex));
                for [a, b, c] in [[a, b, c], [a, c, d]] {
                    let normal = (b - a).normalize_or_zero().cross((c - a).normalize_or_zero());
                    put_triangle([normal.normalize_or_zero(), a, b, c], buffer);
                }
            })?;
        }
        Ok(())
    }
}

/// How a volume's surface stands in the world.
struct InWorld {
    world_from_index: glam::DAffine3,
    /// For normals: it keeps them perpendicular to what shears and stretches, and outside where it mirrors.
    normals: DMat3,
    is_mirrored: bool,
}

impl InWorld {
    fn new(drawn: &Drawn<'_>) -> Self {
        let world_from_index = drawn.instance.world_from_index;
        let matrix = world_from_index.matrix3;
        Self {
            world_from_index,
            normals: matrix.inverse().transpose(),
            is_mirrored: matrix.determinant() < 0.0,
        }
    }

    fn position(&self, point: [f32; 3]) -> DVec3 {
        self.world_from_index.transform_point3(DVec3::from_array(point.map(f64::from)))
    }

    fn corner(&self, mesh: &SmoothMesh, vertex: u32) -> DVec3 {
        self.position(mesh.position(vertex))
    }

    fn normal(&self, normal: [f32; 3]) -> DVec3 {
        (self.normals * DVec3::from_array(normal.map(f64::from))).normalize_or_zero()
    }

    /// Corners of a face, counter-clockwise as seen from outside, with the same diagonal.
    fn turned(&self, [a, b, c, d]: [u32; 4]) -> [u32; 4] {
        if self.is_mirrored { [a, d, c, b] } else { [a, b, c, d] }
    }
}

fn put(vector: DVec3, buffer: &mut Vec<u8>) {
    vector.as_vec3().to_array().iter().for_each(|c| buffer.extend_from_slice(&c.to_le_bytes()));
}

/// Writes what `put` appends for each of `all`, a piece at a time.
fn in_pieces<T>(all: &[T], out: &mut dyn Write, put: impl Fn(&T, &mut Vec<u8>)) -> Result<()> {
    let mut buffer = Vec::new();
    for piece in all.chunks(PIECE) {
        buffer.clear();
        piece.iter().for_each(|thing| put(thing, &mut buffer));
        out.write_all(&buffer)?;
    }
    Ok(())
}
