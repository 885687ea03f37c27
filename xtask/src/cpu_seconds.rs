//! CPU time of a process that has ended but has not been waited for.
//!
//! In `/proc/PID/stat` (proc_pid_stat(5)), field 3 is the state, which is `Z` between end and wait. Fields 14 and 15 are user and system
//! time, and 16 and 17 those of children that the process has waited for, in ticks: 100 per second on every Linux that Rust's toolchain
//! runs on.

/// Whether the process has ended; also true if the system has no `/proc`.
pub(crate) fn has_ended(process: u32) -> bool {
    fields(process).is_none_or(|fields| fields[0] == "Z")
}

/// Seconds of user and system time of the process and its finished descendants; `None` if the system has no `/proc`.
pub(crate) fn of(process: u32) -> Option<f64> {
    let fields = fields(process)?;
    let ticks: Option<f64> = (14..=17).map(|field| fields.get(field - 3)?.parse::<f64>().ok()).sum();
    Some(ticks? / 100.0)
}

/// Fields from the third on. The second, the program's name in parentheses, is skipped because it may contain any characters.
fn fields(process: u32) -> Option<Vec<String>> {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    Some(stat.rsplit_once(')')?.1.split_whitespace().map(str::to_owned).collect())
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn a_busy_process_counts_when_it_has_ended() {
        let burn = "i=0; while [ $i -lt 200000 ]; do i=$((i+1)); done; read line";
        let mut command = std::process::Command::new("sh");
        let mut child = command.args(["-c", burn]).stdin(std::process::Stdio::piped()).spawn().unwrap();
        let process = child.id();
        assert!(!has_ended(process));
        drop(child.stdin.take());
        while !has_ended(process) {
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        assert!(of(process).unwrap() > 0.0);
        child.wait().unwrap();
        assert_eq!((has_ended(process), of(process)), (true, None));
    }
}
