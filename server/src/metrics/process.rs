//! What the process takes of its machine, and how full its disk is. Reads `/proc` and asks the file
//! system: not for an async thread. What a system does not tell is left out.

use super::exposition::Exposition;
use std::{
    fs,
    path::Path,
    sync::LazyLock,
    time::{SystemTime, UNIX_EPOCH},
};

/// When this program first asked: at the start of the server.
static STARTED: LazyLock<f64> =
    LazyLock::new(|| SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64()));

/// Remembers the time of the start.
pub(crate) fn started() {
    LazyLock::force(&STARTED);
}

/// Writes the families of process and disk; `data` is the data directory.
pub(super) fn write(all: &mut Exposition<'_>, data: &Path) {
    all.gauge("process_start_time_seconds", "Start of the server, seconds since 1970.").value(&[], *STARTED);
    #[cfg(unix)]
    all.counter("process_cpu_seconds_total", "Processor time of the process.").value(&[], cpu_s());
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let resident = number_after(&status, "VmRSS:").map(|kib| kib * 1024);
    all.gauge("process_resident_memory_bytes", "Memory that is resident.").known(&[], resident);
    all.gauge("process_threads", "Threads.").known(&[], number_after(&status, "Threads:"));
    let open = fs::read_dir("/proc/self/fd").ok().map(Iterator::count);
    all.gauge("process_open_fds", "Open file descriptors.").known(&[], open);
    let limits = fs::read_to_string("/proc/self/limits").unwrap_or_default();
    let most = number_after(&limits, "Max open files");
    all.gauge("process_max_fds", "Most file descriptors that may be open.").known(&[], most);
    let disk = disk(data);
    all.gauge("waymark_disk_free_bytes", "Free for the server on the disk of the data directory.")
        .known(&[], disk.map(|(free, _)| free));
    all.gauge("waymark_disk_size_bytes", "Size of the disk of the data directory.")
        .known(&[], disk.map(|(_, size)| size));
    let file = |name: &str| fs::metadata(data.join(name)).ok().map(|file| file.len());
    all.gauge("waymark_database_bytes", "Size of the database.").known(&[], file(crate::store::open::FILE));
    let log = file(&format!("{}-wal", crate::store::open::FILE));
    all.gauge("waymark_write_ahead_log_bytes", "Size of the database's write-ahead log.").known(&[], log);
}

fn number_after(text: &str, word: &str) -> Option<u64> {
    text.lines().find_map(|line| line.strip_prefix(word))?.split_whitespace().next()?.parse().ok()
}

#[cfg(unix)]
fn cpu_s() -> f64 {
    let used = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    used.tv_sec as f64 + used.tv_nsec as f64 / 1e9
}

/// Free for this user, and size, bytes.
#[cfg(unix)]
fn disk(data: &Path) -> Option<(u64, u64)> {
    let found = rustix::fs::statvfs(data).ok()?;
    Some((found.f_bavail * found.f_frsize, found.f_blocks * found.f_frsize))
}

#[cfg(not(unix))]
fn disk(_data: &Path) -> Option<(u64, u64)> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_those_behind_the_word() {
        let text = "VmPeak:\t  9 kB\nVmRSS:\t  1234 kB\nMax open files            1024                 524288    files\n";
        assert_eq!(
            (number_after(text, "VmRSS:"), number_after(text, "Max open files")),
            (Some(1234), Some(1024))
        );
        assert_eq!(number_after(text, "Threads:"), None);
    }
}
