//! Settings of solvers by name: what there is to set, and in which range.

use schemars::{JsonSchema, schema_for};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::error::{Error, Result};
use crate::model::nearest;

/// What sets the randomness of a run, and is no setting of a solver.
const SEED: &str = "seed";

/// How a person writes that the solver shall choose.
const AUTO: &str = "auto";

/// What a solver can be told, each with a name, a default and a meaning, which is the comment on its field.
pub trait Settings: Clone + Default + Serialize + DeserializeOwned + JsonSchema {
    /// Checks every setting against its range.
    ///
    /// # Errors
    /// [`Error::Setting`] for the first that is out of range.
    fn validate(&self) -> Result<()>;

    /// All of them but the seed, which a run sets, with defaults and what they mean.
    fn described() -> Vec<SettingInfo> {
        let defaults = serde_json::to_value(Self::default()).unwrap_or_default();
        let schema = schema_for!(Self);
        let documented = schema.get("properties").and_then(Value::as_object);
        let about = |name: &str| {
            let text = documented?.get(name)?.get("description")?.as_str()?;
            Some(text.split_whitespace().collect::<Vec<_>>().join(" "))
        };
        let all = defaults.as_object().into_iter().flatten();
        all.filter(|(name, _)| *name != SEED)
            .map(|(name, default)| SettingInfo {
                name: name.clone(),
                default: shown(default),
                about: about(name).unwrap_or_default(),
            })
            .collect()
    }

    /// Sets one of them by name to a value written as in JSON; words need no quotes, and `auto` leaves it to the solver where that is
    /// the default. Ranges are left to [`Settings::validate`].
    ///
    /// # Errors
    /// [`Error::Unknown`] for a name that is none, with those there are; [`Error::NoValue`] for a value of another kind than the
    /// setting's, which `nan` and `inf` are too.
    fn set(&mut self, name: &str, value: &str) -> Result<()> {
        let mut all = serde_json::to_value(&*self).unwrap_or_default();
        let Some(slot) = all.get_mut(name).filter(|_| name != SEED) else {
            return Err(unknown::<Self>(name));
        };
        *slot = match value {
            AUTO => Value::Null,
            _ => serde_json::from_str(value).unwrap_or_else(|_| value.into()),
        };
        *self = serde_json::from_value(all).map_err(|_| no_value::<Self>(name, value))?;
        Ok(())
    }
}

/// A setting as a person is told of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SettingInfo {
    /// Its name.
    pub name: String,
    /// Its default, written as in JSON; a word stands without quotes, and `auto` for the solver's own choice.
    pub default: String,
    /// What it means, and its range.
    pub about: String,
}

fn shown(value: &Value) -> String {
    match value {
        Value::Null => AUTO.to_owned(),
        Value::String(word) => word.clone(),
        other => other.to_string(),
    }
}

fn unknown<S: Settings>(name: &str) -> Error {
    let known = S::described();
    let known = || known.iter().map(|setting| setting.name.as_str());
    let meant =
        nearest(name, known()).map_or_else(String::new, |name| format!("did you mean `{name}`? "));
    Error::Unknown {
        what: "setting of the solver",
        name: name.to_owned(),
        hint: format!(
            "{meant}there are `{}`",
            known().collect::<Vec<_>>().join("`, `")
        ),
    }
}

fn no_value<S: Settings>(name: &str, value: &str) -> Error {
    let mut described = S::described().into_iter();
    let about = described.find(|setting| setting.name == name);
    Error::NoValue {
        setting: name.to_owned(),
        value: value.to_owned(),
        about: about.map_or_else(String::new, |setting| setting.about),
    }
}

/// Refuses a setting that does not fit its range.
///
/// # Errors
/// [`Error::Setting`] with the value and the range.
pub(super) fn ensure(
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

/// Most of a count, and how that is said. Products of two of them are still numbers.
pub(super) type Most = (usize, &'static str);

/// Steps and what is counted in them: no run comes to an end of more.
pub(super) const MANY: Most = (1_000_000_000, "at most 1000000000");

/// What is kept in memory, one by one.
pub(super) const KEPT: Most = (1_000_000, "at most 1000000");

/// What is kept in pairs.
pub(super) const PAIRED: Most = (10_000, "at most 10000");

/// Refuses a count that is out of its range.
///
/// # Errors
/// [`Error::Setting`] with the value and the range.
pub(super) fn ensure_count(
    setting: &'static str,
    value: usize,
    least: usize,
    most: Most,
) -> Result<()> {
    let range = match least {
        0 => "at least 0",
        1 => "at least 1",
        _ => "at least 2",
    };
    ensure(setting, value, value >= least, range)?;
    ensure(setting, value, value <= most.0, most.1)
}
