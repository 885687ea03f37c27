//! Measures the cost of work: wall seconds, CPU seconds of the whole process, memory.

use std::path::Path;
use std::time::Instant;

use cpu_time::ProcessTime;

/// A stopwatch over wall time and the CPU time of all threads.
#[derive(Clone, Copy, Debug)]
pub struct Stopwatch {
    wall: Instant,
    cpu: ProcessTime,
}

impl Stopwatch {
    /// A stopwatch that starts now.
    pub fn start() -> Self {
        Self { wall: Instant::now(), cpu: ProcessTime::now() }
    }

    /// Wall seconds since the start.
    pub fn seconds(&self) -> f64 {
        self.wall.elapsed().as_secs_f64()
    }

    /// CPU seconds of this process, all threads, user and system, since the start.
    pub fn cpu_seconds(&self) -> f64 {
        self.cpu.elapsed().as_secs_f64()
    }
}

/// The model name of the processor; `None` except on Linux, where the system has it in a file.
pub fn processor_name() -> Option<String> {
    let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|l| l.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}

/// Largest resident set of this process so far, in bytes; `None` except on Linux, where the system reports it without unsafe code.
pub fn peak_rss_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024)
}

/// Bytes of a mapped file that are in this process's resident set now; `None` except on Linux. The system also loads a few pages around
/// each page that is touched.
pub fn resident_file_bytes(path: &Path) -> Option<u64> {
    let path = path.canonicalize().ok()?;
    let text = std::fs::read_to_string("/proc/self/smaps").ok()?;
    let mut is_of_file = false;
    let mut kib = 0;
    for line in text.lines() {
        // Each mapping has a line "from-to rights offset device inode path", followed by its figures, one per line.
        if line.split_once(' ').is_some_and(|(range, _)| range.contains('-')) {
            let name = line.splitn(6, ' ').nth(5).map(str::trim_start);
            is_of_file = name.is_some_and(|n| Path::new(n) == path);
        } else if let (true, Some(rest)) = (is_of_file, line.strip_prefix("Rss:")) {
            kib += rest.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?;
        }
    }
    Some(1024 * kib)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cpu_time_grows_with_work_and_not_with_sleep() {
        let watch = Stopwatch::start();
        std::thread::sleep(std::time::Duration::from_millis(30));
        assert!(watch.seconds() >= 0.03);
        let before = watch.cpu_seconds();
        let mut x = 1u64;
        while watch.cpu_seconds() <= before {
            x = std::hint::black_box(x.wrapping_mul(3));
        }
    }

    /// The peak is at least what is resident, which an allocation of 64 MiB raises. (Other tests of the process may have had a higher peak
    /// before, so that it need not rise.)
    #[test]
    #[cfg(target_os = "linux")]
    fn peak_memory_sees_an_allocation() {
        let block = std::hint::black_box(vec![1u8; 64 << 20]);
        let status = std::fs::read_to_string("/proc/self/status").unwrap();
        let resident = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap();
        let resident = 1024 * resident.trim().trim_end_matches(" kB").parse::<u64>().unwrap();
        let peak = peak_rss_bytes().unwrap();
        assert!(peak >= resident && peak >= block.len() as u64, "{peak} {resident}");
    }
}
