//! Groups of labels: labels that share a material, each with a base colour of its own where that is wanted.
//!
//! A figure of 10⁵ labels has few materials and many colours: glass for these cells, skin for that organ, a colour for each. A group holds
//! its material once and its labels in columns, 20 bytes a label. Copies of a scene share the columns, because a live view copies its scene
//! at each move of the camera.

use std::collections::BTreeSet;
use std::ops::Deref;
use std::sync::Arc;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::{Material, SceneError};

/// Labels that share a material.
#[derive(Clone, Debug)]
pub struct LabelGroup {
    /// Material of the labels; where they have colours, these replace its base colour.
    pub material: Material,
    members: Arc<Members>,
}

/// The labels of a group, in rising order, and their colours. The ids are apart, so that a copy with other colours shares them.
#[derive(Clone, Debug, Default, PartialEq)]
struct Members {
    ids: Arc<Vec<u64>>,
    /// One for each label, or none.
    colors: Vec<[f32; 3]>,
}

impl LabelGroup {
    /// A group of these labels, in any order. `colors` are linear Rec. 709, one for each label in the same order, or none.
    ///
    /// # Errors
    /// [`SceneError::Field`] with the field `labels` or `colors`: a label that occurs twice, a list of another length, a colour that is
    /// not from 0 to 1.
    pub fn new(material: Material, ids: Vec<u64>, colors: Vec<[f32; 3]>) -> Result<Self, SceneError> {
        if !colors.is_empty() && colors.len() != ids.len() {
            let problem =
                format!("expected one color for each of {} labels, got {}", ids.len(), colors.len());
            return Err(fault("colors", problem));
        }
        check_colors(&colors)?;
        let members = if ids.is_sorted() {
            Members { ids: Arc::new(ids), colors }
        } else {
            let mut order: Vec<usize> = (0..ids.len()).collect();
            order.sort_by_key(|&place| ids[place]);
            Members {
                ids: Arc::new(order.iter().map(|&place| ids[place]).collect()),
                colors: order.iter().filter_map(|&place| colors.get(place).copied()).collect(),
            }
        };
        match members.ids.windows(2).find(|pair| pair[0] == pair[1]) {
            Some(twice) => Err(fault("labels", format!("label {} occurs twice", twice[0]))),
            None => Ok(Self { material, members: Arc::new(members) }),
        }
    }

    /// Ids of its labels, in rising order.
    pub fn ids(&self) -> &[u64] {
        &self.members.ids
    }

    /// Base colours of its labels, linear Rec. 709, in the same order; empty where all have the material's own.
    pub fn colors(&self) -> &[[f32; 3]] {
        &self.members.colors
    }

    /// For each label that a volume has, its dense index and its base colour: the label's own, or the material's. `ids` are the volume's
    /// ids in rising order.
    pub fn among<'a>(&'a self, ids: &'a [u64]) -> impl Iterator<Item = (usize, [f32; 3])> + 'a {
        let color = |place: usize| self.colors().get(place).copied().unwrap_or(self.material.base_color);
        each_place_in(self.ids(), ids).map(move |(place, dense)| (dense, color(place)))
    }

    /// Whether both groups have the same labels with the same colours.
    pub fn same_labels(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.members, &other.members) || self.members == other.members
    }
}

impl PartialEq for LabelGroup {
    fn eq(&self, other: &Self) -> bool {
        self.material == other.material && self.same_labels(other)
    }
}

/// The groups of a volume's labels; no label is in two of them.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[serde(transparent)]
pub struct LabelGroups(Vec<LabelGroup>);

impl Deref for LabelGroups {
    type Target = [LabelGroup];

    fn deref(&self) -> &[LabelGroup] {
        &self.0
    }
}

impl LabelGroups {
    /// Groups that have no label in common.
    ///
    /// # Errors
    /// [`SceneError::Field`] with the field `groups` names a label that is in two of them.
    pub fn new(groups: Vec<LabelGroup>) -> Result<Self, SceneError> {
        let mut seen = BTreeSet::new();
        let twice = groups.iter().flat_map(LabelGroup::ids).find(|id| groups.len() > 1 && !seen.insert(**id));
        match twice {
            Some(id) => Err(fault("groups", format!("label {id} is in two groups"))),
            None => Ok(Self(groups)),
        }
    }

    /// Groups from columns: label `ids[i]`, in rising order, belongs to group `of[i]` and has the color `colors[i]` (linear Rec. 709; alpha is
    /// ignored). Each material comes with whether colours of labels replace its base colour. Labels of a group past the last belong to none.
    ///
    /// # Errors
    /// [`SceneError::Field`] names a column of another length, ids that do not rise, or a colour that is no number from 0 to 1.
    pub fn from_columns(
        materials: &[(Material, bool)],
        ids: &[u64],
        of: &[u32],
        colors: &[[f32; 4]],
    ) -> Result<Self, SceneError> {
        check_lengths(ids, &[("groups", of.len()), ("colors", colors.len())])?;
        check_colors(colors)?;
        check_rising(ids)?;
        let mut counts = vec![0; materials.len()];
        for group in of {
            if let Some(count) = counts.get_mut(*group as usize) {
                *count += 1;
            }
        }
        let room = counts.iter().zip(materials).map(|(&count, (_, by_label))| {
            (Vec::with_capacity(count), Vec::with_capacity(if *by_label { count } else { 0 }))
        });
        let mut members: Vec<(Vec<u64>, Vec<[f32; 3]>)> = room.collect();
        for ((id, group), color) in ids.iter().zip(of).zip(colors) {
            if let (Some((own_ids, own_colors)), Some((_, by_label))) =
                (members.get_mut(*group as usize), materials.get(*group as usize))
            {
                own_ids.push(*id);
                if *by_label {
                    own_colors.push([color[0], color[1], color[2]]);
                }
            }
        }
        // Rising ids are in order and occur once, so nothing of a group is left to check.
        let groups = materials.iter().zip(members).map(|((material, _), (ids, colors))| LabelGroup {
            material: *material,
            members: Arc::new(Members { ids: Arc::new(ids), colors }),
        });
        Ok(Self(groups.collect()))
    }

    /// The same groups, in which label `ids[i]`, in rising order, has the color `colors[i]` (linear Rec. 709; alpha is ignored). Labels of a
    /// group without colours keep the color of its material. What does not change is shared with these groups.
    ///
    /// # Errors
    /// [`SceneError::Field`] names a column of another length, ids that do not rise, a label that is in no group, or a colour that is no
    /// number from 0 to 1.
    pub fn with_colors(&self, ids: &[u64], colors: &[[f32; 4]]) -> Result<Self, SceneError> {
        check_lengths(ids, &[("colors", colors.len())])?;
        check_colors(colors)?;
        check_rising(ids)?;
        let mut is_found = vec![false; ids.len()];
        let mut groups = self.0.clone();
        for (group, former) in groups.iter_mut().zip(&self.0) {
            for (place, member) in each_place_in(ids, former.ids()) {
                is_found[place] = true;
                if !former.colors().is_empty() {
                    let [red, green, blue, _] = colors[place];
                    Arc::make_mut(&mut group.members).colors[member] = [red, green, blue];
                }
            }
        }
        match is_found.iter().position(|is_found| !is_found) {
            None => Ok(Self(groups)),
            Some(place) => {
                Err(fault(&format!("ids[{place}]"), format!("label {} is in no group", ids[place])))
            }
        }
    }

    /// The material of a group, to change it; `None` past the last group.
    pub fn material_mut(&mut self, group: usize) -> Option<&mut Material> {
        Some(&mut self.0.get_mut(group)?.material)
    }
}

fn fault(field: &str, problem: String) -> SceneError {
    SceneError::Field { field: field.into(), problem }
}

/// Checks that each column, by its name and length, has a value for each label.
fn check_lengths(ids: &[u64], columns: &[(&str, usize)]) -> Result<(), SceneError> {
    match columns.iter().find(|(_, length)| *length != ids.len()) {
        None => Ok(()),
        Some((column, length)) => {
            Err(fault(column, format!("expected one value for each of {} labels, got {length}", ids.len())))
        }
    }
}

fn check_rising(ids: &[u64]) -> Result<(), SceneError> {
    if ids.is_sorted_by(|a, b| a < b) { Ok(()) } else { Err(fault("ids", "expected rising ids".into())) }
}

/// Checks the first three numbers of each colour.
fn check_colors<const N: usize>(colors: &[[f32; N]]) -> Result<(), SceneError> {
    let is_color = |color: &[f32; N]| color.iter().take(3).all(|c| (0.0..=1.0).contains(c));
    match colors.iter().position(|color| !is_color(color)) {
        None => Ok(()),
        Some(place) => {
            Err(fault(&format!("colors[{place}]"), format!("expected 0 to 1, got {:?}", &colors[place][..3])))
        }
    }
}

/// The JSON form of a group.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct GroupFields<L, C> {
    material: Material,
    labels: L,
    #[serde(default)]
    colors: C,
}

impl Serialize for LabelGroup {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        GroupFields { material: self.material, labels: self.ids(), colors: self.colors() }.serialize(to)
    }
}

impl<'de> Deserialize<'de> for LabelGroups {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let read: Vec<GroupFields<Vec<u64>, Vec<[f32; 3]>>> = Vec::deserialize(from)?;
        let groups = read.into_iter().enumerate().map(|(i, fields)| {
            let group = LabelGroup::new(fields.material, fields.labels, fields.colors);
            group.map_err(|fault| serde::de::Error::custom(format!("groups[{i}].{fault}")))
        });
        Self::new(groups.collect::<Result<_, _>>()?).map_err(serde::de::Error::custom)
    }
}

/// For each of `wanted` that is among `ids`, its place in `wanted` and its place in `ids`; both lists rise. One pass over both, or a search
/// for each where few are wanted.
pub(crate) fn each_place_in<'a>(
    wanted: &'a [u64],
    ids: &'a [u64],
) -> impl Iterator<Item = (usize, usize)> + 'a {
    let few = wanted.len() < ids.len() / 16;
    let mut next = 0;
    wanted.iter().enumerate().filter_map(move |(place, id)| {
        let rest = &ids[next..];
        let ahead = if few {
            rest.partition_point(|other| other < id)
        } else {
            rest.iter().position(|other| other >= id).unwrap_or(rest.len())
        };
        next += ahead;
        (ids.get(next) == Some(id)).then_some((place, next))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const RED: [f32; 3] = [1.0, 0.0, 0.0];
    const BLUE: [f32; 3] = [0.0, 0.0, 1.0];
    const LARGE: u64 = u64::MAX;

    fn group(ids: &[u64], colors: &[[f32; 3]]) -> Result<LabelGroup, SceneError> {
        LabelGroup::new(Material::DEFAULT, ids.to_vec(), colors.to_vec())
    }

    #[test]
    fn labels_and_their_colors_are_sorted_together() {
        let group = group(&[9, 3, LARGE], &[RED, BLUE, RED]).unwrap();
        assert_eq!(group.ids(), [3, 9, LARGE]);
        assert_eq!(group.colors(), [BLUE, RED, RED]);
        let found: Vec<_> = group.among(&[1, 9, 10, LARGE]).collect();
        assert_eq!(found, [(1, RED), (3, RED)]);
        let plain: Vec<_> =
            super::LabelGroup::new(Material::DEFAULT, vec![9], vec![]).unwrap().among(&[9]).collect();
        assert_eq!(plain, [(0, Material::DEFAULT.base_color)]);
    }

    #[test]
    fn what_has_two_meanings_is_refused() {
        let problem = |made: Result<LabelGroup, SceneError>| made.unwrap_err().to_string();
        assert_eq!(problem(group(&[4, 3, 4], &[])), "labels: label 4 occurs twice");
        assert_eq!(problem(group(&[4, 3], &[RED])), "colors: expected one color for each of 2 labels, got 1");
        assert_eq!(
            problem(group(&[4], &[[0.0, f32::NAN, 0.0]])),
            "colors[0]: expected 0 to 1, got [0.0, NaN, 0.0]"
        );
        let two = LabelGroups::new(vec![group(&[1, 2], &[]).unwrap(), group(&[2], &[]).unwrap()]);
        assert_eq!(two.unwrap_err().to_string(), "groups: label 2 is in two groups");
    }

    #[test]
    fn columns_give_the_groups_that_lists_give() {
        let other = Material { roughness: 0.1, ..Material::DEFAULT };
        let [r, b] = [RED, BLUE].map(|[r, g, b]| [r, g, b, 0.5]);
        let materials = [(Material::DEFAULT, true), (other, false)];
        let made =
            LabelGroups::from_columns(&materials, &[2, 5, 7, 8], &[0, 1, 0, 9], &[r, r, b, b]).unwrap();
        let listed = LabelGroups::new(vec![
            group(&[2, 7], &[RED, BLUE]).unwrap(),
            LabelGroup::new(other, vec![5], vec![]).unwrap(),
        ]);
        assert_eq!(made, listed.unwrap());
        let problem = |ids: &[u64], of: &[u32], colors: &[[f32; 4]]| {
            LabelGroups::from_columns(&materials, ids, of, colors).unwrap_err().to_string()
        };
        assert_eq!(problem(&[2, 5], &[0], &[r, r]), "groups: expected one value for each of 2 labels, got 1");
        assert_eq!(problem(&[2, 5], &[0, 0], &[r]), "colors: expected one value for each of 2 labels, got 1");
        assert_eq!(problem(&[5, 2], &[0, 0], &[r, r]), "ids: expected rising ids");
    }

    #[test]
    fn other_colors_give_the_groups_of_changed_columns() {
        let materials = [(Material::DEFAULT, true), (Material::DEFAULT, false), (Material::DEFAULT, true)];
        // Most labels are in the first group, which is then searched; the others are passed.
        let ids: Vec<u64> = (0..400).map(|i| 3 * i + 1).chain([LARGE]).collect();
        let of: Vec<u32> = (0..401).map(|i| if i % 40 == 7 { 1 } else { 2 * u32::from(i == 400) }).collect();
        let grey: Vec<[f32; 4]> = (0u8..=200).cycle().take(401).map(|i| [f32::from(i) / 255.0; 4]).collect();
        let made = LabelGroups::from_columns(&materials, &ids, &of, &grey).unwrap();
        for rows in [vec![], vec![0], vec![7, 8], vec![3, 200, 400], (0..401).collect()] {
            let (mut all, some): (_, Vec<u64>) =
                (grey.clone(), rows.iter().map(|&row: &usize| ids[row]).collect());
            let colors: Vec<[f32; 4]> =
                (0u8..=100).cycle().take(some.len()).map(|i| [0.0, f32::from(i) / 100.0, 1.0, 0.5]).collect();
            for (&row, color) in rows.iter().zip(&colors) {
                all[row] = *color;
            }
            let expected = LabelGroups::from_columns(&materials, &ids, &of, &all).unwrap();
            let changed = made.with_colors(&some, &colors).unwrap();
            assert_eq!(changed, expected, "{rows:?}");
            // Negative control: one label keeps its colour.
            if let Some(last) = rows.iter().rev().find(|row| of[**row] != 1) {
                all[*last] = [0.99; 4];
                assert_ne!(changed, LabelGroups::from_columns(&materials, &ids, &of, &all).unwrap());
            }
        }
        let one = made.with_colors(&[4], &[[1.0; 4]]).unwrap();
        assert!(!one[0].same_labels(&made[0]) && Arc::ptr_eq(&one[2].members, &made[2].members));
        assert!(Arc::ptr_eq(&one[0].members.ids, &made[0].members.ids), "labels are shared");
    }

    #[test]
    fn other_colors_of_labels_that_are_in_no_group_are_refused() {
        let made = LabelGroups::new(vec![group(&[3, 9], &[RED, BLUE]).unwrap()]).unwrap();
        let problem =
            |ids: &[u64], colors: &[[f32; 4]]| made.with_colors(ids, colors).unwrap_err().to_string();
        assert_eq!(problem(&[3, 5], &[[0.0; 4]; 2]), "ids[1]: label 5 is in no group");
        assert_eq!(problem(&[9, 3], &[[0.0; 4]; 2]), "ids: expected rising ids");
        assert_eq!(problem(&[3], &[]), "colors: expected one value for each of 1 labels, got 0");
        assert_eq!(problem(&[3], &[[2.0; 4]]), "colors[0]: expected 0 to 1, got [2.0, 2.0, 2.0]");
    }

    #[test]
    fn the_json_form_gives_back_every_bit() {
        let groups = LabelGroups::new(vec![
            group(&[1, LARGE], &[[0.1, 0.2, 0.3], BLUE]).unwrap(),
            group(&[4], &[]).unwrap(),
        ])
        .unwrap();
        let text = serde_json::to_string(&groups).unwrap();
        assert_eq!(serde_json::from_str::<LabelGroups>(&text).unwrap(), groups);
        let fault =
            serde_json::from_str::<LabelGroups>(r#"[{"material": {}, "labels": [1, 1]}]"#).unwrap_err();
        assert!(fault.to_string().starts_with("groups[0].labels: label 1 occurs twice"), "{fault}");
    }

    #[test]
    fn places_are_found_however_many_are_wanted() {
        let ids: Vec<u64> = (0..1000).map(|i| 3 * i).collect();
        for step in [1, 2, 50, 700] {
            let wanted: Vec<u64> = (0..3100).step_by(step).collect();
            let found: Vec<_> = each_place_in(&wanted, &ids).collect();
            let expected: Vec<_> = wanted
                .iter()
                .enumerate()
                .filter(|(_, id)| **id % 3 == 0 && **id < 3000)
                .map(|(place, id)| (place, (*id / 3) as usize))
                .collect();
            assert_eq!(found, expected, "every {step}th");
        }
    }
}
