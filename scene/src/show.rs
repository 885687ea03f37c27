//! Which labels of a volume are drawn.

use serde::{Deserialize, Serialize};

use crate::SceneError;
use crate::label_groups::each_place_in;

/// Which labels of a volume are drawn. The order of ids has no meaning, and repeated ids count once.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Show {
    /// All except the background (0).
    #[default]
    All,
    /// Only these ids.
    Only(Vec<u64>),
    /// All except these ids.
    Except(Vec<u64>),
}

impl Show {
    /// Whether each label is drawn, by dense index. `ids` are the volume's ids in rising order (their positions are the dense indices);
    /// `field` is the path of this choice in the scene, such as `instances[0].style.show`. The volume may lack ids of [`Show::Except`],
    /// so that one list serves many crops.
    ///
    /// # Errors
    /// [`SceneError::Field`] names the first id of [`Show::Only`] that the volume lacks: a figure in which a label is silently missing
    /// would be wrong.
    pub fn resolve(&self, field: &str, ids: &[u64]) -> Result<Vec<bool>, SceneError> {
        self.check(field, ids)?;
        Ok(self.among(ids))
    }

    /// Checks as [`Show::resolve`] does, without a list of all labels: live views check at each edit.
    ///
    /// # Errors
    /// As [`Show::resolve`].
    pub fn check(&self, field: &str, ids: &[u64]) -> Result<(), SceneError> {
        if let Self::Only(named) = self {
            // Sorted lists are compared in one pass.
            if named.is_sorted_by(|a, b| a < b) && each_place_in(named, ids).count() == named.len() {
                return Ok(());
            }
            for (i, &id) in named.iter().enumerate() {
                if ids.binary_search(&id).is_ok() {
                    continue;
                }
                let problem = match (id, ids) {
                    (0, _) => "0 is the background, which is not drawn".into(),
                    (id, [first, .., last]) => format!(
                        "the volume has no label {id}; its {} labels are within {first} to {last}",
                        ids.len()
                    ),
                    (id, [only]) => format!("the volume has no label {id}; its only label is {only}"),
                    (id, []) => format!("the volume has no label {id}, nor any other"),
                };
                return Err(SceneError::Field { field: format!("{field}.only[{i}]"), problem });
            }
        }
        Ok(())
    }

    /// Whether each of `ids`, in rising order, is drawn. Named ids that are not in `ids` are ignored: this chooses what to read from a
    /// volume before its scene is checked.
    pub fn among(&self, ids: &[u64]) -> Vec<bool> {
        let unless_named = self.visible_unless_named();
        let mut visible = vec![unless_named; ids.len()];
        let named = self.named();
        if named.is_sorted() {
            each_place_in(named, ids).for_each(|(_, dense)| visible[dense] = !unless_named);
        } else {
            let places = named.iter().filter_map(|id| ids.binary_search(id).ok());
            places.for_each(|dense| visible[dense] = !unless_named);
        }
        visible
    }

    /// The choice in which each id is drawn whose flag is set; it lists the fewer: those drawn or those hidden.
    ///
    /// # Errors
    /// [`SceneError::Field`] if there is not one flag for each id.
    pub fn from_flags(
        ids: impl ExactSizeIterator<Item = u64> + Clone,
        flags: impl ExactSizeIterator<Item = bool> + Clone,
    ) -> Result<Self, SceneError> {
        if ids.len() != flags.len() {
            let problem = format!("expected one flag for each of {} labels, got {}", ids.len(), flags.len());
            return Err(SceneError::Field { field: "visible".into(), problem });
        }
        let labels = ids.len();
        let drawn = flags.clone().filter(|flag| *flag).count();
        let listed =
            |which: bool| ids.zip(flags).filter(|(_, flag)| *flag == which).map(|(id, _)| id).collect();
        Ok(match labels - drawn {
            0 => Self::All,
            hidden if hidden > drawn => Self::Only(listed(true)),
            _ => Self::Except(listed(false)),
        })
    }

    /// The listed ids, whether of [`Show::Only`] or [`Show::Except`].
    pub fn named(&self) -> &[u64] {
        match self {
            Self::All => &[],
            Self::Only(list) | Self::Except(list) => list,
        }
    }

    /// Whether two choices draw the same labels of any volume.
    pub fn same_labels(&self, other: &Self) -> bool {
        let set = |show: &Self| {
            let mut ids = show.named().to_vec();
            ids.sort_unstable();
            ids.dedup();
            ids
        };
        // Lists are long and usually equal, so compare them directly before sorting.
        self == other
            || self.visible_unless_named() == other.visible_unless_named() && set(self) == set(other)
    }

    pub(crate) fn visible_unless_named(&self) -> bool {
        !matches!(self, Self::Only(_))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const IDS: [u64; 4] = [3, 17, 1 << 40, u64::MAX];

    #[test]
    fn shows_what_is_named() {
        let visible = |show: Show| show.resolve("show", &IDS).unwrap();
        assert_eq!(visible(Show::All), [true; 4]);
        assert_eq!(visible(Show::Only(vec![])), [false; 4]);
        assert_eq!(visible(Show::Except(vec![])), [true; 4]);
        assert_eq!(visible(Show::Only(vec![u64::MAX, 3, 3])), [true, false, false, true]);
        assert_eq!(visible(Show::Except(vec![1 << 40])), [true, true, false, true]);
        assert_eq!(Show::All.resolve("show", &[]).unwrap(), [] as [bool; 0]);
    }

    #[test]
    fn flags_are_listed_by_the_shorter_list() {
        let of = |flags: [bool; 4]| Show::from_flags(IDS.into_iter(), flags.into_iter()).unwrap();
        assert_eq!(of([true; 4]), Show::All);
        assert_eq!(of([false; 4]), Show::Only(vec![]));
        assert_eq!(of([false, true, false, false]), Show::Only(vec![17]));
        assert_eq!(of([false, true, true, true]), Show::Except(vec![3]));
        for flags in (0..16).map(|bits: u8| [0, 1, 2, 3].map(|i| bits >> i & 1 == 1)) {
            assert_eq!(of(flags).resolve("show", &IDS).unwrap(), flags);
        }
        let problem = Show::from_flags(IDS.into_iter(), [true].into_iter()).unwrap_err().to_string();
        assert_eq!(problem, "visible: expected one flag for each of 4 labels, got 1");
    }

    #[test]
    fn names_an_id_that_the_volume_lacks() {
        let problem =
            |show: Show, ids: &[u64]| show.resolve("instances[2].style.show", ids).unwrap_err().to_string();
        assert_eq!(
            problem(Show::Only(vec![3, 4]), &IDS),
            "instances[2].style.show.only[1]: the volume has no label 4; its 4 labels are within 3 to 18446744073709551615"
        );
        assert_eq!(
            problem(Show::Only(vec![9]), &[8]),
            "instances[2].style.show.only[0]: the volume has no label 9; its only label is 8"
        );
        assert_eq!(
            problem(Show::Only(vec![9]), &[]),
            "instances[2].style.show.only[0]: the volume has no label 9, nor any other"
        );
        assert_eq!(
            problem(Show::Only(vec![0]), &IDS),
            "instances[2].style.show.only[0]: 0 is the background, which is not drawn"
        );
        assert_eq!(
            Show::Except(vec![9]).resolve("show", &[8]).unwrap(),
            [true],
            "lists of hidden labels serve many crops"
        );
        // Ids are compared in all 64 bits: one that equals another only in its lower 32 bits is a different id.
        assert!(Show::Only(vec![(1 << 32) + 3]).resolve("show", &IDS).is_err());
    }

    #[test]
    fn the_same_labels_however_they_are_listed() {
        let only = |ids: &[u64]| Show::Only(ids.to_vec());
        let except = |ids: &[u64]| Show::Except(ids.to_vec());
        assert!(only(&[1, 2]).same_labels(&only(&[2, 1, 2])));
        assert!(Show::All.same_labels(&except(&[])));
        assert!(!only(&[1, 2]).same_labels(&only(&[1, 3])));
        assert!(!only(&[1]).same_labels(&except(&[1])));
        assert!(!only(&[]).same_labels(&Show::All));
    }
}
