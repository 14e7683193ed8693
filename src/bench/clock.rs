//! What the system tells of the running process.

use std::{fs, ops::RangeInclusive};

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

/// Time since the system started of the processors that this process may run on, in ticks of the kernel.
/// What others do on the rest does not disturb it.
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
    /// Fewest ticks that say something: a tick is mostly a hundredth of a second.
    const FEWEST: u64 = 20;

    /// Until now; `None` where the system does not say.
    pub fn now() -> Option<Self> {
        let all = fs::read_to_string("/proc/stat").ok()?;
        let own = fs::read_to_string("/proc/self/stat").ok()?;
        let status = fs::read_to_string("/proc/self/status").ok()?;
        Self::parse(&all, &own, &status)
    }

    /// Of the texts of `/proc/stat`, `/proc/self/stat` and `/proc/self/status`.
    fn parse(all: &str, own: &str, status: &str) -> Option<Self> {
        let allowed = status.lines().find_map(|line| line.strip_prefix("Cpus_allowed_list:"))?;
        let allowed: Vec<_> = allowed.trim().split(',').map(range).collect::<Option<_>>()?;
        let (mut busy, mut total) = (0, 0);
        // The line `cpu` is the sum; `cpu0` and so on are the processors.
        for line in all.lines() {
            let Some((name, ticks)) = line.split_once(' ') else { continue };
            let number = name.strip_prefix("cpu").and_then(|number| number.parse::<u32>().ok());
            if !number.is_some_and(|number| allowed.iter().any(|range| range.contains(&number))) {
                continue;
            }
            // user nice system idle iowait irq softirq steal; guests are in user already.
            let ticks = ticks.split_whitespace().take(8);
            let ticks: Vec<u64> = ticks.map(|text| text.parse().ok()).collect::<Option<_>>()?;
            let [_, _, _, idle, waiting, ..] = ticks[..] else { return None };
            let all = ticks.iter().sum::<u64>();
            total += all;
            busy += all - idle - waiting;
        }
        if total == 0 {
            return None;
        }
        // The name stands in parentheses and may hold anything; user and system time are the 12th and 13th
        // field behind it.
        let mut own = own.rsplit_once(')')?.1.split_whitespace().skip(11);
        let own = own.next()?.parse::<u64>().ok()? + own.next()?.parse::<u64>().ok()?;
        Some(Self { busy, total, own })
    }

    /// The part of those processors, 0 to 1, that others than this process used since `before`; `None` if
    /// too little time has passed to say.
    pub fn others_since(self, before: Self) -> Option<f64> {
        let total = self.total.checked_sub(before.total).filter(|ticks| *ticks >= Self::FEWEST)?;
        let busy = self.busy.saturating_sub(before.busy);
        let others = busy.saturating_sub(self.own.saturating_sub(before.own));
        Some(others as f64 / total as f64)
    }
}

/// A part of a list of processors: `5` or `0-3`.
fn range(text: &str) -> Option<RangeInclusive<u32>> {
    let (first, last) = text.split_once('-').unwrap_or((text, text));
    Some(first.parse().ok()?..=last.parse().ok()?)
}

#[cfg(test)]
mod parsing {
    use super::Processors;

    #[test]
    fn others_are_what_is_busy_and_not_this_process() {
        let own = |user: u32| format!("7 (a) b) R 1 2 3 4 5 6 7 8 9 10 {user} 5 0 0 20 0");
        let all = |user: u32, idle: u32, steal: u32| {
            format!("cpu  1 2 3 4 5\ncpu0 {user} 0 10 {idle} 4 0 1 {steal} 99 0\nintr 9\n")
        };
        let parse = |all: &str, own: &str| Processors::parse(all, own, STATUS);
        let before = parse(&all(100, 1000, 0), &own(50)).unwrap();
        let after = parse(&all(160, 1030, 10), &own(90)).unwrap();
        // 100 ticks passed, 70 of them busy, 40 of these our own.
        assert_eq!(after.others_since(before), Some(0.3));
        assert_eq!(before.others_since(before), None);
        assert_eq!(parse("cpu0 1 2", &own(1)), None);
        assert_eq!(parse("cpu 1 2 3 4 5", &own(1)), None);
    }

    const STATUS: &str = "Name:\ta\nCpus_allowed:\t8f\nCpus_allowed_list:\t0-3,7\n";

    #[test]
    fn processors_that_the_process_may_not_use_do_not_count() {
        let own = "7 (a) R 1 2 3 4 5 6 7 8 9 10 0 0 0 0 20 0";
        // 100 ticks pass on each of 12; those of `busy` are busy throughout.
        let after = |busy: &[u32]| {
            let line = |n: u32| match busy.contains(&n) {
                true => format!("cpu{n} 100 0 0 100 0 0 0 0 0 0\n"),
                false => format!("cpu{n} 0 0 0 200 0 0 0 0 0 0\n"),
            };
            let all: String = (0..12).map(line).collect();
            let all = format!("cpu  {} 0 0 7 0 0 0 0 0 0\n{all}", 100 * busy.len());
            Processors::parse(&all, own, STATUS).unwrap()
        };
        let before = (0..12).map(|n| format!("cpu{n} 0 0 0 100 0 0 0 0 0 0\n"));
        let before = Processors::parse(&before.collect::<String>(), own, STATUS).unwrap();
        assert_eq!(after(&[4, 5, 6, 8, 10, 11]).others_since(before), Some(0.0));
        assert_eq!(after(&[3, 5, 7, 8, 11]).others_since(before), Some(0.4));
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
