//! The models that are compiled in.

use std::path::Path;

use super::read::text_of;
use super::{Scenario, load, read};
use crate::error::is_unseen;
use crate::model::{ModelError, nearest, suggest};

/// How the name of a model file ends.
const SUFFIX: &str = ".toml";

/// Most bytes of a name that is compared with others, and most files that it is compared with.
const LONGEST: usize = 255;
const MOST_FILES: usize = 1_000;

macro_rules! models {
    (in $folder:literal: $($name:literal),* $(,)?) => {
        &[$(($name, include_str!(concat!("../../models/", $folder, $name, ".toml")))),*]
    };
}

/// Name and text of the built-in models, without those of the gallery.
const MODELS: &[(&str, &str)] = models![
    in "":
    "corridor",
    "corridor-blind",
    "corridor-unbounded",
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
    "shuttle-blind",
    "robot-basic",
    "robot-maze-4x4",
    "robot-cart-load-unload",
    "light-dark-5",
    "light-dark-10",
    "light-dark-simple",
    "light-dark-2d",
    "beacons-2d",
    "light-dark-binary",
];

/// Those of the gallery: problems that people have, each with a rule of thumb.
const GALLERY: &[(&str, &str)] = models![
    in "gallery/":
    "thermostat",
    "wear",
    "stock",
    "dock",
    "lane",
    "height",
    "rooms",
    "unicycle",
    "dosing",
];

/// All of them, those of the gallery last.
fn all() -> impl Iterator<Item = (&'static str, &'static str)> {
    MODELS.iter().chain(GALLERY).copied()
}

/// Names of the built-in models, those of the gallery last.
pub fn names() -> impl Iterator<Item = &'static str> {
    all().map(|(name, _)| name)
}

/// Names of those of the built-in models that are the gallery: problems that people have, each with a [rule of
/// thumb](super::Scenario::rule).
pub fn gallery_names() -> impl Iterator<Item = &'static str> {
    GALLERY.iter().map(|&(name, _)| name)
}

/// Text of the built-in model of that name.
pub fn builtin(name: &str) -> Option<&'static str> {
    all()
        .find(|(known, _)| *known == name)
        .map(|(_, text)| text)
}

/// Between the name of a problem and the number of the start that the agent is told.
pub(super) const TOLD: char = '@';

/// Reads the built-in model of that name, or else the model file at that path. With `@2` after it, its agent is told that an episode
/// begins at the second of its starts.
///
/// # Errors
/// If neither exists, with the nearest built-in name or model file as a hint, if the file is not a valid model, or has no such start.
pub fn find(name_or_path: impl AsRef<Path>) -> Result<Scenario, ModelError> {
    let path = name_or_path.as_ref();
    let name = path.to_string_lossy();
    if let Some(scenario) = find_builtin(&name) {
        return scenario;
    }
    if path.exists() {
        return load(path);
    }
    if let Some((of, start)) = with_start(&name)
        && Path::new(of).exists()
    {
        return told(&text_of(Path::new(of))?, start, of);
    }
    let meant = meant(path).map(|meant| format!("did you mean `{meant}`?"));
    if path.components().count() > 1 || path.extension().is_some() {
        return load(path).map_err(|error| ModelError {
            hint: meant.unwrap_or_else(|| error.hint.clone()),
            ..error
        });
    }
    Err(ModelError {
        origin: name.as_ref().into(),
        text: "".into(),
        place: None,
        message: "no built-in model and no file has this name".to_owned(),
        hint: meant.unwrap_or_else(|| suggest(&name, names())),
    })
}

/// Reads the built-in model of that name, `@` and the number of a start after it or not; `None` if there is no such model.
///
/// # Errors
/// If it has no such start.
pub fn find_builtin(name: &str) -> Option<Result<Scenario, ModelError>> {
    if let Some(text) = builtin(name) {
        return Some(read(text, name));
    }
    let (of, start) = with_start(name)?;
    Some(told(builtin(of)?, start, of))
}

/// A name with the number of a start.
fn with_start(name: &str) -> Option<(&str, usize)> {
    let (of, start) = name.rsplit_once(TOLD)?;
    Some((of, start.parse().ok()?))
}

/// The problem of a text whose agent is told its start.
fn told(text: &str, start: usize, origin: &str) -> Result<Scenario, ModelError> {
    let name = read(text, origin)?.model.name;
    // Before the first table of a file is room for a key like this one.
    read(&format!("told = {start}\n{text}"), origin).map_err(|error| ModelError {
        text: "".into(),
        place: None,
        message: format!("{name} cannot be told a start: {}", error.message),
        ..error
    })
}

/// The built-in model, or the model file in the same folder, whose name is nearest to that of `path`.
fn meant(path: &Path) -> Option<String> {
    let here = path.parent()?;
    let stem = path.file_stem()?.to_str()?;
    if stem.len() > LONGEST {
        return None;
    }
    let in_folder = model_files(here).into_iter().filter_map(|file| {
        let other = here.join(&file);
        let stem = file.strip_suffix(SUFFIX)?.to_owned();
        (other != path).then(|| (stem, other.display().to_string()))
    });
    let built_in = names().map(|name| (name.to_owned(), name.to_owned()));
    // Of two that are as near, the first is meant.
    let known: Vec<(String, String)> = if here != Path::new("") {
        in_folder.collect()
    } else if path.extension().is_some() {
        in_folder.chain(built_in).collect()
    } else {
        built_in.chain(in_folder).collect()
    };
    let found = nearest(stem, known.iter().map(|(stem, _)| stem.as_str()))?;
    let (_, shown) = known.iter().find(|(stem, _)| stem == found)?;
    Some(shown.clone())
}

/// Names of the model files in a folder that can be shown, in order; of a very large folder, some of them.
fn model_files(folder: &Path) -> Vec<String> {
    let folder = if folder == Path::new("") {
        Path::new(".")
    } else {
        folder
    };
    let mut files: Vec<String> = std::fs::read_dir(folder)
        .into_iter()
        .flatten()
        .take(MOST_FILES)
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .filter(|name| name.ends_with(SUFFIX) && !name.contains(is_unseen))
        .collect();
    files.sort();
    files
}
