//! The meaning of an array's indices in stores that hold arrays of any kind: by their names, or by their order.
//!
//! ```text
//! names        t c z y x of OME-Zarr, dimension names of Zarr v3, `_ARRAY_DIMENSIONS` of xarray, `axis_names` of funlib, labels of HDF5
//! order        a[z, y, x], which is assumed with a warning; `--axes xyz` says otherwise, and `--axes tzyx` of four axes
//! ```

use std::path::Path;

use crate::choice::{self, ChoiceValue, OpenChoice, choose, refuse_absent};
use crate::error::{FormatError, Result};
use crate::layout::Role;
use crate::options::{ArrayAxes, OpenOptions};

/// A shape for people.
pub(crate) fn shape_text(shape: &[u64]) -> String {
    format!("({})", shape.iter().map(u64::to_string).collect::<Vec<_>>().join(", "))
}

/// The role of each index, by the names of axes in any letters. An axis with another name is a layer, if it has several steps.
pub(crate) fn by_names(
    path: &Path,
    names: &[String],
    shape: &[u64],
    options: &OpenOptions,
    open: &mut Vec<OpenChoice>,
) -> Result<Vec<Role>> {
    if let Some(axes) = options.axes {
        return Err(FormatError::NotApplicable {
            path: path.to_owned(),
            option: format!("--axes {}", axes.name()),
            why: format!("the array says that its axes are {}", names.join(", ")),
        });
    }
    if names.len() != shape.len() {
        return Err(FormatError::damaged(
            path,
            format!("the array has shape {}, but {} axes have names", shape_text(shape), names.len()),
        ));
    }
    let mut roles = Vec::new();
    let mut absent = vec![&choice::TIME, &choice::CHANNEL, &choice::LAYER];
    for (name, &size) in names.iter().zip(shape) {
        let lower = name.to_lowercase();
        let what = match lower.as_str() {
            "x" | "y" | "z" => {
                let role = Role::Space(usize::from(lower.as_bytes()[0] - b'x'));
                if roles.contains(&role) {
                    return Err(FormatError::damaged(path, format!("two axes are named {name}")));
                }
                roles.push(role);
                continue;
            }
            "t" | "time" => &choice::TIME,
            "c" | "channel" => &choice::CHANNEL,
            _ if size == 1 => {
                roles.push(Role::Fixed(0));
                continue;
            }
            _ => &choice::LAYER,
        };
        let Some(at) = absent.iter().position(|left| left.keyword == what.keyword) else {
            return Err(FormatError::unsupported(
                path,
                format!("the array has several axes beside x, y and z: {}", names.join(", ")),
                "save one label map an array",
            ));
        };
        absent.remove(at);
        roles.push(Role::Fixed(choose(path, what, options, size, open)?));
    }
    refuse_absent(path, options, &absent)?;
    if !roles.iter().any(|role| matches!(role, Role::Space(_))) {
        return Err(FormatError::damaged(
            path,
            format!("none of the axes {} is x, y or z", names.join(", ")),
        ));
    }
    Ok(roles)
}

/// The caller's order of an array of three axes.
///
/// # Errors
/// For an order that only the pages of a TIFF file can have.
pub(crate) fn of_three(path: &Path, options: &OpenOptions) -> Result<Option<ArrayAxes>> {
    match options.axes {
        Some(axes) if !ArrayAxes::OF_ARRAYS.contains(&axes) => Err(FormatError::option(
            path,
            format!("--axes {}: expected xyz or zyx for an array of this shape", axes.name()),
        )),
        axes => Ok(axes),
    }
}

/// The role of each index of an array without names: z, y, x unless the caller says otherwise. Indices of one step are left out until three remain.
pub(crate) fn by_order(
    path: &Path,
    shape: &[u64],
    options: &OpenOptions,
    open: &mut Vec<OpenChoice>,
) -> Result<Vec<Role>> {
    // The caller names as many axes as there are: time steps and channels are chosen as in files that name them.
    if let Some(axes) = options.axes.filter(|axes| axes.name().len() == shape.len() && shape.len() > 3) {
        let names: Vec<String> = axes.name().chars().map(String::from).collect();
        return by_names(path, &names, shape, &OpenOptions { axes: None, ..options.clone() }, open);
    }
    refuse_absent(path, options, &[&choice::TIME, &choice::CHANNEL, &choice::LAYER])?;
    let said = of_three(path, options)?;
    let mut roles = vec![None; shape.len()];
    let mut left = shape.len();
    for (index, &size) in shape.iter().enumerate() {
        if left > 3 && size == 1 {
            roles[index] = Some(Role::Fixed(0));
            left -= 1;
        }
    }
    if !(2..=3).contains(&left) {
        return Err(FormatError::unsupported(
            path,
            format!("the array has shape {}, expected two or three axes", shape_text(shape)),
            "save one label map an array, or name its axes: --axes tzyx, czyx, …",
        ));
    }
    let order = said.unwrap_or(ArrayAxes::Zyx);
    if said.is_none() {
        open.push(open_axes());
        options.warnings.push(format!(
            "{}: the array does not say which axis is which; the shape {} is taken as zyx (give --axes xyz or zyx)",
            path.display(),
            shape_text(shape)
        ));
    }
    let mut number = 0;
    Ok(roles
        .into_iter()
        .map(|role| {
            role.unwrap_or_else(|| {
                let space = if order == ArrayAxes::Xyz { number } else { left - 1 - number };
                number += 1;
                Role::Space(space)
            })
        })
        .collect())
}

/// The order of axes as a choice that the file leaves open.
fn open_axes() -> OpenChoice {
    let text = |axes| match axes {
        ArrayAxes::Xyz => "a[x, y, z]",
        _ => "a[z, y, x], as most programs write them",
    };
    let value = |axes: ArrayAxes| ChoiceValue { value: axes.name().into(), text: text(axes).into() };
    OpenChoice {
        keyword: "axes",
        option: "--axes",
        what: "the array does not say which axis is which".into(),
        listed: ArrayAxes::OF_ARRAYS.map(|axes| format!("{}: {}", axes.name(), text(axes))).join("; "),
        values: ArrayAxes::OF_ARRAYS.map(value).to_vec(),
        count: ArrayAxes::OF_ARRAYS.len() as u64,
        assumed: Some(ArrayAxes::Zyx.name()),
    }
}

/// Numbers of the indices as numbers of x, y, z; `other` where no index is that axis.
pub(crate) fn along_xyz(roles: &[Role], of_indices: &[f64], other: f64) -> [f64; 3] {
    let mut along = [other; 3];
    for (role, &number) in roles.iter().zip(of_indices) {
        if let Role::Space(space) = role {
            along[*space] = number;
        }
    }
    along
}
