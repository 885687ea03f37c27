//! CPU time of the processes that this one has started and waited for.

/// Seconds of user and system time of all finished children and their finished children; `None` where the system has no `/proc`.
///
/// `/proc/self/stat`, fields 16 and 17 (proc_pid_stat(5)), in ticks: 100 a second on every Linux that Rust's toolchain runs on.
pub(crate) fn of_children() -> Option<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    // The second field is the program's name in parentheses and may hold anything: count from behind it.
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    let ticks = |field: usize| fields.get(field - 3)?.parse::<f64>().ok();
    Some((ticks(16)? + ticks(17)?) / 100.0)
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn a_busy_child_counts_when_it_has_ended() {
        let before = of_children().unwrap();
        let burn = "i=0; while [ $i -lt 200000 ]; do i=$((i+1)); done";
        assert!(std::process::Command::new("sh").args(["-c", burn]).status().unwrap().success());
        assert!(of_children().unwrap() > before);
    }
}
