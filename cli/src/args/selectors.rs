//! Labels as options name them: by ids, names and queries.

use pumice_session::figure::Selector;

/// The labels of one option.
#[derive(Clone, Debug)]
pub(crate) struct Selectors(Vec<Selector>);

/// Parses selectors that are separated by commas.
///
/// # Errors
/// Says which is none.
pub(crate) fn selectors(text: &str) -> Result<Selectors, String> {
    Selector::parse_list(text).map(Selectors)
}

/// Labels by id, where nothing but ids is named: of a .pumice file, other labels are then not read.
pub(crate) fn ids(lists: &[Selectors]) -> Option<Vec<u64>> {
    let ids = lists.iter().flat_map(|list| &list.0).map(Selector::id).collect::<Option<Vec<u64>>>()?;
    (!ids.is_empty()).then_some(ids)
}

/// What is named besides [`ids`]: all of it, where any is no id.
pub(crate) fn all_but_ids(lists: &[Selectors]) -> Vec<Selector> {
    if ids(lists).is_some() { Vec::new() } else { lists.iter().flat_map(|list| list.0.clone()).collect() }
}
