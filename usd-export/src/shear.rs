//! Matrices that shear, for files and programs that know only a translation, a rotation and a scale.

use glam::{DMat3, DQuat};

/// Largest cosine between columns that count as perpendicular. Rotations in single precision have up to some 2·10⁻⁷. A program that keeps
/// only rotation and scale of such a matrix moves points by less than a hundredth of a voxel in a volume of 4,096 voxels.
const PERPENDICULAR: f64 = 1e-6;

/// A matrix with perpendicular columns and a rotation before it, which together are `matrix`; no rotation where it already has such columns.
///
/// A = (A V) Vᵀ, and A V has perpendicular columns where V turns the space to the axes of the ellipsoid that A makes of a sphere. V is found
/// by turning pairs of columns until all are perpendicular (Hestenes 1958, *Inversion of Matrices by Biorthogonalization*).
pub(crate) fn without_shear(matrix: DMat3) -> (DMat3, Option<DQuat>) {
    const PAIRS: [[usize; 2]; 3] = [[0, 1], [0, 2], [1, 2]];
    let mut a = [matrix.x_axis, matrix.y_axis, matrix.z_axis];
    let mut v = [DMat3::IDENTITY.x_axis, DMat3::IDENTITY.y_axis, DMat3::IDENTITY.z_axis];
    let cosine = |a: &[glam::DVec3; 3], p: usize, q: usize| a[p].normalize().dot(a[q].normalize());
    if PAIRS.iter().all(|&[p, q]| cosine(&a, p, q).abs() < PERPENDICULAR) {
        return (matrix, None);
    }
    let scale = a.iter().map(|column| column.length()).fold(0.0, f64::max);
    a = a.map(|column| column / scale);
    // Each sweep squares the cosines; six end at rounding from any matrix, more change nothing.
    for [p, q] in [PAIRS; 12].into_iter().flatten() {
        let dot = a[p].dot(a[q]);
        if cosine(&a, p, q).abs() < 1e-15 {
            continue;
        }
        let zeta = (a[q].length_squared() - a[p].length_squared()) / (2.0 * dot);
        let tangent = zeta.signum() / (zeta.abs() + zeta.hypot(1.0));
        let cos = 1.0 / tangent.hypot(1.0);
        let sin = cos * tangent;
        for columns in [&mut a, &mut v] {
            [columns[p], columns[q]] =
                [cos * columns[p] - sin * columns[q], sin * columns[p] + cos * columns[q]];
        }
    }
    let [a, v] = [a.map(|column| column * scale), v].map(|c| DMat3::from_cols(c[0], c[1], c[2]));
    (a, Some(DQuat::from_mat3(&v.transpose()).normalize()))
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn any_matrix_is_perpendicular_columns_times_a_rotation() {
        let sheared = [
            DMat3::from_cols(DVec3::X, DVec3::new(0.5, 1.0, 0.0), DVec3::Z),
            DMat3::from_cols(
                DVec3::new(1.0, 2.0, 3.0),
                DVec3::new(-4.0, 5.0, 0.1),
                DVec3::new(0.0, 1e-3, -7.0),
            ),
            DMat3::from_diagonal(DVec3::new(1e-4, 3.0, 1e3))
                * DMat3::from_axis_angle(DVec3::ONE.normalize(), 0.7),
            1e-9 * DMat3::from_cols(DVec3::X, DVec3::new(0.999, 1e-3, 0.0), DVec3::Z),
        ];
        for matrix in sheared {
            let (outer, rotation) = without_shear(matrix);
            let back = outer * DMat3::from_quat(rotation.unwrap());
            let scale = matrix.to_cols_array().into_iter().fold(0.0, |m: f64, v| m.max(v.abs()));
            // A few roundings of double precision.
            assert!(((back - matrix) * scale.recip()).abs_diff_eq(DMat3::ZERO, 1e-14), "{matrix} {back}");
            let [x, y, z] = [outer.x_axis, outer.y_axis, outer.z_axis].map(DVec3::normalize);
            for cosine in [x.dot(y), x.dot(z), y.dot(z)] {
                assert!(cosine.abs() < 1e-12, "{outer}");
            }
        }
        // A rotation times a scale stays as it is, mirrored or not.
        for scale in [DVec3::new(4.0, 4.0, 40.0), DVec3::new(4.0, -4.0, 1e-3)] {
            let matrix = DMat3::from_rotation_y(0.3) * DMat3::from_diagonal(scale);
            assert_eq!(without_shear(matrix), (matrix, None));
        }
    }
}
