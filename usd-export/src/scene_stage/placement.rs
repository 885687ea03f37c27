//! Where a prim stands: its matrix, in USD's form and order.
//!
//! Importers that keep a translation, a rotation and a scale of each prim, as Blender's does, would lose a shear. So a matrix that shears is
//! two, a prim's and that of the prim below it, and the product is the matrix to any reader ([`without_shear`]).

use glam::{DAffine3, DMat3, DVec3};

use crate::shear::without_shear;
use crate::usd::{Property, Value};

/// The properties that place a prim in the world. USD multiplies a row from the left, so rows of its matrix are columns of ours.
pub(super) fn placement(world_from_prim: &DAffine3) -> [Property<'static>; 2] {
    let m = world_from_prim.matrix3;
    let mut rows = [[0.0; 4]; 4];
    for (row, column) in rows.iter_mut().zip([m.x_axis, m.y_axis, m.z_axis, world_from_prim.translation]) {
        row[..3].copy_from_slice(&column.to_array());
    }
    rows[3][3] = 1.0;
    [
        Property::new("xformOp:transform", "matrix4d", Value::Matrix4(rows)),
        Property::uniform("xformOpOrder", "token[]", Value::Tokens(vec!["xformOp:transform".into()])),
    ]
}

/// The matrix of a prim without its shear, and that of the prim below it that makes up for that; none where the matrix does not shear.
pub(super) fn outer_and_inner(world_from_prim: &DAffine3) -> (DAffine3, Option<DAffine3>) {
    let (outer, rotation) = without_shear(world_from_prim.matrix3);
    (DAffine3 { matrix3: outer, ..*world_from_prim }, rotation.map(DAffine3::from_quat))
}

/// The same place and directions of the axes, with axes of length 1.
pub(super) fn without_scale(m: &DAffine3) -> DAffine3 {
    let axes = m.matrix3;
    let unit = DMat3::from_cols(axes.x_axis.normalize(), axes.y_axis.normalize(), axes.z_axis.normalize());
    DAffine3::from_mat3_translation(unit, m.translation)
}

/// A place from which −z, along which USD's lights shine, points along a direction of any length that a scene may have.
pub(super) fn facing(position: DVec3, direction: DVec3) -> DAffine3 {
    let z = -direction.normalize();
    let (x, y) = z.any_orthonormal_pair();
    DAffine3::from_mat3_translation(DMat3::from_cols(x, y, z), position)
}

/// A property of no schema that importers keep under its own name: Blender as a custom property.
pub(super) fn note(name: &str, type_name: &'static str, value: Value<'static>) -> Property<'static> {
    Property::custom(format!("userProperties:{name}"), type_name, value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_light_faces_along_its_direction_and_is_not_mirrored() {
        for direction in [DVec3::Z, DVec3::NEG_Z, DVec3::new(3.0, -0.1, 1e-9), DVec3::new(0.0, 1e-100, 0.0)] {
            let m = facing(DVec3::ONE, direction).matrix3;
            assert!((m * DVec3::NEG_Z - direction.normalize()).length() < 1e-15);
            assert!((m.determinant() - 1.0).abs() < 1e-14, "{direction}");
        }
    }
}
