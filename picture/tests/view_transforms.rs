//! The approximations of Blender's view transforms against what Blender 5.0.1 makes of 433 colours: greys, saturated ones, ordinary ones
//! (`tests/view_transforms` made `view_transforms.csv`).

#![allow(clippy::unwrap_used, clippy::panic, reason = "tests")]

use pumice_picture::ViewTransform;
use pumice_picture::view_transform::shown;

/// Scene-linear colour, Blender's Filmic, Blender's AgX.
type Row = [[f64; 3]; 3];

const GREYS: usize = 33;
const SATURATED: usize = 200;

fn rows() -> Vec<Row> {
    let text = include_str!("view_transforms.csv");
    let rows = text.lines().skip(1).map(|line| {
        let numbers: Vec<f64> = line.split(',').map(|n| n.parse().unwrap()).collect();
        [0, 3, 6].map(|at| numbers[at..at + 3].try_into().unwrap())
    });
    rows.collect()
}

/// Mean and largest difference in steps of an 8 bit channel.
fn off(rows: &[Row], view: ViewTransform, theirs: usize) -> (f64, f64) {
    let apart = rows.iter().flat_map(|row| {
        let ours = shown(view, row[0].map(|c| c as f32));
        [0, 1, 2].map(|c| 255.0 * (ours[c] - row[theirs][c]).abs())
    });
    let apart: Vec<f64> = apart.collect();
    (apart.iter().sum::<f64>() / apart.len() as f64, apart.iter().copied().fold(0.0, f64::max))
}

/// What docs/passes.md says. These are a sixtieth of the colours that it speaks of: means within their own noise, extremes below.
#[test]
fn blenders_are_approximated_as_well_as_documented() {
    let rows = rows();
    assert_eq!(rows.len(), 433);
    let (greys, rest) = rows.split_at(GREYS);
    let (saturated, ordinary) = rest.split_at(SATURATED);
    for (part, view, theirs, mean, most) in [
        (greys, ViewTransform::Filmic, 1, 0.1, 0.15),
        (ordinary, ViewTransform::Filmic, 1, 0.05, 0.15),
        (saturated, ViewTransform::Filmic, 1, 0.8, 175.0),
        (greys, ViewTransform::Agx, 2, 0.1, 0.8),
        (ordinary, ViewTransform::Agx, 2, 0.4, 7.6),
        (saturated, ViewTransform::Agx, 2, 1.6, 26.1),
    ] {
        let found = off(part, view, theirs);
        println!("{view:?}, {} colours: {found:?}", part.len());
        assert!(found.0 <= mean && found.1 <= most, "{view:?}, {} colours: {found:?}", part.len());
        // Negative controls: the other transform, and none.
        let other = off(part, if theirs == 1 { ViewTransform::Agx } else { ViewTransform::Filmic }, theirs);
        let none = off(part, ViewTransform::Standard, theirs);
        assert!(
            other.0 > 5.0 * mean.max(0.5) && none.0 > 5.0 * mean.max(0.5),
            "{view:?}: {other:?}, {none:?}"
        );
    }
}
