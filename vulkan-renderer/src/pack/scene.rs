//! Packs the small records of a scene: camera, settings, lights, sky, header.

use pumice_picture::PassSums;
use pumice_scene::Mode;
use pumice_transport::camera_rays::CameraRays;
use pumice_transport::geometry::InstanceTree;
use pumice_transport::{BoxBounds, EnvironmentTable, LightStrategy, Lights, Sky};

use super::light_tree::light_tree;
use crate::layout;

/// The camera's record.
pub fn camera(rays: &CameraRays) -> layout::Camera {
    let lens = rays.lens.as_ref();
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
        lens_blades: lens.map_or(0, |l| l.blades),
        pixel_aspect: rays.pixel_aspect,
        fitted: rays.fitted,
        lens_radius: lens.map_or(0.0, |l| l.radius),
        lens_inverse_focus: lens.map_or(0.0, |l| l.inverse_focus),
        lens_rotation_rad: lens.map_or(0.0, |l| l.rotation_rad),
        lens_inverse_ratio: lens.map_or(0.0, |l| l.inverse_ratio),
    }
}

/// The settings' record, for a film that keeps these pass sums.
pub fn settings(settings: &pumice_scene::Settings, kept: PassSums) -> layout::Settings {
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
        kept: kept.bits(),
        clamp_direct: settings.clamp_direct,
        clamp_indirect: settings.clamp_indirect,
    }
}

/// The suns' records.
pub fn suns(lights: &Lights) -> Vec<layout::Sun> {
    let sun = |s: &pumice_transport::ReadySun| layout::Sun {
        towards: s.towards.to_array(),
        tangent: s.tangent.to_array(),
        bitangent: s.bitangent.to_array(),
        one_minus_cos_half_angle: s.one_minus_cos_half_angle,
        radiance: s.radiance.to_array(),
        cone_pdf: if s.is_delta() { 0.0 } else { s.cone_pdf() },
        irradiance: s.irradiance(),
        sin_half_angle: s.sin_half_angle(),
    };
    lights.suns().iter().map(sun).collect()
}

/// The lamps' records.
pub fn lamps(lights: &Lights) -> Vec<layout::Lamp> {
    let lamp = |l: &pumice_transport::ReadyLamp| layout::Lamp {
        position: l.position.to_array(),
        kind: l.kind as u32,
        axis: l.axis.to_array(),
        sides: l.sides.map(|s| s.to_array()),
        half: l.half,
        radiance: l.radiance.to_array(),
        one_minus_cos_half_angle: l.one_minus_cos_half_angle,
        inverse_blend: l.inverse_blend,
        tan_half_spread: l.tan_half_spread,
        spread_factor: l.spread_factor,
        soft: u32::from(l.soft),
        visible_to_camera: u32::from(l.visible_to_camera),
        intensity: l.intensity,
    };
    lights.lamps().iter().map(lamp).collect()
}

/// The lights' record, with [`suns`], [`lamps`], and the nodes and cones of the [`lamp_tree`](super::lamp_tree) at these addresses.
pub fn lights(lights: &Lights, [suns, lamps, nodes, cones]: [u64; 4]) -> layout::Lights {
    let tree = lights.lamp_tree();
    let sky = lights.sky_irradiance();
    layout::Lights {
        suns,
        lamps,
        lamp_tree: tree.map_or_else(Default::default, |(tree, _)| light_tree(tree, [nodes, cones])),
        lamp_tree_irradiance: tree.map_or(0.0, |(_, irradiance)| irradiance),
        reserved: 0,
        lamp_count: lights.lamps().len() as u32,
        sun_count: lights.suns().len() as u32,
        strategy: match lights.strategy() {
            LightStrategy::Mis => 0,
            LightStrategy::LightsOnly => 1,
            LightStrategy::BsdfOnly => 2,
        },
        sky: match lights.sky() {
            Sky::Constant(radiance) => radiance.to_array(),
            Sky::Image(_) => [0.0; 3],
        },
        has_backdrop: u32::from(lights.backdrop().is_some()),
        backdrop: lights.backdrop().map_or([[0.0; 3]; 2], |b| b.map(|c| c.to_array())),
        sky_mean: sky.mean,
        sky_constant: sky.constant,
        sky_linear: sky.linear.to_array(),
        sky_squared: sky.squared,
        emitters_irradiance: lights.emitters().map_or(0.0, |e| e.irradiance()),
        is_sampled: u32::from(lights.has_sampled_light()),
    }
}

/// The tables of an environment map as bytes, in the order of the addresses in its record.
#[derive(Clone, Debug)]
pub struct PackedSky<'a> {
    table: &'a EnvironmentTable,
}

impl<'a> PackedSky<'a> {
    /// `None` where the sky is constant and needs no tables.
    pub fn new(lights: &'a Lights) -> Option<Self> {
        match lights.sky() {
            Sky::Constant(_) => None,
            Sky::Image(table) => Some(Self { table }),
        }
    }

    /// Pixels, cdf of rows, cdfs of columns, densities of rows.
    pub fn parts(&self) -> [&'a [u8]; 4] {
        let t = self.table;
        [
            bytemuck::cast_slice(&t.image.pixels),
            bytemuck::cast_slice(&t.row_cdf),
            bytemuck::cast_slice(&t.column_cdf),
            bytemuck::cast_slice(&t.row_density),
        ]
    }

    /// The record, with its parts at these addresses.
    pub fn record(&self, [pixels, row_cdf, column_cdf, row_density]: [u64; 4]) -> layout::Environment {
        layout::Environment {
            pixels,
            row_cdf,
            column_cdf,
            row_density,
            rotation_rad: self.table.rotation_rad,
            width: self.table.image.width as u32,
            height: self.table.image.height as u32,
            strength: self.table.strength,
            floor: self.table.floor,
        }
    }
}

/// The record of a hierarchy over instances, with its nodes and items at these addresses.
pub fn instance_tree(tree: &InstanceTree, [nodes, items]: [u64; 2]) -> layout::InstanceTree {
    let bounds = tree.bvh().bounds().unwrap_or(BoxBounds { lo: [0; 3], hi: [0; 3] });
    layout::InstanceTree {
        nodes,
        items,
        translation: tree.translation.to_array(),
        cells_a_unit: tree.cells_a_unit,
        slack_a_unit: tree.slack_a_unit,
        slack: tree.slack,
        lo: bounds.lo,
        hi: bounds.hi,
        pad: tree.bvh().pad(),
        reserved: 0,
    }
}
