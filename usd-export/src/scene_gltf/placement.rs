//! Nodes that place something by any matrix, mirrored and sheared ones included.
//!
//! ```text
//! node NAME       matrix with perpendicular columns: rotation times scale, which is all that a node may have
//!   └ node          rotation                           only where the matrix shears: A = (A V) Vᵀ
//! ```
//! See [`without_shear`].

use glam::{DAffine3, DMat4};
use gltf_json::scene::UnitQuaternion;
use gltf_json::{Index, Node, Root};
use pumice_core::Error;

use crate::Result;
use crate::shear::without_shear;

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

#[cfg(test)]
mod tests {
    use super::*;

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
