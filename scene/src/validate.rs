//! Whether a scene makes sense; if not, which field is at fault.

use std::collections::BTreeSet;

use glam::{DAffine3, DMat3, DVec3};

use crate::{
    Camera, Environment, Film, Filter, Instance, Lod, Material, Projection, SCENE_VERSION, Scene, SceneError,
    Settings, Sun,
};

/// Most pixels along a side: what OpenEXR and PNG readers take for granted.
pub const MAX_SIDE_PIXELS: u32 = 65_536;
/// Most pixels: 2³⁰ pixels of film take some 80 GiB already.
pub const MAX_PIXELS: u64 = 1 << 30;
/// Most bounces; a path of a million is a mistake, not a wish.
pub const MAX_BOUNCES: u32 = 1 << 20;
/// Widest pixel filter in pixels.
pub const MAX_FILTER_PIXELS: f32 = 16.0;
/// Columns of a matrix, made unit vectors, lie in a plane where their determinant is not above this: f64 has lost what was left
/// of the third direction.
const LEAST_DETERMINANT: f64 = 1e-12;
/// Largest cosine between two axes of a camera. Blender's matrices are f32: a chain of parents leaves some 1e-6; a shear that
/// somebody could see in a picture of 4096 pixels (a quarter pixel at its edge) is above this.
const MOST_CAMERA_SHEAR: f64 = 1e-4;

/// Collects the first fault while walking through the fields.
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
        self.field(name, value >= low && value <= high, || format!("expected {low} to {high}, got {value}"))
    }

    fn at_least(&self, name: &str, value: f64, low: f64) -> Checked {
        self.field(name, value >= low && value.is_finite(), || {
            format!("expected a number of at least {low}, got {value}")
        })
    }

    fn above(&self, name: &str, value: f64, low: f64) -> Checked {
        self.field(name, value > low && value.is_finite(), || {
            format!("expected a number above {low}, got {value}")
        })
    }

    fn color(&self, name: &str, color: [f32; 3]) -> Checked {
        self.each(name, color, |name, v| self.at_least(name, v, 0.0))
    }

    /// Checks each number of a list. Names are made for faults alone: figures have 10⁵ materials.
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

    fn matrix(&self, name: &str, m: &DAffine3) -> Checked {
        self.field(name, m.is_finite(), || "expected finite numbers, got NaN or infinity".into())?;
        let good = unit_columns(&m.matrix3).is_some_and(|u| u.determinant().abs() > LEAST_DETERMINANT);
        self.field(name, good, || "expected a matrix that can be inverted; its axes lie in a plane".into())?;
        self.field(name, m.inverse().is_finite(), || {
            "expected a matrix that can be inverted; its numbers are too small or too large for that".into()
        })
    }
}

/// The matrix with its columns made unit vectors, whatever their length; `None` where one is zero.
fn unit_columns(m: &DMat3) -> Option<DMat3> {
    // Divided by the largest number first, so that squares neither overflow nor vanish.
    let unit = |v: DVec3| (v != DVec3::ZERO).then(|| (v / v.abs().max_element()).normalize());
    Some(DMat3::from_cols(unit(m.x_axis)?, unit(m.y_axis)?, unit(m.z_axis)?))
}

impl Scene {
    /// Whether every field makes sense.
    ///
    /// # Errors
    /// [`SceneError::Field`] names the first that does not, by its path in the JSON form, with what was expected;
    /// [`SceneError::Version`] for a scene of another version.
    pub fn validate(&self) -> Checked {
        if self.version != SCENE_VERSION {
            return Err(SceneError::version(self.version.into()));
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
        c.within("settings", |c| validate_settings(c, &self.settings))
    }
}

fn validate_instance(c: &mut Check, instance: &Instance) -> Checked {
    c.field("source", !instance.source.as_os_str().is_empty(), || "expected a file".into())?;
    c.matrix("world_from_index", &instance.world_from_index)?;
    c.within("style", |c| {
        c.within("material", |c| validate_material(c, &instance.style.material))?;
        let mut materials = instance.style.materials.iter();
        match materials.find(|(_, material)| validate_material(c, material).is_err()) {
            None => Ok(()),
            Some((id, material)) => c.within(format!("materials.{id}"), |c| validate_material(c, material)),
        }
    })
}

fn validate_material(c: &Check, m: &Material) -> Checked {
    c.each("base_color", m.base_color, |name, v| c.range(name, v, 0.0, 1.0))?;
    c.range("metallic", m.metallic.into(), 0.0, 1.0)?;
    c.range("roughness", m.roughness.into(), 0.0, 1.0)?;
    c.at_least("specular", m.specular.into(), 0.0)?;
    c.at_least("ior", m.ior.into(), 1.0)?;
    c.color("emission", m.emission)
}

fn validate_camera(c: &Check, camera: &Camera) -> Checked {
    c.matrix("world_from_camera", &camera.world_from_camera)?;
    let m = unit_columns(&camera.world_from_camera.matrix3).unwrap_or(DMat3::IDENTITY);
    let shear = [m.x_axis.dot(m.y_axis), m.y_axis.dot(m.z_axis), m.z_axis.dot(m.x_axis)];
    c.field("world_from_camera", shear.iter().all(|s| s.abs() <= MOST_CAMERA_SHEAR), || {
        format!("expected axes at right angles, got cosines {shear:?} between them")
    })?;
    match camera.projection {
        Projection::Perspective { fov_rad } => {
            let good = fov_rad > 0.0 && fov_rad < std::f64::consts::PI;
            c.field("projection.perspective.fov_rad", good, || {
                format!("expected above 0 and below π, got {fov_rad}")
            })?;
        }
        Projection::Orthographic { scale } => c.above("projection.orthographic.scale", scale, 0.0)?,
    }
    for (i, v) in camera.shift.iter().enumerate() {
        c.field(&format!("shift[{i}]"), v.is_finite(), || format!("expected a finite number, got {v}"))?;
    }
    let [near, far] = camera.clip;
    c.field("clip", near >= 0.0 && near < far && far.is_finite(), || {
        format!("expected 0 ≤ near < far, got {near} and {far}")
    })
}

fn validate_film(c: &Check, film: &Film) -> Checked {
    c.range("width", film.width.into(), 1.0, MAX_SIDE_PIXELS.into())?;
    c.range("height", film.height.into(), 1.0, MAX_SIDE_PIXELS.into())?;
    let pixels = u64::from(film.width) * u64::from(film.height);
    c.field("width", pixels <= MAX_PIXELS, || {
        format!("expected at most {MAX_PIXELS} pixels in all, got {pixels}")
    })?;
    let (name, width) = match film.filter {
        Filter::Box { width } => ("filter.box.width", width),
        Filter::BlackmanHarris { width } => ("filter.blackman_harris.width", width),
    };
    let good = width > 0.0 && width <= MAX_FILTER_PIXELS;
    c.field(name, good, || format!("expected above 0 and at most {MAX_FILTER_PIXELS}, got {width}"))
}

fn validate_sun(c: &Check, sun: &Sun) -> Checked {
    // Its square must hold the digits that the unit vector needs.
    let good = DVec3::from_array(sun.direction).length_squared().is_normal();
    c.field("direction", good, || format!("expected a direction, got {:?}", sun.direction))?;
    c.at_least("strength", sun.strength.into(), 0.0)?;
    c.color("color", sun.color)?;
    c.range("angle_rad", sun.angle_rad, 0.0, std::f64::consts::PI)?;
    // Radiance within the cone (`pumice_render::ReadySun`) is an f32: a needle of a sun would blind it.
    let cone = std::f64::consts::PI * (0.5 * sun.angle_rad).sin().powi(2);
    let brightest = sun.color.iter().fold(0.0, |a: f32, &b| a.max(b)).max(1.0);
    let radiance =
        f64::from(sun.strength) * f64::from(brightest) / if sun.angle_rad > 0.0 { cone } else { 1.0 };
    c.field("angle_rad", radiance <= f64::from(f32::MAX), || {
        format!(
            "expected 0 or an angle wide enough for its strength, got {}: radiance {radiance}",
            sun.angle_rad
        )
    })
}

fn validate_settings(c: &Check, settings: &Settings) -> Checked {
    c.range("bounces", settings.bounces.into(), 0.0, MAX_BOUNCES.into())?;
    c.above("ao_distance", settings.ao_distance, 0.0)?;
    match settings.lod {
        Lod::Distance { pixels } => c.above("lod.distance.pixels", pixels.into(), 0.0),
        Lod::Voxels | Lod::Cells | Lod::Boxes => Ok(()),
    }
}
