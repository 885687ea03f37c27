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

#[cfg(test)]
mod tests {
    use pumice_core::{CompressionLevel, Job, LabelBuffer, LabelType, VolumeInfo, compress_labels};

    use super::*;

    fn ids(found: &[Listed]) -> Vec<&str> {
        found.iter().map(|one| one.name.as_str()).collect()
    }

    /// Of a file that is read with some labels, the others have no voxel to show; a figure asks before it knows that.
    #[test]
    fn labels_that_were_not_read_are_not_listed() {
        let (folder, job) = (tempfile::tempdir().unwrap(), Job::new());
        let path = folder.path().join("v.pumice");
        let labels = LabelBuffer::U8(vec![20, 20, 8, 9, 3, 9, 8, 20, 20]);
        let whole = compress_labels(VolumeInfo::new([9, 1, 1], LabelType::U8), labels).unwrap();
        whole.save(&path, CompressionLevel::Default, &job).unwrap();
        let chosen = |chosen: &'static [u64]| {
            let choose = |table: &pumice_core::LabelTable| {
                table.ids().iter().map(|id| chosen.contains(id)).collect::<Vec<_>>()
            };
            CompressedVolume::open_labels(&path, choose, &job).unwrap()
        };
        let all = vec![true; 4];
        let (found, more) = listed([(&whole, all.clone())].into_iter(), 9).unwrap();
        assert_eq!((ids(&found), more), (vec!["20", "8", "9", "3"], 0));
        let some = chosen(&[9, 20]);
        let (found, more) = listed([(&some, all.clone())].into_iter(), 9).unwrap();
        assert_eq!((ids(&found), more), (vec!["20", "9"], 0));
        let (found, more) = listed([(&some, all.clone()), (&whole, all)].into_iter(), 2).unwrap();
        let places: Vec<usize> = found.iter().map(|one| one.place).collect();
        assert_eq!((ids(&found), places, more), (vec!["20", "20"], vec![0, 1], 4));
        assert!(
            listed([(&some, vec![false; 4])].into_iter(), 9).is_err_and(|e| e == "the scene shows no label")
        );
    }
}
