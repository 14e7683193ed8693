//! Properties that the process was started with: whether it has a standard output, and how much memory it may
//! use. Checking standard output takes `unsafe`, because it has to happen before `main`: Rust's runtime
//! replaces a closed standard output by `/dev/null`, and then it looks like one that the user redirected there.

use crate::error::{Error, Result};
use std::sync::atomic::{AtomicBool, Ordering};

static STDOUT_CLOSED: AtomicBool = AtomicBool::new(false);

/// Whether standard output was closed when the process started. Data that is written to it is then lost
/// without an error.
#[cfg_attr(not(feature = "cli"), allow(dead_code))]
pub(crate) fn stdout_was_closed() -> bool {
    STDOUT_CLOSED.load(Ordering::Relaxed)
}

#[cfg(target_os = "linux")]
extern "C" fn look() {
    use std::os::fd::BorrowedFd;
    // SAFETY: the descriptor is only copied, within this statement; if it is closed, that fails.
    let copied = unsafe { BorrowedFd::borrow_raw(1) }.try_clone_to_owned();
    STDOUT_CLOSED.store(copied.is_err(), Ordering::Relaxed);
}

/// The system calls the functions in this section before `main`.
// SAFETY: the section holds pointers to functions that return nothing and may ignore their arguments.
#[cfg(target_os = "linux")]
#[used]
#[unsafe(link_section = ".init_array")]
static LOOK: extern "C" fn() = look;

/// Drivers end the process where they get no memory for small things. With less address space than
/// this, lavapipe does so before it has drawn a picture of 64x64 (between 800 and 1000 MB).
const LEAST_ADDRESS_SPACE: u64 = 900 << 20;

/// Refuses a limit of the address space (`ulimit -v`) that drivers do not survive.
///
/// # Errors
/// [`Error::Full`].
pub(super) fn check_address_space() -> Result<()> {
    // Elsewhere than on Linux there is no such file, and nothing is checked.
    let limits = std::fs::read_to_string("/proc/self/limits").unwrap_or_default();
    match address_space(&limits) {
        Some(limit) if limit < LEAST_ADDRESS_SPACE => Err(Error::Full(format!(
            "the address space of the process is limited to {} KiB, a Vulkan driver needs {} KiB or \
             more: raise the limit (ulimit -v)",
            limit >> 10,
            LEAST_ADDRESS_SPACE >> 10
        ))),
        _ => Ok(()),
    }
}

/// The limit in bytes that the kernel's list of limits names, if there is one.
fn address_space(limits: &str) -> Option<u64> {
    let line = limits.lines().find_map(|line| line.strip_prefix("Max address space"))?;
    line.split_whitespace().next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_read_as_the_kernel_writes_them() {
        let list = |value: &str| {
            format!(
                "Limit                     Soft Limit           Hard Limit           Units     \n\
                 Max open files            1024                 524288               files     \n\
                 Max address space         {value}            unlimited            bytes     \n"
            )
        };
        assert_eq!(address_space(&list("409600000")), Some(409_600_000));
        assert_eq!(address_space(&list("unlimited")), None);
        assert_eq!(address_space(""), None);
    }
}
