//! Reading a model file.

use std::path::Path;

use serde::Deserialize;

use super::Scenario;
use super::file::ModelFile;
use super::locate::locate;
use super::resolve::resolve;
use crate::files::read as read_file;
use crate::model::{Fault, ModelError, ModelText, Part, Place, error, suggest};

/// Version of the file format that [`read`] reads.
const FORMAT: u64 = 1;

/// Longest model file that is read, MiB.
const MOST_MEBIBYTES: u64 = 8;

/// Reads a scenario from the text of a model file; `origin` says in errors where the text is from.
///
/// # Errors
/// If the text is not TOML, has a key that the format does not have (see [`schema`](super::schema)) or describes a model
/// that is not valid (see [`Scenario::validate`]): with line, column and a hint.
///
/// ```
/// let text = pilotage::scenario::builtin("corridor-blind").ok_or("no corridor")?;
/// let mistaken = text.replace("discount = 0.75", "discount = 1.75");
/// let error = pilotage::scenario::read(&mistaken, "my-corridor.toml").expect_err("a discount above 1");
/// assert!(error.to_string().starts_with("my-corridor.toml:"));
/// assert!(error.message.contains("1.75"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read(text: &str, origin: &str) -> Result<Scenario, ModelError> {
    let parse = || -> Result<Scenario, (std::ops::Range<usize>, String, String)> {
        check_format(text).map_err(|fault| placed(text, fault))?;
        let file = toml::de::Deserializer::parse(text)
            .and_then(ModelFile::deserialize)
            .map_err(|error| in_our_words(&error))?;
        let mut scenario = resolve(file).map_err(|fault| placed(text, fault))?;
        scenario.model.text = ModelText {
            text: Some(own_text(text).into()),
            part: Part::Whole,
        };
        Ok(scenario)
    };
    parse().map_err(|(span, message, hint)| ModelError {
        origin: origin.into(),
        text: text.into(),
        place: Some(Place::of(span, text)),
        message,
        hint,
    })
}

/// Reads a model file.
///
/// # Errors
/// If the file cannot be opened, is not UTF-8 text, or is not a valid model; see [`read`].
pub fn load(path: &Path) -> Result<Scenario, ModelError> {
    read(&text_of(path)?, &path.display().to_string())
}

/// The text of a model file.
///
/// # Errors
/// If the file cannot be opened, or is not UTF-8 text.
pub(super) fn text_of(path: &Path) -> Result<String, ModelError> {
    let origin = path.display().to_string();
    let bytes = read_file(path, MOST_MEBIBYTES).map_err(|error| ModelError {
        origin: origin.as_str().into(),
        text: "".into(),
        place: None,
        message: format!("cannot read the file: {error}"),
        hint: "give the path of a model file, or the name of a built-in model".to_owned(),
    })?;
    String::from_utf8(bytes).map_err(|error| {
        let valid = error.utf8_error().valid_up_to();
        let text = String::from_utf8_lossy(error.as_bytes()).into_owned();
        ModelError {
            origin: origin.as_str().into(),
            place: Some(Place::of(valid..valid, &text)),
            text: text.into(),
            message: "the file is not UTF-8 text".to_owned(),
            hint: "a model file is TOML text; save it as UTF-8".to_owned(),
        }
    })
}

/// The text without the tables of what is true and of rules of thumb, which no policy depends on.
fn own_text(text: &str) -> String {
    let foreign = |header: &str| {
        let name = header.trim_start_matches('[').trim_start();
        ["world", "rule"].iter().any(|table| {
            let rest = name.strip_prefix(table);
            rest.is_some_and(|rest| rest.trim_start().starts_with(['.', ']']))
        })
    };
    let mut skips = false;
    let mut kept = String::with_capacity(text.len());
    for line in text.split_inclusive('\n') {
        if line.starts_with('[') {
            skips = foreign(line);
        }
        if !skips {
            kept.push_str(line);
        }
    }
    kept.truncate(kept.trim_end().len());
    kept.push('\n');
    kept
}

fn placed(text: &str, fault: Fault) -> (std::ops::Range<usize>, String, String) {
    (locate(text, &fault), fault.message, fault.hint)
}

/// A file of another format has other keys, so that its version is looked at first.
fn check_format(text: &str) -> Result<(), Fault> {
    let Ok(root) = toml::de::DeTable::parse(text) else {
        return Ok(());
    };
    let stated = root
        .get_ref()
        .get("format")
        .and_then(|value| value.get_ref().as_integer().cloned());
    match stated {
        Some(integer) if integer.to_string() != FORMAT.to_string() => Err(Fault::new(
            error::Path::new("format"),
            format!("this is format {integer}"),
            format!("this version reads format {FORMAT}"),
        )),
        _ => Ok(()),
    }
}

/// Place, message and hint of an error of the TOML reader.
fn in_our_words(error: &toml::de::Error) -> (std::ops::Range<usize>, String, String) {
    let span = error.span().unwrap_or(0..0);
    let message = error.message();
    let quoted: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
    let (message, hint) = match quoted.as_slice() {
        [unknown, known @ ..] if message.starts_with("unknown field") => (
            format!("unknown key `{unknown}`"),
            suggest(unknown, known.iter().copied()),
        ),
        [unknown, known @ ..] if message.starts_with("unknown variant") => (
            format!("unknown value `{unknown}`"),
            suggest(unknown, known.iter().copied()),
        ),
        [missing] if message.starts_with("missing field") => (
            format!("the key `{missing}` is missing"),
            format!("add `{missing}` to this table"),
        ),
        _ if message.starts_with("duplicate key") => (
            "this name is given twice in one table".to_owned(),
            "rename or delete one of the two".to_owned(),
        ),
        _ if ["invalid type", "invalid value", "invalid length"]
            .iter()
            .any(|kind| message.starts_with(kind)) =>
        {
            let (found, expected) = message
                .split_once(", expected ")
                .unwrap_or((message, "something else"));
            (
                found_in_plain_words(found),
                format!("write {}", expected_in_plain_words(expected)),
            )
        }
        // A word of a list of words was wanted.
        _ if message.starts_with("wanted string") => {
            ("unexpected value".to_owned(), "write a string".to_owned())
        }
        _ => (
            message.to_owned(),
            "this is not TOML; see https://toml.io".to_owned(),
        ),
    };
    (span, message, hint)
}

/// What was found, in everyday words; the found value itself stands in quotes and stays.
fn found_in_plain_words(found: &str) -> String {
    let kind = found.find(['`', '"']).unwrap_or(found.len());
    let plain = [
        ("invalid type: ", "unexpected "),
        ("invalid value: ", "unexpected "),
        ("floating point", "number"),
        ("integer", "number"),
        ("sequence", "list"),
        ("map", "table"),
    ];
    plain
        .iter()
        .fold(found[..kind].to_owned(), |words, (from, to)| {
            words.replace(from, to)
        })
        + &found[kind..]
}

/// What to write instead, in everyday words.
fn expected_in_plain_words(expected: &str) -> &str {
    match expected {
        "f64" => "a number",
        "u64" => "a whole number, not negative",
        "a sequence" => "a list",
        other => other,
    }
}
