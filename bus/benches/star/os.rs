//! What the operating system knows about processes and shared memory.

use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

use crate::transport::BenchResult;

const SHARED_MEMORY: &str = "/dev/shm";

/// The machine's load over 1, 5 and 15 minutes.
pub fn load_average() -> BenchResult<String> {
    let text = fs::read_to_string("/proc/loadavg")?;
    Ok(text.split_whitespace().take(3).collect::<Vec<_>>().join(" "))
}

/// CPU that the living threads of a process have used (ns).
pub fn cpu_nanos(process: u32) -> BenchResult<u64> {
    let mut nanos = 0;
    for thread in fs::read_dir(format!("/proc/{process}/task"))?.flatten() {
        let text = fs::read_to_string(thread.path().join("schedstat")).unwrap_or_default();
        nanos += text.split_whitespace().next().and_then(|n| n.parse::<u64>().ok()).unwrap_or(0);
    }
    Ok(nanos)
}

/// A line of `/proc/PID/status` that counts in kB, such as `VmRSS` or `VmHWM` (its peak); answered in MB.
pub fn memory_mb(process: u32, line: &str) -> BenchResult<f64> {
    let status = fs::read_to_string(format!("/proc/{process}/status"))?;
    let value = status.lines().find_map(|l| l.strip_prefix(line)?.strip_prefix(':'));
    let kb = value.and_then(|v| v.trim().trim_end_matches(" kB").parse::<f64>().ok());
    Ok(kb.ok_or_else(|| format!("process {process} has no {line}"))? * 1024e-6)
}

/// Open file descriptors of a process.
pub fn descriptors(process: u32) -> BenchResult<usize> {
    Ok(fs::read_dir(format!("/proc/{process}/fd"))?.count())
}

/// Files in shared memory whose names begin with `prefix`.
pub fn shared_files(prefix: &str) -> Vec<std::path::PathBuf> {
    let files = fs::read_dir(SHARED_MEMORY).into_iter().flatten().flatten();
    files.filter(|f| f.file_name().to_string_lossy().starts_with(prefix)).map(|f| f.path()).collect()
}

/// Shared memory that these files really take (bytes), holes not counted.
pub fn shared_bytes(prefix: &str) -> u64 {
    shared_files(prefix).iter().filter_map(|f| fs::metadata(f).ok()).map(|m| m.blocks() * 512).sum()
}

/// Removes these files, and a folder; what is gone already needs no removing.
pub fn remove(prefix: &str, folder: &Path) {
    for file in shared_files(prefix) {
        let _ = fs::remove_file(file);
    }
    let _ = fs::remove_dir_all(folder);
}
