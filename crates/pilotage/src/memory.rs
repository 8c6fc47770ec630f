//! Whether there is memory for a grid, asked before any of it is taken.

use crate::error::{Error, Result};

/// Checks that a grid fits into what is allowed, and into what there is.
///
/// # Errors
/// [`Error::TooLarge`] for more than is allowed, [`Error::OutOfMemory`] for more than is free.
pub(crate) fn check(model: &str, points: u64, mebibytes: u64, limit: u64) -> Result<()> {
    let model = model.to_owned();
    if mebibytes > limit {
        return Err(Error::TooLarge {
            model,
            points,
            mebibytes,
            limit,
        });
    }
    match available() {
        Some(available) if mebibytes > available => Err(Error::OutOfMemory {
            model,
            points,
            mebibytes,
            available,
        }),
        _ => Ok(()),
    }
}

/// MiB that can still be taken on this machine, or by this container; `None` where the system does not say.
fn available() -> Option<u64> {
    let machine = field("/proc/meminfo", "MemAvailable:").map(|kibibytes| kibibytes >> 10);
    let number = |file: &str| -> Option<u64> {
        let text = std::fs::read_to_string(format!("/sys/fs/cgroup/memory.{file}")).ok()?;
        text.trim().parse().ok()
    };
    let container =
        number("max").map(|most| most.saturating_sub(number("current").unwrap_or(0)) >> 20);
    machine.into_iter().chain(container).min()
}

/// The number behind a word at the beginning of a line.
fn field(file: &str, word: &str) -> Option<u64> {
    let text = std::fs::read_to_string(file).ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix(word))?;
    line.split_whitespace().next()?.parse().ok()
}
