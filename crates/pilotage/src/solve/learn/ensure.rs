//! Settings in their ranges, by name.

use schemars::{JsonSchema, schema_for};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::error::{Error, Result};
use crate::model::nearest;

/// What sets the randomness of a run, and is no setting of a learner.
const SEED: &str = "seed";

/// A setting as a person is told of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SettingInfo {
    /// Its name.
    pub name: String,
    /// Its default, written as in JSON; a word stands without quotes.
    pub default: String,
    /// What it means, and its range.
    pub about: String,
}

/// Settings but for the seed, in the order of their names, with what is written above them in the code.
pub fn described<S: Serialize + Default + JsonSchema>() -> Vec<SettingInfo> {
    let defaults = serde_json::to_value(S::default()).unwrap_or_default();
    let schema = schema_for!(S);
    let documented = schema.get("properties").and_then(Value::as_object);
    let about = |name: &str| {
        let text = documented?.get(name)?.get("description")?.as_str()?;
        Some(text.split_whitespace().collect::<Vec<_>>().join(" "))
    };
    let all = defaults.as_object().into_iter().flatten();
    all.filter(|(name, _)| *name != SEED)
        .map(|(name, default)| SettingInfo {
            name: name.clone(),
            default: default
                .as_str()
                .map_or_else(|| default.to_string(), str::to_owned),
            about: about(name).unwrap_or_default(),
        })
        .collect()
}

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
        let known: Vec<&str> = known
            .map(String::as_str)
            .filter(|&name| name != SEED)
            .collect();
        let meant = nearest(name, known.iter().copied())
            .map_or_else(String::new, |name| format!("did you mean `{name}`? "));
        return Err(Error::Unknown {
            what: "setting of the learner",
            name: name.to_owned(),
            hint: format!("{meant}there are `{}`", known.join("`, `")),
        });
    };
    let default = slot.to_string();
    *slot = serde_json::from_str(value).unwrap_or_else(|_| value.into());
    serde_json::from_value(all).map_err(|_| wrong(format!("{name}={value} (it is {default})")))
}
