//! The anatomical directions in which the axes of a volume run, as letters.
//!
//! ```text
//! world RAS, voxels along x go right, y anterior, z superior   → RAS
//! the same voxels in a world LPS (x left, y posterior)         → LPS
//! x goes posterior, y inferior, z right                        → PIR
//! ```
//! An oblique axis gets the direction that is nearest to it, and no two axes get the same one: the assignment whose cosines have the
//! largest sum is taken. nibabel's `aff2axcodes` uses the same letters.

use glam::DVec3;
use pumice_core::{VolumeInfo, WorldFrame};

/// All assignments of three axes of the world to x, y and z.
const ASSIGNMENTS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];

/// The letters of the directions in which x, y and z run: R or L, A or P, S or I. `None` where the file does not state its world axes.
pub fn orientation(info: &VolumeInfo) -> Option<String> {
    // Letters of the positive directions of the world.
    let world = match info.frame {
        WorldFrame::Ras => ["R", "A", "S"],
        WorldFrame::Lps => ["L", "P", "S"],
        WorldFrame::Las => ["L", "A", "S"],
        WorldFrame::Unknown => return None,
    };
    let matrix = info.world_from_index.matrix3;
    let axes = [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(DVec3::normalize_or_zero);
    let sum = |to: &[usize; 3]| (0..3).map(|a| axes[a][to[a]].abs()).sum::<f64>();
    let best = ASSIGNMENTS.into_iter().max_by(|a, b| sum(a).total_cmp(&sum(b)))?;
    let letter = |a: usize| {
        let letter = world[best[a]];
        if axes[a][best[a]] < 0.0 { opposite(letter) } else { letter }
    };
    Some([letter(0), letter(1), letter(2)].concat())
}

fn opposite(letter: &'static str) -> &'static str {
    match letter {
        "R" => "L",
        "L" => "R",
        "A" => "P",
        "P" => "A",
        "S" => "I",
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DMat3};
    use pumice_core::LabelType;

    use super::*;

    fn letters(frame: WorldFrame, columns: [[f64; 3]; 3]) -> Option<String> {
        let mut info = VolumeInfo::new([3, 4, 5], LabelType::U8);
        info.frame = frame;
        info.world_from_index = DAffine3::from_mat3(DMat3::from_cols_array_2d(&columns));
        orientation(&info)
    }

    #[test]
    fn letters_follow_the_axes_and_the_world() {
        let plain = [[2.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 40.0]];
        for (frame, expected) in [
            (WorldFrame::Ras, Some("RAS")),
            (WorldFrame::Lps, Some("LPS")),
            (WorldFrame::Las, Some("LAS")),
            (WorldFrame::Unknown, None),
        ] {
            assert_eq!(letters(frame, plain).as_deref(), expected);
        }
        // x to posterior, y to inferior, z to the right, in both worlds.
        let pir = [[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]];
        assert_eq!(letters(WorldFrame::Ras, pir).as_deref(), Some("PIR"));
        let pir = [[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]];
        assert_eq!(letters(WorldFrame::Lps, pir).as_deref(), Some("PIR"));
    }

    #[test]
    fn no_two_oblique_axes_get_the_same_direction() {
        // Both x and y are nearest to R: turned by 44° about S, and y sheared towards x.
        let oblique = [[0.72, 0.69, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]];
        assert_eq!(letters(WorldFrame::Ras, oblique).as_deref(), Some("ARS"));
        // A control: the same axes without the shear.
        assert_eq!(
            letters(WorldFrame::Ras, [[0.72, 0.69, 0.0], [-0.69, 0.72, 0.0], [0.0, 0.0, 1.0]]).as_deref(),
            Some("RAS")
        );
    }
}
