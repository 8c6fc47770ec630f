//! The models that are compiled in.

use super::{Scenario, load, read};
use crate::model::{ModelError, suggest};

macro_rules! models {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_str!(concat!("../../../../models/", $name, ".toml")))),*]
    };
}

/// Name and text of every built-in model.
const MODELS: &[(&str, &str)] = models![
    "corridor",
    "corridor-unbounded",
    "corridor-walls",
    "corridor-declare",
    "tiger",
    "tiger-sd",
    "maze-2d",
    "maze-2d-unbounded",
    "load-unload",
    "n-maze",
    "u-maze",
    "cart-pole",
    "cart-pole-sd",
    "cart-pole-noisy",
    "cart-pole-noisy-sd",
    "scalar-lqg",
    "basic",
    "basic-inner",
    "maze-4x4",
    "cart-load-unload",
    "stations-5x5",
    "shuttle",
    "robot-basic",
    "robot-maze-4x4",
    "robot-cart-load-unload",
];

/// Names of the built-in models.
pub fn names() -> impl Iterator<Item = &'static str> {
    MODELS.iter().map(|&(name, _)| name)
}

/// Text of the built-in model of that name.
pub fn builtin(name: &str) -> Option<&'static str> {
    MODELS
        .iter()
        .find(|&&(known, _)| known == name)
        .map(|&(_, text)| text)
}

/// Reads the built-in model of that name, or else the model file at that path.
///
/// # Errors
/// If neither exists, with the nearest built-in name as a hint, or if the file is not a valid model.
pub fn find(name_or_path: &str) -> Result<Scenario, ModelError> {
    if let Some(text) = builtin(name_or_path) {
        return read(text, name_or_path);
    }
    let path = std::path::Path::new(name_or_path);
    let looks_like_a_path = path.components().count() > 1 || path.extension().is_some();
    if looks_like_a_path || path.exists() {
        return load(path);
    }
    Err(ModelError {
        origin: name_or_path.into(),
        text: "".into(),
        place: None,
        message: "no built-in model and no file has this name".to_owned(),
        hint: suggest(name_or_path, names()),
    })
}
