//! What a piece of work cost: wall seconds, CPU seconds of the whole process, peak memory.

use std::time::Instant;

use cpu_time::ProcessTime;

/// A stopwatch over wall time and the CPU time of all threads.
#[derive(Clone, Copy, Debug)]
pub struct Stopwatch {
    wall: Instant,
    cpu: ProcessTime,
}

impl Stopwatch {
    /// Starts now.
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

/// Largest resident set of this process so far, in bytes; `None` where the system does not tell without unsafe code (all but
/// Linux).
pub fn peak_rss_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024)
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

    #[test]
    #[cfg(target_os = "linux")]
    fn peak_memory_sees_an_allocation() {
        let before = peak_rss_bytes().unwrap();
        let block = vec![1u8; 64 << 20];
        let after = peak_rss_bytes().unwrap();
        assert!(std::hint::black_box(&block).len() as u64 + before <= after + (1 << 20), "{before} {after}");
    }
}
