//! Tests that take turns by day.

/// Chooses one of several equivalent things. `PUMICE_TEST_SHARE` (`K/N`) selects it and changes daily; `full` selects all, and without the
/// variable it is the first.
pub(crate) fn of_today<T: Clone>(things: &[T]) -> Vec<T> {
    some_of_today(things, things.len())
}

/// Chooses those of several things whose turn it is: each has its turn in as many days. As [`of_today`], `full` selects all.
pub(crate) fn some_of_today<T: Clone>(things: &[T], days: usize) -> Vec<T> {
    let share = std::env::var("PUMICE_TEST_SHARE").unwrap_or_default();
    if share == "full" {
        return things.to_vec();
    }
    let turn: usize = share.split('/').next().and_then(|k| k.parse().ok()).unwrap_or(0);
    things.iter().skip(turn % days).step_by(days).cloned().collect()
}
