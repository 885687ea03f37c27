//! Which labels a legend lists, in which order, and under which names. A figure frames what it shows beside them, and a picture draws them.

use std::cmp::Reverse;

use pumice_core::CompressedVolume;
use pumice_core::error::one_line;
use pumice_picture::annotate::LegendRow;

/// A label that a legend lists.
pub(crate) struct Listed {
    /// Its volume, among those that the legend is of.
    pub(crate) place: usize,
    /// Its dense index there.
    pub(crate) label: u32,
    /// Its name, or its id where it has none.
    name: String,
}

impl Listed {
    /// Its line in this colour.
    pub(crate) fn row(&self, color: [f32; 3]) -> LegendRow {
        LegendRow { name: self.name.clone(), color }
    }
}

/// The shown labels of volumes, most voxels first, and how many there are beyond `most`. `shown` says of each label whether it is shown.
///
/// # Errors
/// If none is shown.
pub(crate) fn listed<'a>(
    shown: impl Iterator<Item = (&'a CompressedVolume, Vec<bool>)>,
    most: usize,
) -> Result<(Vec<Listed>, usize), String> {
    let (mut volumes, mut found) = (Vec::new(), Vec::new());
    for (place, (volume, is_shown)) in shown.enumerate() {
        let rows = (0u32..).zip(volume.labels().voxels()).zip(is_shown).filter(|(_, is_shown)| *is_shown);
        found.extend(
            rows.map(|((label, &voxels), _)| (Reverse(voxels), place, label))
                .filter(|(_, _, label)| volume.holds(*label)),
        );
        volumes.push(volume);
    }
    if found.is_empty() {
        return Err("the scene shows no label".into());
    }
    found.sort_unstable();
    let more = found.len().saturating_sub(most);
    found.truncate(most);
    let listed = |(_, place, label): (Reverse<u64>, usize, u32)| {
        let volume = volumes[place];
        let name = volume.note(label).and_then(|note| note.name.clone()).filter(|name| !name.is_empty());
        let name = name.unwrap_or_else(|| volume.labels().ids()[label as usize].to_string());
        Listed { place, label, name: one_line(&name) }
    };
    Ok((found.into_iter().map(listed).collect(), more))
}
