//! Errors of planning, learning and running. Errors of model files are [`crate::model::ModelError`].

use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// What went wrong, with the numbers and places needed to mend it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A matrix that has to be inverted or factored cannot be.
    #[error("{what} is not positive definite (its smallest eigenvalue is {eigenvalue:e})")]
    NotPositiveDefinite {
        /// The matrix, in words.
        what: &'static str,
        /// Its smallest eigenvalue.
        eigenvalue: f64,
    },
    /// The Riccati recursion has no limit, or not one that every start reaches.
    #[error(
        "the {what} has no steady state: after {steps} steps its matrix still changes by {change:e} in the direction [{direction}]; {remedy}"
    )]
    NoSteadyState {
        /// What the recursion is of: a filter, whose matrix is the covariance, or a regulator, whose matrix is the cost.
        what: &'static str,
        /// Steps of the recursion that were tried.
        steps: u64,
        /// Largest change of an entry in the last of them.
        change: f64,
        /// The unit vector along which the matrix changes most, comma-separated.
        direction: String,
        /// What to change in the model.
        remedy: &'static str,
    },
    /// The uncertainty of a belief cannot be computed.
    #[error(
        "uncertainty level {level} is that of no belief: {entry} of {what} is {value:e}; the numbers of A, H and the noises are too large, or too far apart, to be multiplied: state the model in units, and with time steps, in which they are nearer to 1"
    )]
    Level {
        /// The level, counted from the start.
        level: usize,
        /// The matrix.
        what: String,
        /// Which number of it.
        entry: String,
        /// The number.
        value: f64,
    },
    /// There are more uncertainty levels than there is room for.
    #[error(
        "{levels} uncertainty levels of this model take {mebibytes} MiB, and there are more; set `level_limit` in [belief] to {levels} or less, or `level_tolerance` higher"
    )]
    TooManyLevels {
        /// Levels that there is room for.
        levels: usize,
        /// Memory that they take, MiB.
        mebibytes: usize,
    },
    /// A solver was given a model it is not made for.
    #[error("{solver} does not accept {model}: {reason}")]
    Unsupported {
        /// Name of the solver.
        solver: &'static str,
        /// Name of the model.
        model: String,
        /// Why, and what would do.
        reason: String,
    },
    /// Nothing has this name.
    #[error("there is no {what} `{name}` (hint: {hint})")]
    Unknown {
        /// What kind of thing was named.
        what: &'static str,
        /// The name given.
        name: String,
        /// The nearest name there is, or all of them.
        hint: String,
    },
    /// A setting is out of range.
    #[error("{setting} = {value} is out of range: {range}")]
    Setting {
        /// Name of the setting.
        setting: &'static str,
        /// The value given.
        value: String,
        /// What is allowed.
        range: &'static str,
    },
    /// A setting of a solver was given what is no value of it: no finite number, or none of its words.
    #[error("{setting} = {value} is no value of it: {about}")]
    NoValue {
        /// Name of the setting.
        setting: String,
        /// What was given.
        value: String,
        /// What the setting means, and its range.
        about: String,
    },
    /// Numbers shown to a network that it cannot take.
    #[error("{place} = {value} is refused: {reason}")]
    Input {
        /// Which number.
        place: String,
        /// The number.
        value: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A number that has to be finite is not.
    #[error("{what} is {value} ({place}): {remedy}")]
    NotFinite {
        /// The number, in words.
        what: String,
        /// The number.
        value: f64,
        /// Where it was met.
        place: String,
        /// What to change.
        remedy: &'static str,
    },
    /// The problem needs more memory than is allowed.
    #[error(
        "{model} needs a grid of {points} points ({mebibytes} MiB), more than the {limit} MiB allowed; raise --memory or make the grid coarser with --grid"
    )]
    TooLarge {
        /// Name of the model.
        model: String,
        /// Points of the grid, all levels and modes together.
        points: u64,
        /// Memory they take, MiB.
        mebibytes: u64,
        /// Memory allowed, MiB.
        limit: u64,
    },
    /// The problem needs more memory than there is.
    #[error(
        "{model} needs a grid of {points} points ({mebibytes} MiB), and {available} MiB are free here; make the grid coarser with --grid"
    )]
    OutOfMemory {
        /// Name of the model.
        model: String,
        /// Points of the grid, all levels and modes together.
        points: u64,
        /// Memory they take, MiB.
        mebibytes: u64,
        /// Memory that is free, MiB.
        available: u64,
    },
    /// An agent no longer had a belief to act on.
    #[error(
        "in episode {episode} the mean of the belief is {largest:e} or more after step {step}: the state, or the filter's numbers, grow without end; let the motion of the model die out, shorten its episodes, or solve again if the policy was edited"
    )]
    Lost {
        /// Number of the first episode in which it happened, from 0.
        episode: u64,
        /// Steps of that episode until then.
        step: usize,
        /// The magnitude from which on filters keep no mean.
        largest: f64,
    },
    /// A saved policy cannot be used here.
    #[error("{origin}: {reason}")]
    Policy {
        /// File or other source of the policy.
        origin: String,
        /// What does not fit, and what to do.
        reason: String,
    },
    /// A checkpoint cannot be gone on with.
    #[error("{}: {reason}", shown(path))]
    Checkpoint {
        /// The file.
        path: PathBuf,
        /// What does not fit, and what to do.
        reason: String,
    },
    /// A file could not be read or written.
    #[error("{}: {source}", shown(path))]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
}

/// A file name as it can be shown anywhere.
fn shown(path: &Path) -> String {
    visible(&path.display().to_string()).into_owned()
}

/// Whether a character is not seen where it stands but changes what is seen: control characters, which terminals obey, and marks that
/// turn the direction of writing. Line breaks and tabs count.
pub(crate) fn is_unseen(character: char) -> bool {
    character.is_control()
        || matches!(
            character,
            '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}'
        )
}

/// The text with an escape such as `\u{1b}` for every control character and mark of direction but line breaks and tabs, so that it can
/// be shown on a terminal wherever it is from.
pub fn visible(text: &str) -> Cow<'_, str> {
    let hidden = |character: char| is_unseen(character) && !matches!(character, '\n' | '\t');
    if !text.contains(hidden) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len() + 8);
    for character in text.chars() {
        if hidden(character) {
            shown.extend(character.escape_unicode());
        } else {
            shown.push(character);
        }
    }
    Cow::Owned(shown)
}

/// Result of everything but reading a model.
pub type Result<T> = std::result::Result<T, Error>;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_terminals_obey_is_shown_and_the_rest_stays() {
        for (text, shown) in [
            ("naïve – 走廊\n\ttab", "naïve – 走廊\n\ttab"),
            ("\u{1b}[31mred", "\\u{1b}[31mred"),
            ("back\u{8}\r", "back\\u{8}\\u{d}"),
            ("\u{9b}2J", "\\u{9b}2J"),
            ("\u{202e}gpj.exe", "\\u{202e}gpj.exe"),
        ] {
            assert_eq!(visible(text), shown);
        }
    }
}
