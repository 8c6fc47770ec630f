//! Settings in their ranges.

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::error::{Error, Result};
use crate::model::suggest;

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

/// Settings with one of them set by name to a value written as in JSON; words need no quotes. Ranges are not looked at.
///
/// # Errors
/// [`Error::Unknown`] for a name that is none, [`Error::Setting`] for a value of another kind than the setting's.
pub fn set<S: Serialize + DeserializeOwned>(settings: &S, name: &str, value: &str) -> Result<S> {
    let wrong = |value: String| Error::Setting {
        setting: "a setting of the learner",
        value,
        range: "a value of the kind that it has by default",
    };
    let mut all = serde_json::to_value(settings).map_err(|error| wrong(error.to_string()))?;
    let Some(slot) = all.get_mut(name) else {
        let known = all.as_object().into_iter().flat_map(|all| all.keys());
        return Err(Error::Unknown {
            what: "setting of the learner",
            name: name.to_owned(),
            hint: suggest(name, known.map(String::as_str)),
        });
    };
    let default = slot.to_string();
    *slot = serde_json::from_str(value).unwrap_or_else(|_| value.into());
    serde_json::from_value(all).map_err(|_| wrong(format!("{name}={value} (it is {default})")))
}
