//! How much memory this process may still take: the least that the machine, its control groups and the limit on its
//! address space leave. A process that takes more is killed where its allocations seem to succeed.

use std::fs::read_to_string;
use std::path::{Path, PathBuf};

/// Bytes that this process may still take without pushing others out.
pub fn available() -> u64 {
    let root = Path::new("/");
    let left = [free(root), grouped(root), addressable()];
    left.into_iter().flatten().min().unwrap_or_else(physical)
}

/// Linux' own estimate of what is free or can be made so.
fn free(root: &Path) -> Option<u64> {
    let text = read_to_string(root.join("proc/meminfo")).ok()?;
    let line = text.lines().find(|l| l.starts_with("MemAvailable:"))?;
    line.split_whitespace().nth(1)?.parse::<u64>().ok().map(|kib| kib * 1024)
}

fn physical() -> u64 {
    // SAFETY: sysconf has no preconditions; it answers -1 for what it does not know.
    let (pages, size) = unsafe { (libc::sysconf(libc::_SC_PHYS_PAGES), libc::sysconf(libc::_SC_PAGESIZE)) };
    if pages > 0 && size > 0 { pages as u64 * size as u64 } else { u64::MAX }
}

/// What `ulimit -v` leaves, if there is such a limit.
fn addressable() -> Option<u64> {
    let mut limit = libc::rlimit { rlim_cur: 0, rlim_max: 0 };
    // SAFETY: the struct is ours; sysconf has no preconditions.
    let (known, page) = unsafe { (libc::getrlimit(libc::RLIMIT_AS, &mut limit), libc::sysconf(libc::_SC_PAGESIZE)) };
    if known != 0 || limit.rlim_cur == libc::RLIM_INFINITY || page <= 0 {
        return None;
    }
    let text = read_to_string("/proc/self/statm").ok()?;
    let used = text.split_whitespace().next()?.parse::<u64>().ok()? * page as u64;
    #[allow(clippy::unnecessary_cast)] // not u64 on every system
    Some((limit.rlim_cur as u64).saturating_sub(used))
}

/// The files of a version of control groups: the limit, what is used of it, and the line of `memory.stat` with what of
/// that can be given back, being copies of files.
struct Version {
    kind: &'static str,
    controller: &'static str,
    limit: &'static str,
    usage: &'static str,
    returnable: &'static str,
}

const VERSIONS: [Version; 2] = [
    Version {
        kind: "cgroup2",
        controller: "",
        limit: "memory.max",
        usage: "memory.current",
        returnable: "inactive_file",
    },
    Version {
        kind: "cgroup",
        controller: "memory",
        limit: "memory.limit_in_bytes",
        usage: "memory.usage_in_bytes",
        returnable: "total_inactive_file",
    },
];

/// The least that the control groups of this process and those above them leave, if any limits it.
fn grouped(root: &Path) -> Option<u64> {
    let groups = read_to_string(root.join("proc/self/cgroup")).ok()?;
    let mounts = read_to_string(root.join("proc/self/mountinfo")).ok()?;
    let each = VERSIONS.iter().filter_map(|version| {
        let (top, group) = version.folder(&groups, &mounts)?;
        let top = root.join(top.trim_start_matches('/'));
        let own: PathBuf = top.join(group.trim_start_matches('/'));
        own.ancestors().take_while(|folder| folder.starts_with(&top)).filter_map(|f| version.left(f)).min()
    });
    each.min()
}

impl Version {
    /// Where the groups are mounted, and the group of this process below that.
    fn folder<'a>(&self, groups: &'a str, mounts: &'a str) -> Option<(&'a str, &'a str)> {
        let group = groups.lines().find_map(|line| {
            let (controllers, path) = line.split_once(':')?.1.split_once(':')?;
            controllers.split(',').any(|c| c == self.controller).then_some(path)
        })?;
        let (seen_from, top) = mounts.lines().find_map(|line| {
            let (place, what) = line.split_once(" - ")?;
            let mut what = what.split(' ');
            let (kind, options) = (what.next()?, what.nth(1)?);
            let here =
                kind == self.kind && (self.controller.is_empty() || options.split(',').any(|o| o == self.controller));
            let mut place = place.split(' ').skip(3);
            if here { Some((place.next()?, place.next()?)) } else { None }
        })?;
        // A container may see its own group as the top.
        Some((top, group.strip_prefix(seen_from).unwrap_or("")))
    }

    /// What a group leaves of its limit.
    fn left(&self, folder: &Path) -> Option<u64> {
        let number = |name: &str| read_to_string(folder.join(name)).ok()?.trim().parse::<u64>().ok();
        let (limit, used) = (number(self.limit)?, number(self.usage)?);
        let stat = read_to_string(folder.join("memory.stat")).unwrap_or_default();
        let value = |line: &str| line.strip_prefix(self.returnable)?.trim().parse::<u64>().ok();
        let returnable = stat.lines().find_map(value).unwrap_or(0);
        Some(limit.saturating_sub(used.saturating_sub(returnable)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    /// A machine whose files say what is given as (path, text).
    fn machine(files: &[(&str, &str)]) -> tempfile::TempDir {
        let root = tempfile::tempdir().unwrap();
        for (path, text) in files {
            let path = root.path().join(path);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        }
        root
    }

    #[test]
    fn available_memory_is_known_here() {
        assert!(available() > 1 << 20);
    }

    #[test]
    fn the_narrowest_of_nested_groups_counts() {
        let v2 = "31 23 0:28 / /sys/fs/cgroup rw,relatime - cgroup2 cgroup2 rw\n";
        let root = machine(&[
            ("proc/self/cgroup", "0::/batch/job\n"),
            ("proc/self/mountinfo", v2),
            ("sys/fs/cgroup/batch/memory.max", "1000\n"),
            ("sys/fs/cgroup/batch/memory.current", "700\n"),
            ("sys/fs/cgroup/batch/memory.stat", "anon 1\ninactive_file 200\n"),
            ("sys/fs/cgroup/batch/job/memory.max", "max\n"),
            ("sys/fs/cgroup/batch/job/memory.current", "600\n"),
        ]);
        assert_eq!(grouped(root.path()), Some(500));
        fs::write(root.path().join("sys/fs/cgroup/batch/job/memory.max"), "640\n").unwrap();
        assert_eq!(grouped(root.path()), Some(40));
        fs::write(root.path().join("sys/fs/cgroup/batch/job/memory.max"), "500\n").unwrap();
        assert_eq!(grouped(root.path()), Some(0));
        assert_eq!(grouped(machine(&[]).path()), None);
    }

    #[test]
    fn the_older_groups_are_read_as_a_container_sees_them() {
        let v1 = "40 31 0:37 / /sys/fs/cgroup/systemd rw - cgroup cgroup rw,name=systemd\n\
                  35 31 0:32 /docker/c0 /sys/fs/cgroup/memory ro,relatime - cgroup cgroup rw,memory\n";
        let root = machine(&[
            ("proc/self/cgroup", "9:name=systemd:/\n4:memory:/docker/c0\n0::/\n"),
            ("proc/self/mountinfo", v1),
            ("sys/fs/cgroup/memory/memory.limit_in_bytes", "2000\n"),
            ("sys/fs/cgroup/memory/memory.usage_in_bytes", "500\n"),
            ("sys/fs/cgroup/memory/memory.stat", "inactive_file 1\ntotal_inactive_file 100\n"),
        ]);
        assert_eq!(grouped(root.path()), Some(1600));
    }
}
