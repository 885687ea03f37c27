//! Nodes that place something by any matrix, mirrored and sheared ones included.
//!
//! ```text
//! node NAME       matrix with perpendicular columns: rotation times scale, which is all that a node may have
//!   └ node          rotation                           only where the matrix shears: A = (A V) Vᵀ
//! ```
//! A V has perpendicular columns where V turns the space to the axes of the ellipsoid that A makes of a sphere. V is found by turning pairs
//! of columns until all are perpendicular (Hestenes 1958, *Inversion of Matrices by Biorthogonalization*).

use glam::{DAffine3, DMat3, DMat4, DQuat};
use gltf_json::scene::UnitQuaternion;
use gltf_json::{Index, Node, Root};
use pumice_core::Error;

use crate::Result;

/// Largest cosine between columns that count as perpendicular: columns of numbers in single precision are no better.
const PERPENDICULAR: f64 = 1e-7;

/// Adds nodes that place what `fill` puts into one of them. Returns the outer one.
///
/// # Errors
/// [`Error::Caller`] where the matrix has numbers beyond single precision.
pub(super) fn place(
    root: &mut Root,
    name: &str,
    matrix: DAffine3,
    fill: impl FnOnce(&mut Node),
) -> Result<Index<Node>> {
    let (outer, rotation) = without_shear(matrix.matrix3);
    let mut node = Node { name: Some(name.to_owned()), ..Node::default() };
    let placed = DAffine3 { matrix3: outer, ..matrix };
    if placed != DAffine3::IDENTITY {
        node.matrix = Some(single(name, DMat4::from(placed).to_cols_array())?);
    }
    match rotation {
        None => fill(&mut node),
        Some(rotation) => {
            let rotation = UnitQuaternion(rotation.to_array().map(|v| v as f32));
            let mut inner = Node { rotation: Some(rotation), ..Node::default() };
            fill(&mut inner);
            node.children = Some(vec![root.push(inner)]);
        }
    }
    Ok(root.push(node))
}

/// Numbers in single precision.
///
/// # Errors
/// [`Error::Caller`] with `what` where a number is beyond it.
pub(super) fn single<const N: usize>(what: &str, numbers: [f64; N]) -> Result<[f32; N]> {
    let most = f64::from(f32::MAX);
    match numbers.iter().find(|number| !(-most..=most).contains(*number)) {
        None => Ok(numbers.map(|number| number as f32)),
        Some(number) => Err(Error::Caller(format!(
            "{what}: expected numbers up to {most:e}, the largest of a glTF file, got {number:e}"
        ))
        .into()),
    }
}

/// A matrix with perpendicular columns and a rotation before it, which together are `matrix`; no rotation where it already has such columns.
fn without_shear(matrix: DMat3) -> (DMat3, Option<DQuat>) {
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

    #[test]
    fn numbers_beyond_single_precision_are_refused() {
        assert_eq!(single("a", [1.0, -2.5]).unwrap(), [1.0, -2.5]);
        let error = single("volume_3", [1.0, 1e39]).unwrap_err().to_string();
        assert!(
            error.starts_with("volume_3: expected numbers up to 3.4") && error.ends_with("got 1e39"),
            "{error}"
        );
        assert!(single("a", [f64::NAN]).is_err());
    }
}
