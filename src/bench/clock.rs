//! Times and memory of the running process, as the system reports them.

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

/// The load average of the last minute; `None` where the system does not say.
pub fn load_average() -> Option<f64> {
    fs::read_to_string("/proc/loadavg").ok()?.split_whitespace().next()?.parse().ok()
}

/// Time of all processors since the system started, in ticks of the kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Processors {
    /// Busy, with whatever it was; also the time that a hypervisor took.
    busy: u64,
    /// All of it.
    total: u64,
    /// Busy with this process, threads that ended included.
    own: u64,
}

impl Processors {
    /// Fewest ticks that a statement needs: a tick is usually a hundredth of a second.
    const MIN_TICKS: u64 = 20;

    /// Until now; `None` where the system does not say.
    pub fn now() -> Option<Self> {
        let all = fs::read_to_string("/proc/stat").ok()?;
        let own = fs::read_to_string("/proc/self/stat").ok()?;
        Self::parse(&all, &own)
    }

    fn parse(all: &str, own: &str) -> Option<Self> {
        // user nice system idle iowait irq softirq steal; guests are in user already.
        let ticks = all.lines().next()?.strip_prefix("cpu ")?.split_whitespace().take(8);
        let ticks: Vec<u64> = ticks.map(|text| text.parse().ok()).collect::<Option<_>>()?;
        let [_, _, _, idle, waiting, ..] = ticks[..] else { return None };
        let total = ticks.iter().sum::<u64>();
        // The name stands in parentheses and may hold anything; user and system time are the 12th and 13th
        // field behind it.
        let mut own = own.rsplit_once(')')?.1.split_whitespace().skip(11);
        let own = own.next()?.parse::<u64>().ok()? + own.next()?.parse::<u64>().ok()?;
        Some(Self { busy: total - idle - waiting, total, own })
    }

    /// The part of all processors, 0 to 1, that others than this process used since `before`; `None` if
    /// too little time has passed to say.
    pub fn others_since(self, before: Self) -> Option<f64> {
        let total =
            self.total.checked_sub(before.total).filter(|ticks| *ticks >= Self::MIN_TICKS)?;
        let busy = self.busy.saturating_sub(before.busy);
        let others = busy.saturating_sub(self.own.saturating_sub(before.own));
        Some(others as f64 / total as f64)
    }
}

#[cfg(test)]
mod parsing {
    use super::Processors;

    #[test]
    fn others_are_what_is_busy_and_not_this_process() {
        let own = |user: u32| format!("7 (a) b) R 1 2 3 4 5 6 7 8 9 10 {user} 5 0 0 20 0");
        let all = |user: u32, idle: u32, steal: u32| {
            format!("cpu  {user} 0 10 {idle} 4 0 1 {steal} 99 0\ncpu0 1 2 3\n")
        };
        let before = Processors::parse(&all(100, 1000, 0), &own(50)).unwrap();
        let after = Processors::parse(&all(160, 1030, 10), &own(90)).unwrap();
        // 100 ticks passed, 70 of them busy, 40 of these our own.
        assert_eq!(after.others_since(before), Some(0.3));
        assert_eq!(before.others_since(before), None);
        assert_eq!(Processors::parse("cpu 1 2", &own(1)), None);
    }
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
