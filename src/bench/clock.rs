//! What the system tells of the running process.

use std::fs;

/// Processor time of all threads of this process so far, in milliseconds; `None` where the system does
/// not say.
///
/// The scheduler's own count, in nanoseconds. That of `/proc/self/stat` would be in hundredths of a
/// second, longer than most frames. A thread that ends takes its time with it, which drivers' threads
/// do not do between frames.
pub fn process_cpu_ms() -> Option<f64> {
    let mut ns = 0u64;
    for task in fs::read_dir("/proc/self/task").ok()? {
        let text = fs::read_to_string(task.ok()?.path().join("schedstat")).ok()?;
        ns += text.split_whitespace().next()?.parse::<u64>().ok()?;
    }
    Some(ns as f64 / 1e6)
}

/// The most memory that this process held so far, drivers that run on the host included; `None` where
/// the system does not say.
pub fn peak_bytes() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kib| kib * 1024)
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn work_shows() {
        // Other tests' threads take their time with them when they end: some attempt has to show more.
        let shows = (0..50).any(|_| {
            let before = process_cpu_ms();
            let started = std::time::Instant::now();
            let mut sum = 0u64;
            while started.elapsed().as_millis() < 60 {
                sum = std::hint::black_box(sum.wrapping_mul(31) + 1);
            }
            // Kernels without statistics of the scheduler say nothing, and nothing is claimed then.
            before.zip(process_cpu_ms()).is_none_or(|(before, after)| after > before)
        });
        assert!(shows);
        let block = vec![1u8; 8 << 20];
        assert!(peak_bytes().is_some_and(|peak| peak > std::hint::black_box(&block).len() as u64));
    }
}
