//! Validation of scenes: finds the first field with a value that is not allowed.

mod camera;
mod light;
mod material;

use std::collections::BTreeSet;

use glam::{DAffine3, DMat3, DVec3};

use crate::{
    Cut, CutShape, Environment, Film, Filter, Instance, LevelOfFile, Lod, Mesh, Reading, SCENE_VERSION,
    Scene, SceneError, Settings,
};
use camera::validate_camera;
use light::{validate_light, validate_sun};
use material::validate_material;

/// Most pixels along a side: a limit that OpenEXR and PNG readers commonly assume.
pub const MAX_SIDE_PIXELS: u32 = 65_536;
/// Most pixels of a film: 2³⁰ pixels take some 80 GiB.
pub const MAX_PIXELS: u64 = 1 << 30;
/// Most bounces; a path of a million bounces is taken for a mistake.
pub const MAX_BOUNCES: u32 = 1 << 20;
/// Widest pixel filter in pixels.
pub const MAX_FILTER_PIXELS: f32 = 16.0;
/// A matrix counts as singular if the determinant of its normalized columns is at most this: f64 has then lost the digits of the third
/// direction.
const LEAST_DETERMINANT: f64 = 1e-12;
/// Largest cosine between two axes of a camera or a flat lamp. Blender's matrices are f32, and a chain of parents leaves errors of some 1e-6;
/// a shear that is visible in a picture of 4096 pixels (a quarter pixel at its edge) is above this limit.
const MOST_SHEAR: f64 = 1e-4;
/// Walks through the fields and stops at the first fault; `path` is the JSON path of the current field.
struct Check {
    path: Vec<String>,
}

type Checked = Result<(), SceneError>;

impl Check {
    fn within(&mut self, name: impl Into<String>, check: impl FnOnce(&mut Self) -> Checked) -> Checked {
        self.path.push(name.into());
        check(self)?;
        self.path.pop();
        Ok(())
    }

    fn field(&self, name: &str, good: bool, problem: impl FnOnce() -> String) -> Checked {
        if good {
            return Ok(());
        }
        let mut field = self.path.join(".");
        if !name.is_empty() {
            field += if field.is_empty() { "" } else { "." };
            field += name;
        }
        Err(SceneError::Field { field, problem: problem() })
    }

    fn range(&self, name: &str, value: f64, low: f64, high: f64) -> Checked {
        self.field(name, value >= low && value <= high, || {
            format!("expected {} to {}, got {}", written(low), written(high), written(value))
        })
    }

    fn at_least(&self, name: &str, value: f64, low: f64) -> Checked {
        self.field(name, value >= low && value.is_finite(), || {
            format!("expected a number of at least {}, got {}", written(low), written(value))
        })
    }

    fn above(&self, name: &str, value: f64, low: f64) -> Checked {
        self.field(name, value > low && value.is_finite(), || {
            format!("expected a number above {}, got {}", written(low), written(value))
        })
    }

    fn color(&self, name: &str, color: [f32; 3]) -> Checked {
        self.each(name, color, |name, v| self.at_least(name, v, 0.0))
    }

    /// Checks each number of a list. Names are formatted only for faults, because figures have 10⁵ materials.
    fn each<const N: usize>(
        &self,
        name: &str,
        values: [f32; N],
        check: impl Fn(&str, f64) -> Checked,
    ) -> Checked {
        match values.iter().position(|v| check(name, f64::from(*v)).is_err()) {
            None => Ok(()),
            Some(i) => check(&format!("{name}[{i}]"), values[i].into()),
        }
    }

    fn point(&self, name: &str, p: [f64; 3]) -> Checked {
        self.field(name, p.iter().all(|v| v.is_finite()), || format!("expected finite numbers, got {p:?}"))
    }

    fn direction(&self, name: &str, d: [f64; 3]) -> Checked {
        // The squared length must be a normal f64, so that normalization keeps full precision.
        let good = DVec3::from_array(d).length_squared().is_normal();
        self.field(name, good, || format!("expected a direction, got {d:?}"))
    }

    fn matrix(&self, name: &str, m: &DAffine3) -> Checked {
        self.field(name, m.is_finite(), || "expected finite numbers, got NaN or infinity".into())?;
        let good = unit_columns(&m.matrix3).is_some_and(|u| u.determinant().abs() > LEAST_DETERMINANT);
        self.field(name, good, || "expected a matrix that can be inverted; its axes lie in a plane".into())?;
        self.field(name, m.inverse().is_finite(), || {
            "expected a matrix that can be inverted; its numbers are too small or too large for that".into()
        })
    }

    /// Checks a matrix whose axes may have any lengths.
    fn without_shear(&self, name: &str, m: &DAffine3) -> Checked {
        self.matrix(name, m)?;
        let m = unit_columns(&m.matrix3).unwrap_or(DMat3::IDENTITY);
        let shear = [m.x_axis.dot(m.y_axis), m.y_axis.dot(m.z_axis), m.z_axis.dot(m.x_axis)];
        self.field(name, shear.iter().all(|s| s.abs() <= MOST_SHEAR), || {
            format!("expected axes at right angles, got cosines {shear:?} between them")
        })
    }
}

/// A number as messages show it: with an exponent where it had many digits without.
fn written(value: f64) -> String {
    match value.abs() {
        1e-5..1e16 | 0.0 => format!("{value}"),
        _ => format!("{value:e}"),
    }
}

/// The matrix with normalized columns; `None` where a column is zero.
fn unit_columns(m: &DMat3) -> Option<DMat3> {
    // Each column is divided by its largest component first, so that squares neither overflow nor underflow.
    let unit = |v: DVec3| (v != DVec3::ZERO).then(|| (v / v.abs().max_element()).normalize());
    Some(DMat3::from_cols(unit(m.x_axis)?, unit(m.y_axis)?, unit(m.z_axis)?))
}

impl Scene {
    /// Checks the value of every field.
    ///
    /// # Errors
    /// [`SceneError::Field`] names the first field at fault by its path in the JSON form, and what was expected;
    /// [`SceneError::Version`] for a scene of another version.
    pub fn validate(&self) -> Checked {
        if self.version != SCENE_VERSION {
            return Err(SceneError::Version { got: self.version.into(), expected: SCENE_VERSION });
        }
        let mut check = Check { path: Vec::new() };
        let c = &mut check;
        let mut ids = BTreeSet::new();
        for (i, instance) in self.instances.iter().enumerate() {
            c.within(format!("instances[{i}]"), |c| {
                c.field("id", ids.insert(instance.id), || format!("{} is used twice", instance.id))?;
                validate_instance(c, instance)
            })?;
        }
        c.within("camera", |c| validate_camera(c, &self.camera))?;
        c.within("film", |c| validate_film(c, &self.film))?;
        c.within("world", |c| {
            c.within("environment", |c| match &self.world.environment {
                Environment::Constant { radiance } => c.color("constant.radiance", *radiance),
                Environment::Image { path, rotation_rad, strength } => c.within("image", |c| {
                    c.field("path", !path.as_os_str().is_empty(), || "expected a file".into())?;
                    c.field("rotation_rad", rotation_rad.is_finite(), || {
                        format!("expected a finite number, got {rotation_rad}")
                    })?;
                    c.at_least("strength", (*strength).into(), 0.0)
                }),
            })?;
            let mut backdrop = self.world.backdrop.iter().flatten().enumerate();
            backdrop.try_for_each(|(i, color)| c.color(&format!("backdrop[{i}]"), *color))
        })?;
        for (i, sun) in self.suns.iter().enumerate() {
            c.within(format!("suns[{i}]"), |c| validate_sun(c, sun))?;
        }
        for (i, light) in self.lights.iter().enumerate() {
            c.within(format!("lights[{i}]"), |c| validate_light(c, light))?;
        }
        let mut mesh_ids = BTreeSet::new();
        for (i, mesh) in self.meshes.iter().enumerate() {
            c.within(format!("meshes[{i}]"), |c| {
                c.field("id", mesh_ids.insert(mesh.id), || format!("{} is used twice", mesh.id))?;
                validate_mesh(c, mesh)
            })?;
        }
        for (i, cut) in self.cuts.iter().enumerate() {
            c.within(format!("cuts[{i}]"), |c| validate_cut(c, cut, &ids))?;
        }
        c.within("settings", |c| validate_settings(c, &self.settings))
    }
}

fn validate_instance(c: &mut Check, instance: &Instance) -> Checked {
    c.field("source", !instance.source.as_os_str().is_empty(), || "expected a file".into())?;
    c.within("reading", |c| validate_reading(c, &instance.reading))?;
    c.matrix("world_from_index", &instance.world_from_index)?;
    c.within("style", |c| {
        c.within("material", |c| validate_material(c, &instance.style.material))?;
        for (i, group) in instance.style.groups.iter().enumerate() {
            c.within(format!("groups[{i}].material"), |c| validate_material(c, &group.material))?;
        }
        let mut materials = instance.style.materials.iter();
        match materials.find(|(_, material)| validate_material(c, material).is_err()) {
            None => Ok(()),
            Some((id, material)) => c.within(format!("materials.{id}"), |c| validate_material(c, material)),
        }
    })
}

fn validate_reading(c: &Check, reading: &Reading) -> Checked {
    for (axis, length) in reading.spacing.iter().flatten().enumerate() {
        c.above(&format!("spacing[{axis}]"), *length, 0.0)?;
    }
    let raw_dims = reading.raw.iter().flat_map(|raw| raw.dims);
    for (axis, voxels) in raw_dims.enumerate() {
        c.field(&format!("raw.dims[{axis}]"), voxels > 0, || "expected at least 1, got 0".into())?;
    }
    if let Some(LevelOfFile::Size(lengths)) = reading.scale {
        for (axis, length) in lengths.into_iter().enumerate() {
            c.above(&format!("scale[{axis}]"), length, 0.0)?;
        }
    }
    for (axis, [low, high]) in reading.roi.iter().flatten().enumerate() {
        let low = low.unwrap_or(0);
        c.field(&format!("roi[{axis}]"), high.is_none_or(|high| low < high), || {
            format!(
                "expected the first voxel below the one after the last, got {low} and {}",
                high.unwrap_or(0)
            )
        })?;
    }
    Ok(())
}

fn validate_mesh(c: &mut Check, mesh: &Mesh) -> Checked {
    c.field("source", !mesh.source.as_os_str().is_empty(), || "expected a file".into())?;
    c.matrix("world_from_mesh", &mesh.world_from_mesh)?;
    c.field("materials", !mesh.materials.is_empty(), || "expected at least one material".into())?;
    for (i, material) in mesh.materials.iter().enumerate() {
        c.within(format!("materials[{i}]"), |c| validate_material(c, material))?;
    }
    Ok(())
}

fn validate_cut(c: &mut Check, cut: &Cut, instances: &BTreeSet<u32>) -> Checked {
    let named = cut.instances.iter().flatten().enumerate();
    for (i, id) in named {
        c.field(&format!("instances[{i}]"), instances.contains(id), || {
            format!("the scene has no instance {id}")
        })?;
    }
    match &cut.shape {
        CutShape::Plane { point, normal } => {
            c.point("shape.plane.point", *point)?;
            c.direction("shape.plane.normal", *normal)
        }
        CutShape::Box { world_from_box } => c.matrix("shape.box.world_from_box", world_from_box),
    }
}

fn validate_film(c: &Check, film: &Film) -> Checked {
    c.range("width", film.width.into(), 1.0, MAX_SIDE_PIXELS.into())?;
    c.range("height", film.height.into(), 1.0, MAX_SIDE_PIXELS.into())?;
    let pixels = u64::from(film.width) * u64::from(film.height);
    c.field("width", pixels <= MAX_PIXELS, || {
        format!("expected at most {MAX_PIXELS} pixels in all, got {pixels}")
    })?;
    c.above("pixel_aspect", film.pixel_aspect, 0.0)?;
    if let Some(color) = film.background {
        c.each("background", color, |name, v| c.range(name, v, 0.0, 1.0))?;
        c.field("background", film.transparent, || {
            "expected film.transparent with it: an opaque film has the sky or the backdrop there".into()
        })?;
    }
    let (ranks, most) = (film.cryptomatte_ranks, Film::MOST_RANKS);
    c.field("cryptomatte_ranks", ranks.is_multiple_of(2) && (2..=most).contains(&ranks), || {
        format!("expected an even number from 2 to {most}, got {ranks}")
    })?;
    c.range("shadow_fade", film.shadow_fade, 0.0, 0.5)?;
    let (name, width) = match film.filter {
        Filter::Box { width } => ("filter.box.width", width),
        Filter::BlackmanHarris { width } => ("filter.blackman_harris.width", width),
    };
    let good = width > 0.0 && width <= MAX_FILTER_PIXELS;
    c.field(name, good, || format!("expected above 0 and at most {MAX_FILTER_PIXELS}, got {width}"))
}

fn validate_settings(c: &Check, settings: &Settings) -> Checked {
    c.range("bounces", settings.bounces.into(), 0.0, MAX_BOUNCES.into())?;
    c.above("ao_distance", settings.ao_distance, 0.0)?;
    c.at_least("clamp_direct", settings.clamp_direct.into(), 0.0)?;
    c.at_least("clamp_indirect", settings.clamp_indirect.into(), 0.0)?;
    if let Some(adaptive) = &settings.adaptive {
        c.above("adaptive.threshold", adaptive.threshold.into(), 0.0)?;
        c.at_least("adaptive.min_spp", adaptive.min_spp.into(), 4.0)?;
    }
    match settings.lod {
        Lod::Distance { pixels } => c.above("lod.distance.pixels", pixels.into(), 0.0),
        Lod::Voxels | Lod::Cells | Lod::Boxes => Ok(()),
    }
}
