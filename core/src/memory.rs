//! How much memory this process can still take, as the system says it.
//!
//! ```text
//! machine       MemAvailable + SwapFree                     /proc/meminfo
//! containers    limit − (used − cached files), each level   /sys/fs/cgroup/…       (version 2, or 1)
//! this process  limit of the address space − its size       /proc/self/limits, /proc/self/status
//! ```
//! The least of the three counts. Linux grants more memory than there is and ends a process that uses it, so a large allocation is compared
//! with this before it is made ([`crate::reserve`]). Other systems refuse an allocation that they cannot serve, and need no estimate.

use std::path::{Path, PathBuf};

/// Bytes of memory that this process can still take without running out; `None` where the system does not say.
pub fn available_bytes() -> Option<u64> {
    let read = |path: &str| std::fs::read_to_string(path).ok();
    let machine = read("/proc/meminfo").and_then(|text| of_machine(&text));
    let containers = read("/proc/self/cgroup")
        .and_then(|text| of_containers(&text, &|path| std::fs::read_to_string(path).ok()));
    let process = read("/proc/self/limits")
        .zip(read("/proc/self/status"))
        .and_then(|(limits, status)| of_process(&limits, &status));
    [machine, containers, process].into_iter().flatten().min()
}

/// The value of a line `name: value kB`, in bytes.
fn kib_line(text: &str, name: &str) -> Option<u64> {
    let value = text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(':'))?;
    value.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}

/// What the machine has left, from the text of `/proc/meminfo`.
fn of_machine(meminfo: &str) -> Option<u64> {
    let available = kib_line(meminfo, "MemAvailable")?;
    Some(available.saturating_add(kib_line(meminfo, "SwapFree").unwrap_or(0)))
}

/// What the limit of the address space (`ulimit -v`) leaves, from the texts of `/proc/self/limits` and `/proc/self/status`.
fn of_process(limits: &str, status: &str) -> Option<u64> {
    let line = limits.lines().find_map(|line| line.strip_prefix("Max address space"))?;
    let limit: u64 = line.split_whitespace().next()?.parse().ok()?;
    Some(limit.saturating_sub(kib_line(status, "VmSize")?))
}

/// Files of one version of control groups: where they are, the limit, what is used, and the line of `memory.stat` with the cached files
/// that the kernel can drop.
struct Files {
    root: &'static str,
    limit: &'static str,
    used: &'static str,
    cached: &'static str,
}

const VERSION_2: Files =
    Files { root: "/sys/fs/cgroup", limit: "memory.max", used: "memory.current", cached: "inactive_file" };
const VERSION_1: Files = Files {
    root: "/sys/fs/cgroup/memory",
    limit: "memory.limit_in_bytes",
    used: "memory.usage_in_bytes",
    cached: "total_inactive_file",
};

/// What the control groups of this process leave, from the text of `/proc/self/cgroup`. A container sees its own group as the root, so
/// every level up to the root is asked, and those that it does not see are left out.
fn of_containers(groups: &str, read: &dyn Fn(&Path) -> Option<String>) -> Option<u64> {
    let mut least: Option<u64> = None;
    for line in groups.lines() {
        // Number, controllers, path (proc(5), cgroups(7)).
        let mut parts = line.splitn(3, ':').skip(1);
        let (Some(controllers), Some(path)) = (parts.next(), parts.next()) else { continue };
        let files = match controllers {
            "" => VERSION_2,
            names if names.split(',').any(|name| name == "memory") => VERSION_1,
            _ => continue,
        };
        let mut level = PathBuf::from(path);
        loop {
            let folder = Path::new(files.root).join(level.strip_prefix("/").unwrap_or(&level));
            if let Some(left) = of_group(&folder, &files, read) {
                least = Some(least.map_or(left, |least| least.min(left)));
            }
            if !level.pop() {
                break;
            }
        }
    }
    least
}

/// What one group leaves; `None` where it has no limit.
fn of_group(folder: &Path, files: &Files, read: &dyn Fn(&Path) -> Option<String>) -> Option<u64> {
    let number = |name: &str| read(&folder.join(name))?.trim().parse::<u64>().ok();
    let (limit, used) = (number(files.limit)?, number(files.used)?);
    let stat = read(&folder.join("memory.stat")).unwrap_or_default();
    let cached = stat.lines().find_map(|line| line.strip_prefix(files.cached)?.trim().parse().ok());
    Some(limit.saturating_sub(used.saturating_sub(cached.unwrap_or(0))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_machine_has_what_is_available_and_the_swap() {
        let text = "MemTotal:  24000000 kB\nMemFree: 1 kB\nMemAvailable:   20000 kB\nSwapFree:   500 kB\n";
        assert_eq!(of_machine(text), Some(20_500 * 1024));
        assert_eq!(of_machine("MemAvailable: 7 kB\n"), Some(7 * 1024), "without swap");
        assert_eq!(of_machine("MemTotal: 7 kB\n"), None);
        assert_eq!(of_machine("MemAvailable: many kB\n"), None);
    }

    #[test]
    fn the_address_space_is_limited_less_what_is_mapped() {
        let limits = |soft: &str| {
            format!(
                "Limit                     Soft Limit           Hard Limit           Units\n\
                 Max address space         {soft}           unlimited            bytes\n"
            )
        };
        let status = "Name:\tpumice\nVmPeak:\t9 kB\nVmSize:\t     1000 kB\n";
        assert_eq!(of_process(&limits("5000000"), status), Some(5_000_000 - 1_024_000));
        assert_eq!(of_process(&limits("5"), status), Some(0));
        assert_eq!(of_process(&limits("unlimited"), status), None);
    }

    #[test]
    fn the_tightest_control_group_counts_and_cached_files_are_free() {
        let files = |list: &'static [(&'static str, &'static str)]| {
            move |path: &Path| {
                let found = list.iter().find(|(name, _)| Path::new(name) == path);
                found.map(|(_, text)| (*text).to_owned())
            }
        };
        let second = files(&[
            ("/sys/fs/cgroup/a/b/memory.max", "max\n"),
            ("/sys/fs/cgroup/a/b/memory.current", "10\n"),
            ("/sys/fs/cgroup/a/memory.max", "1000\n"),
            ("/sys/fs/cgroup/a/memory.current", "700\n"),
            ("/sys/fs/cgroup/a/memory.stat", "anon 3\ninactive_file 200\n"),
        ]);
        assert_eq!(of_containers("0::/a/b\n", &second), Some(500));
        let first = files(&[
            ("/sys/fs/cgroup/memory/memory.limit_in_bytes", "4096\n"),
            ("/sys/fs/cgroup/memory/memory.usage_in_bytes", "96\n"),
        ]);
        let groups = "5:cpu:/x\n4:hugetlb,memory:/of/the/host\n0::/\n";
        assert_eq!(of_containers(groups, &first), Some(4000), "the container's own group is its root");
        assert_eq!(of_containers("0::/\n", &|_| None), None);
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn this_machine_says_something() {
        let available = available_bytes().unwrap();
        assert!(available > 1 << 20 && available < 1 << 50, "{available}");
    }
}
