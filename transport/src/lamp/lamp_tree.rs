//! Hundreds of lamps: a tree chooses one for a receiver, and finds those that a ray may meet, in about log n steps where lists take n.
//!
//! All lamps together are then one light among the others of the scene. Their weight is that of the tree's root, which knows the distance to
//! the middle of the lamps at least as half of their diagonal: a receiver among them, beside one, is brighter than that.

use glam::{DVec3, Vec3};
use pumice_scene::LAMPS_OF_A_TREE;

use super::{LampKind, ReadyLamp, Receiver};
use crate::light_tree::{Bounded, Cone, LightTree};

/// Part of the extent of all lamps that is added to the bounds of a lamp: sixteen roundings of a coordinate from −1 to 1, so that directions from a
/// receiver nearby are not judged by rounding.
const MARGIN: f64 = 1e-6;

/// Part of the squared distances that rounding may add up to where a ray passes a lamp, here and in [`ReadyLamp::meet`]: 64 roundings.
const ROUNDINGS: f32 = 64.0 * f32::EPSILON;

/// A tree over the lamps of a scene (see the module).
#[derive(Clone, Debug)]
pub(crate) struct LampTree {
    tree: LightTree,
    /// Irradiance in the world for an importance of 1.
    irradiance: f32,
}

impl LampTree {
    /// Sorts the lamps into the tree's order; `None`, with the lamps as they are, where there are too few, or none shines.
    pub(crate) fn new(lamps: &mut Vec<ReadyLamp>) -> Option<Self> {
        if lamps.len() < LAMPS_OF_A_TREE {
            return None;
        }
        let bounded = bounds(lamps);
        let total: f64 = bounded.iter().map(|b| b.power).sum();
        if total <= 0.0 {
            return None;
        }
        let (tree, order) = LightTree::new(&bounded);
        *lamps = order.iter().map(|&i| lamps[i as usize]).collect();
        let irradiance = (total * tree.scale * tree.scale).min(f64::from(f32::MAX)) as f32;
        Some(Self { tree, irradiance })
    }

    /// The tree.
    pub(crate) fn tree(&self) -> &LightTree {
        &self.tree
    }

    /// Irradiance in the world for an importance of 1.
    pub(crate) fn irradiance(&self) -> f32 {
        self.irradiance
    }

    /// About the irradiance that all lamps together give to a receiver, for choosing among lights; 0 only where they give none.
    #[inline]
    pub(crate) fn irradiance_at(&self, from: &Receiver) -> f32 {
        let importance = self.tree.importance(&self.tree.seen_from(from.point, from.normal, from.both_sides));
        // (A product may round to 0 where lamps shine.)
        if importance > 0.0 { (importance * self.irradiance).max(f32::MIN_POSITIVE) } else { 0.0 }
    }

    /// Chooses a lamp; returns its number and probability.
    #[inline]
    pub(crate) fn choose(&self, from: &Receiver, u: [f32; 2]) -> Option<(usize, f32)> {
        let seen_from = self.tree.seen_from(from.point, from.normal, from.both_sides);
        self.tree.choose(&seen_from, u).map(|(lamp, chance)| (lamp as usize, chance))
    }

    /// The probability with which [`LampTree::choose`] returns this lamp.
    #[inline]
    pub(crate) fn probability(&self, from: &Receiver, lamp: usize) -> f32 {
        self.tree.probability(&self.tree.seen_from(from.point, from.normal, from.both_sides), lamp as u32)
    }

    /// Calls `visit` with the numbers of the lamps that a ray (unit direction) from a point may meet. It leaves out only lamps for which
    /// [`ReadyLamp::meet`] finds nothing.
    #[inline]
    pub(crate) fn near(&self, from: DVec3, direction: Vec3, mut visit: impl FnMut(usize)) {
        let origin = ((from - self.tree.middle) * self.tree.scale).as_vec3();
        self.tree.near(origin, direction, ROUNDINGS, |lamp| visit(lamp as usize));
    }
}

/// Bounds, power and cone of each lamp.
fn bounds(lamps: &[ReadyLamp]) -> Vec<Bounded> {
    let boxes = lamps.iter().map(|lamp| {
        let [u, v] = lamp.half.map(f64::from);
        let reach = match lamp.kind {
            LampKind::Ball | LampKind::Spot => DVec3::splat(u),
            LampKind::Rectangle | LampKind::Ellipse => {
                let [a, b] = lamp.sides.map(|side| side.as_dvec3().abs());
                a * u + b * v
            }
        };
        (lamp.position - reach, lamp.position + reach)
    });
    let boxes: Vec<(DVec3, DVec3)> = boxes.collect();
    let lo = boxes.iter().fold(DVec3::INFINITY, |m, b| m.min(b.0));
    let hi = boxes.iter().fold(DVec3::NEG_INFINITY, |m, b| m.max(b.1));
    let margin = MARGIN * (hi - lo).max_element();
    let bounded = |(lamp, (lo, hi)): (&ReadyLamp, &(DVec3, DVec3))| Bounded {
        lo: *lo - margin,
        hi: *hi + margin,
        power: power(lamp),
        cone: cone(lamp),
    };
    lamps.iter().zip(&boxes).map(bounded).collect()
}

/// Intensity in the middle of the beam; of a parallel beam, its power.
fn power(lamp: &ReadyLamp) -> f64 {
    let intensity = f64::from(lamp.intensity);
    let [u, v] = lamp.half.map(f64::from);
    if is_beam(lamp) { intensity * 4.0 * u * v } else { intensity }
}

fn is_beam(lamp: &ReadyLamp) -> bool {
    matches!(lamp.kind, LampKind::Rectangle | LampKind::Ellipse) && lamp.tan_half_spread == 0.0
}

/// Directions in which a lamp shines.
fn cone(lamp: &ReadyLamp) -> Cone {
    match lamp.kind {
        LampKind::Ball => Cone::ALL,
        LampKind::Spot => Cone::around(lamp.axis, 1.0 - lamp.one_minus_cos_half_angle),
        LampKind::Rectangle | LampKind::Ellipse => {
            let cos = 1.0 / (1.0 + lamp.tan_half_spread * lamp.tan_half_spread).sqrt();
            Cone::around(lamp.axis, cos)
        }
    }
}

#[cfg(test)]
mod tests {
    use pumice_scene::{Light, LightShape, Outline};

    use super::*;

    /// Numbers in [0, 1) in a fixed order.
    struct Numbers(u32);

    impl Numbers {
        fn next(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(self.0 >> 8) / f64::from(1 << 24)
        }

        fn place(&mut self) -> DVec3 {
            DVec3::new(self.next(), self.next(), self.next()) * 2.0 - 1.0
        }
    }

    /// Lamps of every kind within a cube of side 2 · `size` around a middle.
    fn lamps(count: u32, middle: DVec3, size: f64) -> Vec<ReadyLamp> {
        let mut numbers = Numbers(11);
        let lamp = |i: u32| {
            let position = (middle + size * numbers.place()).to_array();
            let direction = (numbers.place() + 0.01).to_array();
            let radius = size * [0.0, 0.02, 0.3, 1e-4][i as usize % 4] * numbers.next();
            let shape = match i % 6 {
                0 | 1 => LightShape::Point { position, radius, soft_falloff: i.is_multiple_of(4) },
                2 => {
                    let (angle_rad, blend) = (0.02 + 3.0 * numbers.next(), 0.3);
                    LightShape::Spot { position, direction, radius, angle_rad, blend, soft_falloff: false }
                }
                _ => LightShape::Area {
                    world_from_light: glam::DAffine3::from_rotation_translation(
                        glam::DQuat::from_axis_angle(
                            DVec3::from_array(direction).normalize(),
                            7.0 * numbers.next(),
                        ),
                        DVec3::from_array(position),
                    ),
                    outline: if i.is_multiple_of(2) { Outline::Rectangle } else { Outline::Ellipse },
                    size: [radius + 0.01 * size, 0.05 * size],
                    spread_rad: [std::f64::consts::PI, 1.0, 0.0][i as usize % 3],
                },
            };
            let power_w = if i % 50 == 7 { 0.0 } else { 0.1 + 10.0 * numbers.next() as f32 };
            ReadyLamp::new(&Light { shape, power_w, color: [1.0, 0.5, 0.2], visible_to_camera: true })
        };
        (0..count).map(lamp).collect()
    }

    /// Receivers among the lamps, right beside lamps, near and far.
    fn receivers(lamps: &[ReadyLamp], middle: DVec3, size: f64) -> Vec<Receiver> {
        let mut numbers = Numbers(3);
        (0..60)
            .map(|i| {
                let lamp = &lamps[i * 7 % lamps.len()];
                let point = match i % 5 {
                    0 | 1 => middle + size * numbers.place(),
                    2 => lamp.position + [1e-3, 1e-7][i / 5 % 2] * size * numbers.place(),
                    3 => middle + 4.0 * size * numbers.place(),
                    _ => middle + 1e6 * size * numbers.place(),
                };
                let normal = (numbers.place() + 1e-3).normalize().as_vec3();
                Receiver { point, normal, both_sides: i % 7 == 0 }
            })
            .collect()
    }

    /// Whether one of a few samples of a lamp carries light to a receiver. (Below a cosine of 1e-5 rounding decides on which side of the
    /// horizon it is.)
    fn gives_light(lamp: &ReadyLamp, from: &Receiver) -> bool {
        [[0.5, 0.5], [0.1, 0.8], [0.9, 0.3]].into_iter().any(|u| {
            lamp.sample(from, u).is_some_and(|s| {
                let is_above = from.both_sides || s.direction.dot(from.normal) > 1e-5;
                is_above && s.radiance.max_element() > 0.0
            })
        })
    }

    /// Each lamp that gives light to a receiver can be chosen, with the probability that is told, and nothing is chosen more often than
    /// probabilities allow. In cubes of any size, anywhere.
    #[test]
    fn no_light_is_lost() {
        let mut lit = 0;
        for (middle, size) in
            [(DVec3::ZERO, 1.0), (DVec3::splat(1e4), 1e-5), (DVec3::new(3.0, 0.0, -7.0), 1e6)]
        {
            let mut lamps = lamps(600, middle, size);
            let tree = LampTree::new(&mut lamps).unwrap();
            for from in receivers(&lamps, middle, size) {
                let chances: Vec<f32> = (0..lamps.len()).map(|i| tree.probability(&from, i)).collect();
                let sum: f64 = chances.iter().map(|&c| f64::from(c)).sum();
                assert!(sum < 1.0 + 1e-4, "{sum}");
                for (lamp, chance) in lamps.iter().zip(&chances) {
                    let gives = gives_light(lamp, &from);
                    lit += usize::from(gives);
                    assert!(!gives || *chance > 0.0, "{lamp:?} {from:?}");
                    assert!(!gives || tree.irradiance_at(&from) > 0.0, "{from:?}");
                }
                for i in 0..64 {
                    if let Some((lamp, chance)) = tree.choose(&from, [(i as f32 + 0.5) / 64.0, 0.37]) {
                        assert_eq!(chance, chances[lamp]);
                    }
                }
            }
        }
        assert!(lit > 20_000, "{lit}");
    }

    /// The second moment of irradiance over probability is far below that of a choice by power alone.
    #[test]
    fn near_lamps_that_face_the_receiver_are_preferred() {
        let mut lamps = lamps(2000, DVec3::ZERO, 1.0);
        let tree = LampTree::new(&mut lamps).unwrap();
        let total: f64 = lamps.iter().map(power).sum();
        let mut ratios = Vec::new();
        for from in receivers(&lamps, DVec3::ZERO, 1.0).into_iter().filter(|from| from.point.length() < 2.0) {
            let lit: Vec<(usize, f64)> = (0..lamps.len())
                .filter(|&i| gives_light(&lamps[i], &from))
                .map(|i| (i, f64::from(lamps[i].irradiance_at(&from)).powi(2)))
                .filter(|(_, squared)| *squared > 0.0)
                .collect();
            let moment = |chance: &dyn Fn(usize) -> f64| lit.iter().map(|&(i, s)| s / chance(i)).sum::<f64>();
            let by_tree = moment(&|i| f64::from(tree.probability(&from, i)));
            let by_power = moment(&|i| power(&lamps[i]) / total);
            if by_power > 0.0 {
                ratios.push(by_tree / by_power);
            }
        }
        ratios.sort_by(f64::total_cmp);
        let median = ratios[ratios.len() / 2];
        assert!(median < 0.5 && ratios.len() > 20, "{ratios:?}");
    }

    /// Rays in all directions, and rays aimed at each lamp by its own samples.
    #[test]
    fn no_lamp_that_a_ray_meets_is_left_out() {
        let (mut met, mut asked, mut all) = (0, 0, 0);
        for (middle, size) in
            [(DVec3::ZERO, 1.0), (DVec3::splat(1e4), 1e-5), (DVec3::new(3.0, 0.0, -7.0), 1e6)]
        {
            let mut lamps = lamps(600, middle, size);
            let tree = LampTree::new(&mut lamps).unwrap();
            let mut numbers = Numbers(5);
            for from in receivers(&lamps, middle, size) {
                let aimed = lamps.iter().filter_map(|lamp| lamp.sample(&from, [0.999_999, 0.1]));
                let mut directions: Vec<Vec3> = aimed.map(|s| s.direction).step_by(11).collect();
                directions.extend((0..8).map(|_| numbers.place().normalize().as_vec3()));
                for direction in directions {
                    let mut near = Vec::new();
                    tree.near(from.point, direction, |i| near.push(i));
                    assert!(near.is_sorted_by(|a, b| a < b), "{near:?}");
                    for (i, lamp) in lamps.iter().enumerate() {
                        let is_met = lamp.meet(&from, direction).is_some();
                        assert!(!is_met || near.contains(&i), "{lamp:?} from {from:?} along {direction}");
                        met += usize::from(is_met);
                    }
                    (asked, all) = (asked + near.len(), all + lamps.len());
                }
            }
        }
        assert!(met > 3000 && asked < all / 5, "{met} are met, {asked} of {all} are asked");
    }

    #[test]
    fn few_lamps_and_dark_ones_have_no_tree() {
        let mut few = lamps(LAMPS_OF_A_TREE as u32 - 1, DVec3::ZERO, 1.0);
        assert!(LampTree::new(&mut few).is_none());
        let mut dark = lamps(LAMPS_OF_A_TREE as u32, DVec3::ZERO, 1.0);
        assert!(LampTree::new(&mut dark.clone()).is_some());
        dark.iter_mut().for_each(|lamp| lamp.intensity = 0.0);
        assert!(LampTree::new(&mut dark).is_none());
    }
}
