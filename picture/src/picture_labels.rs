//! The labels that a picture shows: what the numbers of its label pass stand for, so that a picture alone tells ids, names and types.
//!
//! ```text
//! label pass, instance pass      one pixel: row 41 of instance 2
//! Picture::labels                instance 2: rows  3   41                   rising; only rows that some pixel shows
//!                                            ids   17  98340797
//!                                            names "" "PV 12"               empty where no label has one; types likewise
//! ```
//! In an OpenEXR file the table is the attribute `pumiceLabels`, JSON in ASCII. It has a row for each label that is seen, not one for each
//! label of the volume. A file whose table does not fit its passes is refused where a pixel is asked for.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use pumice_core::CompressedVolume;
use pumice_scene::Scene;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::picture::Picture;

/// Name of the EXR attribute that holds the table.
pub(crate) const LABELS_KEY: &str = "pumiceLabels";

/// The labels of one instance that a picture shows, as columns.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InstanceLabels {
    /// Id of the instance in the scene.
    pub instance: u32,
    /// Rows of the label table plus 1, rising, as the label pass has them.
    pub rows: Vec<u32>,
    /// Id of each label.
    pub ids: Vec<u64>,
    /// Name of each label, empty where it has none; an empty list where no label has a name.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub names: Vec<String>,
    /// Type of each label, likewise.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub types: Vec<String>,
}

/// A label under a pixel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SeenInPicture<'a> {
    /// Id of the instance.
    pub instance: u32,
    /// Dense index of the label in the label table.
    pub row: u32,
    /// Id of the label.
    pub id: u64,
    /// Name of the label; empty if it has none.
    pub name: &'a str,
    /// Type of the label; empty if it has none.
    pub label_type: &'a str,
}

impl InstanceLabels {
    /// The label with a number of the label pass.
    fn find(&self, row: u32) -> Option<SeenInPicture<'_>> {
        let at = self.rows.binary_search(&row).ok()?;
        Some(SeenInPicture {
            instance: self.instance,
            row: row - 1,
            id: self.ids[at],
            name: self.names.get(at).map_or("", String::as_str),
            label_type: self.types.get(at).map_or("", String::as_str),
        })
    }

    /// Whether the columns fit each other.
    fn is_sound(&self) -> bool {
        let n = self.rows.len();
        let fits = |column: &[String]| column.is_empty() || column.len() == n;
        let rising = self.rows.windows(2).all(|pair| pair[0] < pair[1]);
        self.ids.len() == n
            && fits(&self.names)
            && fits(&self.types)
            && rising
            && self.rows.first() != Some(&0)
    }
}

/// Parses the attribute of a file.
pub(crate) fn labels_of(text: &[u8]) -> Result<Vec<InstanceLabels>, String> {
    let labels: Vec<InstanceLabels> = serde_json::from_slice(text).map_err(|e| e.to_string())?;
    match labels.iter().find(|l| !l.is_sound()) {
        Some(odd) => {
            Err(format!("instance {}: expected columns of one length, with rising rows", odd.instance))
        }
        None => Ok(labels),
    }
}

/// Makes the instance pass of a picture name instances by their ids, and lists the labels that the picture shows. Before, `instance` holds
/// for each pixel the position of its instance in the scene; it stays only where the scene has several instances.
pub fn name_labels(picture: &mut Picture, scene: &Scene, volumes: &[Arc<CompressedVolume>]) {
    let Some(label) = &picture.label else { return };
    let positions = picture.instance.take().unwrap_or_else(|| vec![0; label.len()]);
    let mut seen: BTreeMap<u32, BTreeSet<u32>> = BTreeMap::new();
    let mut last = (u32::MAX, 0);
    for (&position, &row) in positions.iter().zip(label) {
        // Neighbours mostly show one label.
        if row != 0 && (position, row) != last {
            last = (position, row);
            seen.entry(position).or_default().insert(row);
        }
    }
    let of = |position: u32| Some((scene.instances.get(position as usize)?, volumes.get(position as usize)?));
    let listed = seen.into_iter().filter_map(|(position, rows)| {
        let (instance, volume) = of(position)?;
        Some(listed(instance.id, volume, rows.into_iter().collect()))
    });
    picture.labels = listed.collect();
    if scene.instances.len() > 1 {
        let id = |(&position, &row): (&u32, &u32)| match of(position) {
            Some((instance, _)) if row != 0 => instance.id,
            _ => 0,
        };
        picture.instance = Some(positions.iter().zip(label).map(id).collect());
    }
}

fn listed(instance: u32, volume: &CompressedVolume, rows: Vec<u32>) -> InstanceLabels {
    let table = volume.labels();
    let rows: Vec<u32> = rows.into_iter().filter(|&row| row as usize <= table.len()).collect();
    let column = |text: &dyn Fn(u32) -> Option<String>| {
        let texts: Vec<String> = rows.iter().map(|row| text(row - 1).unwrap_or_default()).collect();
        if texts.iter().all(String::is_empty) { Vec::new() } else { texts }
    };
    InstanceLabels {
        instance,
        ids: rows.iter().map(|&row| table.ids()[row as usize - 1]).collect(),
        names: column(&|label| volume.note(label)?.name.clone()),
        types: column(&|label| table.type_names().get(usize::from(table.type_of(label)?)).cloned()),
        rows,
    }
}

impl Picture {
    /// The label under a pixel, counted from the upper left; `None` where there is none.
    ///
    /// # Errors
    /// One line: the pixel is outside, or the picture lacks the label pass or the table of its labels.
    pub fn label_at(&self, x: u32, y: u32) -> Result<Option<SeenInPicture<'_>>, String> {
        let (width, height) = (self.color.width, self.color.height);
        if x as usize >= width || y as usize >= height {
            return Err(format!(
                "pixel {x},{y}: expected x below {width} and y below {height}, counted from the upper left"
            ));
        }
        self.finder()?(y as usize * width + x as usize)
    }

    /// The id of the label of each pixel, 0 where there is none.
    ///
    /// # Errors
    /// As [`Picture::label_at`].
    pub fn label_ids(&self) -> Result<Vec<u64>, String> {
        self.of_each_label(|seen| seen.id)
    }

    /// The id of the instance of each pixel's label, 0 where there is none.
    ///
    /// # Errors
    /// As [`Picture::label_at`].
    pub fn instance_ids(&self) -> Result<Vec<u32>, String> {
        self.of_each_label(|seen| seen.instance)
    }

    fn of_each_label<T: Default + Send>(
        &self,
        of: impl Fn(SeenInPicture<'_>) -> T + Sync,
    ) -> Result<Vec<T>, String> {
        let find = self.finder()?;
        let one = |pixel| Ok(find(pixel)?.map_or_else(T::default, &of));
        (0..self.color.pixels.len()).into_par_iter().map(one).collect()
    }

    /// A function that finds the label of a pixel, which is within the picture.
    fn finder<'a>(
        &'a self,
    ) -> Result<impl Fn(usize) -> Result<Option<SeenInPicture<'a>>, String> + Sync, String> {
        let label = self.label.as_ref().ok_or(
            "the picture has no label pass: expected channel label.index of an .exr that was rendered with --passes all or label",
        )?;
        if self.instance.is_none() && self.labels.len() > 1 {
            let several = self.labels.len();
            return Err(format!(
                "the picture shows labels of {several} instances, but has no channel label.instance"
            ));
        }
        let by_instance: BTreeMap<u32, &InstanceLabels> =
            self.labels.iter().map(|l| (l.instance, l)).collect();
        Ok(move |pixel: usize| {
            let row = label[pixel];
            if row == 0 {
                return Ok(None);
            }
            let table = match &self.instance {
                Some(instance) => by_instance.get(&instance[pixel]).copied(),
                None => self.labels.first(),
            };
            table.and_then(|table| table.find(row)).map(Some).ok_or_else(|| {
                format!(
                    "the picture has no id for row {row} of its label pass: an older pumice wrote it, or another program changed it; render it \
                     again with --again"
                )
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Image, Passes, read_exr, sample_pictures, write_exr};

    fn labels(instance: u32, rows: &[u32], ids: &[u64]) -> InstanceLabels {
        InstanceLabels { instance, rows: rows.into(), ids: ids.into(), ..InstanceLabels::default() }
    }

    /// Four pixels: nothing, row 3 of instance 9, row 3 of instance 0, row 5 of instance 0.
    fn two_instances() -> Picture {
        Picture {
            label: Some(vec![0, 3, 3, 5]),
            instance: Some(vec![0, 9, 0, 0]),
            labels: vec![labels(9, &[1, 3], &[7, u64::MAX]), labels(0, &[3, 5], &[16_777_217, 1 << 53 | 1])],
            ..Picture::of(Image::new(2, 2, vec![[0.0; 3]; 4]))
        }
    }

    #[test]
    fn each_pixel_tells_the_exact_id_of_its_own_instance() {
        let picture = two_instances();
        assert_eq!(picture.label_ids().unwrap(), [0, u64::MAX, 16_777_217, (1 << 53) + 1]);
        assert_eq!(picture.instance_ids().unwrap(), [0, 9, 0, 0]);
        let seen = picture.label_at(1, 0).unwrap().unwrap();
        assert_eq!((seen.instance, seen.row, seen.id, seen.name), (9, 2, u64::MAX, ""));
        assert_eq!(picture.label_at(0, 0), Ok(None));
        let outside = picture.label_at(2, 0).unwrap_err();
        assert!(outside.starts_with("pixel 2,0: expected x below 2 and y below 2"), "{outside}");
    }

    #[test]
    fn what_cannot_be_told_is_refused_and_never_guessed() {
        let whole = two_instances();
        let without_pass = Picture { label: None, ..whole.clone() };
        let without_instances = Picture { instance: None, ..whole.clone() };
        let without_table = Picture { labels: Vec::new(), ..whole.clone() };
        let of_another = Picture { labels: vec![labels(9, &[3], &[1]), labels(0, &[3], &[2])], ..whole };
        for (picture, said) in [
            (without_pass, "no label pass"),
            (without_instances, "labels of 2 instances"),
            (without_table, "no id for row 3"),
            (of_another, "no id for row 5"),
        ] {
            let error = picture.label_ids().unwrap_err();
            assert!(error.contains(said) && !error.contains('\n'), "{error}");
        }
    }

    #[test]
    fn tables_whose_columns_do_not_fit_are_refused() {
        let text = |table: &InstanceLabels| serde_json::to_vec(&[table]).unwrap();
        let sound = labels(1, &[1, 4], &[5, 6]);
        assert_eq!(labels_of(&text(&sound)), Ok(vec![sound.clone()]));
        let names = InstanceLabels { names: vec!["a".into()], ..sound };
        for odd in [labels(1, &[4, 1], &[5, 6]), labels(1, &[0, 1], &[5, 6]), labels(1, &[1], &[]), names] {
            assert!(labels_of(&text(&odd)).unwrap_err().starts_with("instance 1: expected columns"));
        }
        assert!(labels_of(b"[{}]").is_err() && labels_of(b"").is_err());
    }

    /// The table belongs to the pass: neither is in a file without the other.
    #[test]
    fn a_file_without_the_label_pass_has_no_table() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        write_exr(&path, &sample_pictures::picture(3, 3), &Passes::NONE).unwrap();
        let back = read_exr(&path).unwrap();
        assert_eq!((back.labels, back.instance), (Vec::new(), None));
    }
}
