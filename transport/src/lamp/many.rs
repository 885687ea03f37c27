//! Many lamps at once: the numbers that decide about each of them, in arrays that the compiler turns into SIMD instructions.
//!
//! With a hundred lamps, asking one after another for its irradiance, and whether a ray meets it, takes two thirds of a sample's time. Both
//! results are the same, to the last bit, as those of the lamps themselves.

use glam::{DVec3, Vec3};
use multiversion::multiversion;

use super::{HORIZON, LEAST_SQUARED_TO_LAMP, LampKind, ReadyLamp, Receiver};

/// Lamps below this number are asked one after another.
const MANY: usize = 8;

/// Lamps that are computed together. With eight, compilers unroll the loop over them first, and then find few vector instructions.
const LANES: usize = 16;

/// The numbers of some lamps; lanes without a lamp are like lamps without light.
#[derive(Clone, Debug, Default)]
struct Block {
    position: [[f64; LANES]; 3],
    radius: [f32; LANES],
    intensity: [f32; LANES],
    /// Position from the middle of all lamps.
    from_middle: [[f32; LANES]; 3],
    /// Squared radius of a ball around the whole lamp.
    reach_squared: [f32; LANES],
    /// Lamps that are no balls, or balls in a cone: bit i for lane i.
    alone: u16,
    /// Lanes that have a lamp.
    used: u16,
}

/// Many lamps (see the module), in blocks.
#[derive(Clone, Debug)]
pub(crate) struct ManyLamps {
    blocks: Vec<Block>,
    middle: DVec3,
    /// Squared distance from the middle of the lamp that is farthest from it.
    size_squared: f32,
}

/// Part of the squared distances that is added to a lamp's reach: 128 roundings of an f32, where those of a ray's squared distance, here
/// and in [`ReadyLamp::meet`], add up to some seventy.
const ROUNDINGS: f32 = 64.0 * f32::EPSILON;

/// Squared distances up to here, and a few times as large, do not overflow an f32.
const MOST_SQUARED: f64 = 1e36;

impl ManyLamps {
    /// `None` where there are so few lamps that it does not pay.
    pub(crate) fn new(lamps: &[ReadyLamp]) -> Option<Self> {
        if lamps.len() < MANY {
            return None;
        }
        let middle = lamps.iter().map(|lamp| lamp.position / lamps.len() as f64).sum::<DVec3>();
        let block = |lamps: &[ReadyLamp]| {
            let mut block = Block::default();
            for (i, lamp) in lamps.iter().enumerate() {
                let is_flat = matches!(lamp.kind, LampKind::Rectangle | LampKind::Ellipse);
                let [u, v] = lamp.half;
                for a in 0..3 {
                    block.position[a][i] = lamp.position[a];
                    block.from_middle[a][i] = (lamp.position[a] - middle[a]) as f32;
                }
                (block.radius[i], block.intensity[i]) = (u, lamp.intensity);
                block.reach_squared[i] = if is_flat { u * u + v * v } else { u * u };
                block.alone |= u16::from(is_flat || lamp.kind == LampKind::Spot) << i;
                block.used |= 1 << i;
            }
            block
        };
        let distances = lamps.iter().map(|lamp| (lamp.position - middle).length_squared() as f32);
        Some(Self {
            blocks: lamps.chunks(LANES).map(block).collect(),
            middle,
            size_squared: distances.fold(0.0, f32::max),
        })
    }

    /// [`ReadyLamp::irradiance_at`] of all lamps, in blocks: the number of the first, and the irradiances from there on. Those past the last
    /// lamp mean nothing.
    #[inline]
    pub(crate) fn irradiances_at<'a>(
        &'a self,
        lamps: &'a [ReadyLamp],
        from: &'a Receiver,
    ) -> impl Iterator<Item = (usize, [f32; LANES])> + 'a {
        // (Where squares may overflow, each lamp deals with infinities.)
        let far = f64::from(self.size_squared) + (from.point - self.middle).length_squared();
        let is_in_range = far < MOST_SQUARED;
        self.blocks.iter().zip((0..).step_by(LANES)).map(move |(block, first)| {
            let mut irradiances = irradiances_of(block, from);
            let mut alone = if is_in_range { block.alone } else { block.used };
            while alone != 0 {
                let i = alone.trailing_zeros() as usize;
                alone &= alone - 1;
                irradiances[i] = lamps[first + i].irradiance_at(from);
            }
            (first, irradiances)
        })
    }

    /// Calls `visit` with the numbers of the lamps that a ray (unit direction) from a point may meet, in order. It leaves out only lamps for
    /// which [`ReadyLamp::meet`] finds nothing.
    #[inline]
    pub(crate) fn near(&self, from: DVec3, direction: Vec3, mut visit: impl FnMut(usize)) {
        let from = (from - self.middle).as_vec3();
        let slack = (self.size_squared + from.length_squared()) * ROUNDINGS;
        for (block, first) in self.blocks.iter().zip((0..).step_by(LANES)) {
            let mut near = near_a_ray(block, from, direction, slack) & block.used;
            while near != 0 {
                visit(first + near.trailing_zeros() as usize);
                near &= near - 1;
            }
        }
    }
}

/// [`ReadyLamp::irradiance_at`] of balls that shine all around.
#[multiversion(targets("x86_64+avx2+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn irradiances_of(block: &Block, from: &Receiver) -> [f32; LANES] {
    let ([x, y, z], n) = (&block.position, from.normal);
    let mut irradiances = [0.0; LANES];
    for i in 0..LANES {
        let (x, y, z) = (x[i] - from.point.x, y[i] - from.point.y, z[i] - from.point.z);
        let (x, y, z) = (x as f32, y as f32, z as f32);
        let radius = block.radius[i];
        let squared = x * x + y * y + z * z;
        let squared = greater(greater(squared, radius * radius), LEAST_SQUARED_TO_LAMP);
        let distance = squared.sqrt();
        let along = x * n.x + y * n.y + z * n.z;
        let cos = (along + radius) / distance + HORIZON;
        let cos = if cos > 0.0 { cos } else { 0.0 };
        let cos = if cos < 1.0 { cos } else { 1.0 };
        let all_around = block.intensity[i] * (1.0 / squared);
        irradiances[i] = if from.both_sides { all_around } else { all_around * cos };
    }
    irradiances
}

/// The lamps that come as near to a ray as their reach, or may: bit i for lane i. The ray starts at a point from the middle of all
/// lamps; `slack` bounds the rounding errors of squared distances.
#[multiversion(targets("x86_64+avx2+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn near_a_ray(block: &Block, from: Vec3, direction: Vec3, slack: f32) -> u16 {
    let ([x, y, z], d) = (&block.from_middle, direction);
    let mut is_near = [false; LANES];
    for i in 0..LANES {
        let (x, y, z) = (x[i] - from.x, y[i] - from.y, z[i] - from.z);
        let squared = x * x + y * y + z * z;
        let along = x * d.x + y * d.y + z * d.z;
        let far = block.reach_squared[i] + (block.reach_squared[i] * ROUNDINGS + slack);
        // The squared distance from the whole line; behind the start, that from the start. (Where numbers overflow, all are near.)
        let beside = squared - if along > 0.0 { along * along } else { 0.0 };
        let is_far = beside > far;
        is_near[i] = !is_far;
    }
    // (Mostly there are none.)
    if is_near == [false; LANES] {
        return 0;
    }
    (0..LANES).map(|i| u16::from(is_near[i]) << i).sum()
}

/// The greater of two numbers that are not NaN: one instruction.
#[inline(always)]
fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[cfg(test)]
mod tests {
    use pumice_scene::{Light, LightShape, Outline};

    use super::*;

    fn lamps(count: u32) -> Vec<ReadyLamp> {
        let mut state = 5u32;
        let mut random = move || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8) / f64::from(1 << 24)
        };
        let lamp = |i: u32| {
            let mut place = || 20.0 * random() - 10.0;
            let position = [place(), place(), place()];
            let (radius, soft_falloff) = ([0.0, 0.05, 2.0, 1e-4][i as usize % 4], i % 8 > 4);
            let shape = match i % 5 {
                0 | 1 => LightShape::Point { position, radius, soft_falloff },
                2 => {
                    let direction = [place(), place(), 1.0];
                    LightShape::Spot { position, direction, radius, angle_rad: 2.5, blend: 0.3, soft_falloff }
                }
                _ => LightShape::Area {
                    world_from_light: glam::DAffine3::from_rotation_translation(
                        glam::DQuat::from_rotation_x(place()),
                        DVec3::from_array(position),
                    ),
                    outline: if i.is_multiple_of(2) { Outline::Rectangle } else { Outline::Ellipse },
                    size: [1.0 + radius, 0.5],
                    spread_rad: 3.0,
                },
            };
            ReadyLamp::new(&Light { shape, power_w: i as f32, color: [1.0; 3], visible_to_camera: false })
        };
        (0..count).map(lamp).collect()
    }

    /// Points near and far, at a lamp's middle, and so far away that squares overflow.
    fn points(lamps: &[ReadyLamp]) -> Vec<DVec3> {
        let near = (0..200).map(|i| {
            let at = |a: f64| 12.0 * (a * f64::from(i)).sin();
            DVec3::new(at(1.0), at(2.3), at(3.7))
        });
        near.chain([lamps[0].position, DVec3::splat(1e4), DVec3::splat(-1e25)]).collect()
    }

    #[test]
    fn irradiances_are_those_of_the_lamps() {
        let mut lit = 0;
        for count in [8, 27] {
            let lamps = lamps(count);
            let many = ManyLamps::new(&lamps).unwrap();
            for (point, both_sides) in points(&lamps).into_iter().flat_map(|p| [(p, false), (p, true)]) {
                let from = Receiver { point, normal: Vec3::new(0.6, 0.0, -0.8), both_sides };
                let all: Vec<f32> = many.irradiances_at(&lamps, &from).flat_map(|(_, all)| all).collect();
                for (lamp, found) in lamps.iter().zip(&all) {
                    assert_eq!(found.to_bits(), lamp.irradiance_at(&from).to_bits(), "{lamp:?} {from:?}");
                    lit += usize::from(*found > 0.0);
                }
                let first: Vec<usize> = many.irradiances_at(&lamps, &from).map(|(first, _)| first).collect();
                assert_eq!(first, (0..count as usize).step_by(LANES).collect::<Vec<_>>());
            }
        }
        assert!(lit > 5000, "{lit}");
        assert!(ManyLamps::new(&lamps(7)).is_none());
    }

    /// Rays in all directions, and rays aimed at each lamp by its own samples, up to its rim.
    #[test]
    fn no_lamp_that_a_ray_meets_is_left_out() {
        let lamps = lamps(27);
        let many = ManyLamps::new(&lamps).unwrap();
        let (mut met, mut asked, mut all) = (0, 0, 0);
        for point in points(&lamps) {
            let from = Receiver { point, normal: Vec3::Z, both_sides: true };
            let aimed = lamps.iter().flat_map(|lamp| {
                [[0.999_999, 0.1], [0.5, 0.7], [0.0, 0.999_999]]
                    .into_iter()
                    .filter_map(|u| lamp.sample(&from, u))
            });
            let mut directions: Vec<Vec3> = aimed.map(|s| s.direction).collect();
            directions.extend(
                (0..40).map(|i| Vec3::new((i as f32).sin(), (1.7 * i as f32).cos(), 0.3).normalize()),
            );
            for direction in directions {
                let mut near = Vec::new();
                many.near(point, direction, |i| near.push(i));
                assert!(near.is_sorted() && near.iter().all(|&i| i < lamps.len()), "{near:?}");
                for (i, lamp) in lamps.iter().enumerate() {
                    let is_met = lamp.meet(&from, direction).is_some();
                    assert!(!is_met || near.contains(&i), "{lamp:?} from {point} along {direction}");
                    met += usize::from(is_met);
                }
                (asked, all) = (asked + near.len(), all + lamps.len());
            }
        }
        assert!(met > 3000 && asked < all / 3, "{met} are met, {asked} of {all} are asked");
    }
}
