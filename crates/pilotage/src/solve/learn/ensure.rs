//! Settings in their ranges.

use crate::error::{Error, Result};

/// Refuses a setting that does not fit its range.
pub fn ensure(
    setting: &'static str,
    value: impl ToString,
    fits: bool,
    range: &'static str,
) -> Result<()> {
    if fits {
        return Ok(());
    }
    Err(Error::Setting {
        setting,
        value: value.to_string(),
        range,
    })
}
