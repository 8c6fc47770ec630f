//! What is wrong with a model, and where: by the key of the model file, or by line and column of its text.

use std::fmt;
use std::ops::Range;
use std::sync::Arc;

/// A step from one value of a model file to a value inside it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Step {
    /// Into a table, by key.
    Key(String),
    /// Into a list, counting from 0. Two indices into a map's drawing are row and column.
    Index(usize),
}

/// Where in a model something stands, in the words of the model file: `actions.EAST.noise[0][1]`.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Path(Vec<Step>);

impl Path {
    /// The path of one key at the top of the file.
    pub(crate) fn new(key: &str) -> Self {
        Self::default().key(key)
    }

    /// The path of a key inside this table.
    #[must_use]
    pub(crate) fn key(mut self, key: &str) -> Self {
        self.0.push(Step::Key(key.to_owned()));
        self
    }

    /// The path of an item of this list.
    #[must_use]
    pub(crate) fn index(mut self, index: usize) -> Self {
        self.0.push(Step::Index(index));
        self
    }

    /// The steps from the top of the file.
    pub fn steps(&self) -> &[Step] {
        &self.0
    }

    /// Renumbers the items of a list at the top of the file.
    pub(crate) fn renumber(&mut self, list: &str, new_index: &[usize]) {
        if let [Step::Key(key), Step::Index(index), ..] = self.0.as_mut_slice()
            && key == list
            && let Some(&new) = new_index.get(*index)
        {
            *index = new;
        }
    }
}

impl fmt::Display for Path {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, step) in self.0.iter().enumerate() {
            match step {
                Step::Key(key) if i == 0 => write!(f, "{key}")?,
                Step::Key(key) => write!(f, ".{key}")?,
                Step::Index(index) => write!(f, "[{index}]")?,
            }
        }
        Ok(())
    }
}

/// Something wrong in a model, found by [`Model::validate`](super::Model::validate).
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{path}: {message} (hint: {hint})")]
pub struct Fault {
    /// What it is about, by its key in the model file.
    pub path: Path,
    /// Whether the key itself is wrong, and not its value.
    pub on_key: bool,
    /// What is wrong.
    pub message: String,
    /// What to do about it.
    pub hint: String,
}

impl Fault {
    /// A fault of the value at `path`.
    pub(crate) fn new(path: Path, message: impl Into<String>, hint: impl Into<String>) -> Self {
        Self {
            path,
            on_key: false,
            message: message.into(),
            hint: hint.into(),
        }
    }

    /// A fault of the last key of `path`.
    pub(crate) fn of_key(path: Path, message: impl Into<String>, hint: impl Into<String>) -> Self {
        Self {
            on_key: true,
            ..Self::new(path, message, hint)
        }
    }

    /// The value at `path` names something that is not among the `known`.
    pub(crate) fn unknown<'a>(
        path: Path,
        kind: &str,
        name: &str,
        known: impl IntoIterator<Item = &'a str>,
    ) -> Self {
        Self::new(
            path,
            format!("unknown {kind} `{name}`"),
            suggest(name, known),
        )
    }
}

/// The known name that is nearest to `name`, if one is near enough to have been meant.
pub(crate) fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let folded = name.to_lowercase();
    known
        .into_iter()
        .map(|known| {
            (
                strsim::damerau_levenshtein(&folded, &known.to_lowercase()),
                known,
            )
        })
        .filter(|(distance, known)| *distance <= 1 + known.chars().count() / 3)
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, nearest)| nearest)
}

/// A hint towards the known name that is nearest to `name`, or a list of all known ones.
pub fn suggest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    let known: Vec<&str> = known
        .into_iter()
        .filter(|known| !known.is_empty())
        .collect();
    match nearest(name, known.iter().copied()) {
        Some(nearest) => format!("did you mean `{nearest}`?"),
        None if known.is_empty() => "none is declared in this file".to_owned(),
        None => format!("known here: `{}`", known.join("`, `")),
    }
}

/// A place in a text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// Bytes of the text it covers.
    pub span: Range<usize>,
    /// Line, counting from 1.
    pub line: usize,
    /// Column in characters, counting from 1.
    pub column: usize,
}

impl Place {
    /// The place of a span of bytes; a span that is not inside the text is moved to where it fits.
    pub(crate) fn of(span: Range<usize>, text: &str) -> Self {
        let mut start = span.start.min(text.len());
        while !text.is_char_boundary(start) {
            start -= 1;
        }
        let end = span.end.clamp(start, text.len().max(start));
        let before = &text[..start];
        let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
        Self {
            span: start..end,
            line: before.matches('\n').count() + 1,
            column: before[line_start..].chars().count() + 1,
        }
    }
}

/// Why a model file could not be read. Shown as `origin:line:column: message (hint: ...)`.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{origin}{}: {message} (hint: {hint})", shown(.place))]
pub struct ModelError {
    /// The file, or the name of a built-in model.
    pub origin: Arc<str>,
    /// Text of the file; empty when it could not be opened.
    pub text: Arc<str>,
    /// Where in the text; `None` when it could not be opened.
    pub place: Option<Place>,
    /// What is wrong.
    pub message: String,
    /// What to do about it.
    pub hint: String,
}

fn shown(place: &Option<Place>) -> String {
    place.as_ref().map_or_else(String::new, |place| {
        format!(":{}:{}", place.line, place.column)
    })
}
