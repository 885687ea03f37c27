//! Whether a scene makes sense; if not, which field is at fault.

use std::collections::BTreeSet;

use glam::{DAffine3, DMat3};

use crate::{
    Camera, Environment, Film, Filter, Instance, Lod, Material, Projection, SCENE_VERSION, Scene, SceneError,
    Settings, Show, Sun,
};

/// Most pixels along a side: what OpenEXR and PNG readers take for granted.
pub const MAX_SIDE_PIXELS: u32 = 65_536;
/// Most pixels: 2³⁰ pixels of film take some 80 GiB already.
pub const MAX_PIXELS: u64 = 1 << 30;
/// Most bounces; a path of a million is a mistake, not a wish.
pub const MAX_BOUNCES: u32 = 1 << 20;
/// Widest pixel filter in pixels.
pub const MAX_FILTER_PIXELS: f32 = 16.0;
/// Columns of a matrix whose determinant is below this times the product of their lengths lie in a plane: f64 has lost what
/// was left of the third direction.
const LEAST_DETERMINANT: f64 = 1e-12;

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
        self.field(name, color.iter().all(|c| *c >= 0.0 && c.is_finite()), || {
            format!("expected three finite numbers of at least 0, got {color:?}")
        })
    }

    fn matrix(&self, name: &str, m: &DAffine3) -> Checked {
        self.field(name, m.is_finite(), || "expected finite numbers".into())?;
        let DMat3 { x_axis, y_axis, z_axis } = m.matrix3;
        let lengths = x_axis.length() * y_axis.length() * z_axis.length();
        let good = lengths > 0.0 && m.matrix3.determinant().abs() > LEAST_DETERMINANT * lengths;
        self.field(name, good, || "expected a matrix that can be inverted; its axes lie in a plane".into())
    }
}

impl Scene {
    /// Whether every field makes sense.
    ///
    /// # Errors
    /// [`SceneError::Field`] names the first that does not, by its path in the JSON form, with what was expected;
    /// [`SceneError::Version`] where the scene is of another version.
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
            self.world.backdrop.iter().flatten().try_for_each(|color| c.color("backdrop", *color))
        })?;
        for (i, sun) in self.suns.iter().enumerate() {
            c.within(format!("suns[{i}]"), |c| validate_sun(c, sun))?;
        }
        c.within("settings", |c| validate_settings(c, &self.settings))
    }
}

impl Instance {
    /// Whether the labels that are to be drawn are there: `ids` are the volume's, rising, and `position` is this instance's place
    /// in the scene. An id of [`Show::Only`] that the volume lacks is a mistake, for nothing would be drawn in its place. Ids of
    /// `Show::Except` and of `materials` may be missing: one table of colours serves many crops of a volume.
    ///
    /// # Errors
    /// [`SceneError::Field`] names the first id that is missing.
    pub fn validate_ids(&self, position: usize, ids: &[u64]) -> Checked {
        let Show::Only(list) = &self.style.show else { return Ok(()) };
        match list.iter().enumerate().find(|(_, id)| ids.binary_search(id).is_err()) {
            None => Ok(()),
            Some((at, id)) => Err(SceneError::Field {
                field: format!("instances[{position}].style.show.only[{at}]"),
                problem: match (id, ids.first(), ids.last()) {
                    (0, ..) => "0 is the background, which is not drawn".into(),
                    (_, Some(first), Some(last)) => {
                        format!(
                            "the volume has no label {id}; its {} labels are within {first} to {last}",
                            ids.len()
                        )
                    }
                    _ => format!("the volume has no label {id}, nor any other"),
                },
            }),
        }
    }
}

fn validate_instance(c: &mut Check, instance: &Instance) -> Checked {
    c.field("source", !instance.source.as_os_str().is_empty(), || "expected a file".into())?;
    c.matrix("world_from_index", &instance.world_from_index)?;
    c.within("style", |c| {
        c.within("material", |c| validate_material(c, &instance.style.material))?;
        for (id, material) in &instance.style.materials {
            c.within(format!("materials.{id}"), |c| validate_material(c, material))?;
        }
        Ok(())
    })
}

fn validate_material(c: &Check, m: &Material) -> Checked {
    c.color("base_color", m.base_color)?;
    c.field("base_color", m.base_color.iter().all(|v| *v <= 1.0), || {
        format!("expected at most 1, got {:?}: a surface cannot reflect more than it receives", m.base_color)
    })?;
    c.range("metallic", m.metallic.into(), 0.0, 1.0)?;
    c.range("roughness", m.roughness.into(), 0.0, 1.0)?;
    c.at_least("specular", m.specular.into(), 0.0)?;
    c.at_least("ior", m.ior.into(), 1.0)?;
    c.color("emission", m.emission)
}

fn validate_camera(c: &Check, camera: &Camera) -> Checked {
    c.matrix("world_from_camera", &camera.world_from_camera)?;
    match camera.projection {
        Projection::Perspective { fov_rad } => {
            let good = fov_rad > 0.0 && fov_rad < std::f64::consts::PI;
            c.field("projection.perspective.fov_rad", good, || {
                format!("expected above 0 and below π, got {fov_rad}")
            })?;
        }
        Projection::Orthographic { scale } => c.above("projection.orthographic.scale", scale, 0.0)?,
    }
    c.field("shift", camera.shift.iter().all(|v| v.is_finite()), || "expected finite numbers".into())?;
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
    let (Filter::Box { width } | Filter::BlackmanHarris { width }) = film.filter;
    let good = width > 0.0 && width <= MAX_FILTER_PIXELS;
    let name = match film.filter {
        Filter::Box { .. } => "filter.box.width",
        Filter::BlackmanHarris { .. } => "filter.blackman_harris.width",
    };
    c.field(name, good, || format!("expected above 0 and at most {MAX_FILTER_PIXELS}, got {width}"))
}

fn validate_sun(c: &Check, sun: &Sun) -> Checked {
    // Its squared length must be a normal number: what is made a unit vector of a shorter or a longer one is none.
    let good = sun.direction.iter().map(|v| v * v).sum::<f64>().is_normal();
    c.field("direction", good, || format!("expected a direction, got {:?}", sun.direction))?;
    c.at_least("strength", sun.strength.into(), 0.0)?;
    c.color("color", sun.color)?;
    c.range("angle_rad", sun.angle_rad, 0.0, std::f64::consts::PI)
}

fn validate_settings(c: &Check, settings: &Settings) -> Checked {
    c.range("bounces", settings.bounces.into(), 0.0, MAX_BOUNCES.into())?;
    c.above("ao_distance", settings.ao_distance, 0.0)?;
    match settings.lod {
        Lod::Distance { pixels } => c.above("lod.distance.pixels", pixels.into(), 0.0),
        Lod::Voxels | Lod::Cells | Lod::Boxes => Ok(()),
    }
}
