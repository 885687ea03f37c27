//! Numbers of a scene: camera, settings, lights, sky, filter.

use pumice_cpu::camera_rays::CameraRays;
use pumice_cpu::{Finding, Lights, Sky};
use pumice_render::EnvironmentTable;
use pumice_scene::Mode;

use crate::layout;

/// The camera's record.
pub fn camera(rays: &CameraRays) -> layout::Camera {
    layout::Camera {
        position: rays.position.to_array(),
        right: rays.right.to_array(),
        up: rays.up.to_array(),
        forward: rays.forward.to_array(),
        half: rays.half,
        shift: rays.shift,
        size: rays.size,
        clip: rays.clip,
        orthographic: u32::from(rays.orthographic),
        reserved: 0,
    }
}

/// The settings' record.
pub fn settings(settings: &pumice_scene::Settings) -> layout::Settings {
    layout::Settings {
        seed: settings.seed,
        ao_distance: settings.ao_distance,
        mode: match settings.mode {
            Mode::Path => 0,
            Mode::OneBounce => 1,
            Mode::AmbientOcclusion => 2,
        },
        bounces: settings.bounces,
        russian_roulette: u32::from(settings.russian_roulette),
        reserved: 0,
    }
}

/// The suns' records.
pub fn suns(lights: &Lights) -> Vec<layout::Sun> {
    let sun = |s: &pumice_render::ReadySun| layout::Sun {
        towards: s.towards.to_array(),
        tangent: s.tangent.to_array(),
        bitangent: s.bitangent.to_array(),
        one_minus_cos_half_angle: s.one_minus_cos_half_angle,
        radiance: s.radiance.to_array(),
        cone_pdf: if s.is_delta() { 0.0 } else { s.cone_pdf() },
    };
    lights.suns().iter().map(sun).collect()
}

/// The lights' record; [`Lights::ends`] and [`suns`] lie at these addresses.
pub fn lights(lights: &Lights, ends: u64, suns: u64) -> layout::Lights {
    layout::Lights {
        ends,
        suns,
        end_count: lights.ends().len() as u32,
        sun_count: lights.suns().len() as u32,
        finding: match lights.finding() {
            Finding::Both => 0,
            Finding::Aimed => 1,
            Finding::Scattered => 2,
        },
        sky: match lights.sky() {
            Sky::Constant(radiance) => radiance.to_array(),
            Sky::Image(_) => [0.0; 3],
        },
        has_backdrop: u32::from(lights.backdrop().is_some()),
        backdrop: lights.backdrop().map_or([[0.0; 3]; 2], |b| b.map(|c| c.to_array())),
        reserved: 0,
    }
}

/// The tables of a picture that surrounds the scene, as bytes in the order of its record's addresses.
#[derive(Clone, Debug)]
pub struct PackedSky<'a> {
    table: &'a EnvironmentTable,
}

impl<'a> PackedSky<'a> {
    /// `None` where the sky is constant and has no tables.
    pub fn new(lights: &'a Lights) -> Option<Self> {
        match lights.sky() {
            Sky::Constant(_) => None,
            Sky::Image(table) => Some(Self { table }),
        }
    }

    /// Pixels, density, ends of rows, ends of columns.
    pub fn parts(&self) -> [&'a [u8]; 4] {
        let t = self.table;
        [
            bytemuck::cast_slice(&t.image.pixels),
            bytemuck::cast_slice(&t.density),
            bytemuck::cast_slice(&t.row_ends),
            bytemuck::cast_slice(&t.column_ends),
        ]
    }

    /// The record, its parts at these addresses.
    pub fn record(&self, [pixels, density, row_ends, column_ends]: [u64; 4]) -> layout::Environment {
        layout::Environment {
            pixels,
            density,
            row_ends,
            column_ends,
            rotation_rad: self.table.rotation_rad,
            width: self.table.image.width as u32,
            height: self.table.image.height as u32,
            strength: self.table.strength,
            reserved: 0,
        }
    }
}

/// What a header is made of beside its parts' records: where the other tables lie.
pub fn header(
    instances: (u64, u32),
    albedo: u64,
    rays: &CameraRays,
    filter: layout::Filter,
    settings: layout::Settings,
    lights: layout::Lights,
    environment: layout::Environment,
) -> layout::SceneHeader {
    layout::SceneHeader {
        instances: instances.0,
        albedo,
        camera: camera(rays),
        filter,
        settings,
        lights,
        environment,
        instance_count: instances.1,
        film_width: rays.size[0] as u32,
    }
}
