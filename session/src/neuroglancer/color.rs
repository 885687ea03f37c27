//! The colours that Neuroglancer gives to segments without one of their own.

/// The display colour of a segment: sRGB-encoded, each channel from 0 to 1. `seed` is the layer's `colorSeed`.
pub(super) fn color_of(id: u64, seed: u32) -> [f32; 3] {
    let hash = mixed(mixed(seed, id as u32), (id >> 32) as u32);
    let [hue, part] = [hash, hash >> 8].map(|bits| (bits & 0xFF) as f32 / 255.0);
    of_hue(hue, 0.5 + 0.5 * part)
}

/// A step of MurmurHash3, without its last mixing.
fn mixed(state: u32, value: u32) -> u32 {
    let value = value.wrapping_mul(0xCC9E_2D51).rotate_left(15).wrapping_mul(0x1B87_3593);
    (state ^ value).rotate_left(13).wrapping_mul(5).wrapping_add(0xE654_6B64)
}

/// The colour of full value with this hue and saturation, both from 0 to 1.
fn of_hue(hue: f32, saturation: f32) -> [f32; 3] {
    // A channel falls with the distance of the hue from the channel's own, in sixths of the circle.
    [0.0, 2.0, 4.0].map(|own: f32| {
        let away = (6.0 * hue - own).rem_euclid(6.0);
        let away = away.min(6.0 - away);
        1.0 - saturation * (away - 1.0).clamp(0.0, 1.0)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The expected colours come from Neuroglancer's own code, run in Node.
    #[test]
    fn colors_are_those_of_neuroglancer() {
        for (seed, id, expected) in [
            (0, 1, [0.368_627, 0.502_330, 1.0]),
            (0, 2, [1.0, 0.207_843, 0.468_789]),
            (0, 720_575_940_621_039_145, [1.0, 0.900_531, 0.231_373]),
            (u32::MAX, u64::MAX, [0.411_765, 0.439_446, 1.0]),
        ] {
            for (got, expected) in color_of(id, seed).into_iter().zip(expected) {
                assert!((got - expected).abs() < 2e-6, "{id}: {got} {expected}");
            }
        }
        assert_ne!(color_of(1, 0), color_of(1, 1 << 20), "the seed counts");
    }

    #[test]
    fn hues_are_those_of_the_circle() {
        for (hue, expected) in [
            (0.0, [1.0, 0.0, 0.0]),
            (1.0 / 6.0, [1.0, 1.0, 0.0]),
            (2.0 / 6.0, [0.0, 1.0, 0.0]),
            (0.5, [0.0, 1.0, 1.0]),
            (4.0 / 6.0, [0.0, 0.0, 1.0]),
            (5.0 / 6.0, [1.0, 0.0, 1.0]),
            (1.0, [1.0, 0.0, 0.0]),
            (0.25, [0.5, 1.0, 0.0]),
        ] {
            for (got, expected) in of_hue(hue, 1.0).into_iter().zip(expected) {
                assert!((got - expected).abs() < 1e-6, "{hue}: {got} {expected}");
            }
        }
        assert_eq!(of_hue(0.0, 0.5), [1.0, 0.5, 0.5]);
    }
}
