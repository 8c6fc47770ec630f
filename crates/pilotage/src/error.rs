//! Errors of planning, learning and running. Errors of model files are [`crate::model::ModelError`].

use std::path::PathBuf;

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
    /// A saved policy cannot be used here.
    #[error("{origin}: {reason}")]
    Policy {
        /// File or other source of the policy.
        origin: String,
        /// What does not fit, and what to do.
        reason: String,
    },
    /// A checkpoint cannot be gone on with.
    #[error("{}: {reason}", path.display())]
    Checkpoint {
        /// The file.
        path: PathBuf,
        /// What does not fit, and what to do.
        reason: String,
    },
    /// A file could not be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
}

/// Result of everything but reading a model.
pub type Result<T> = std::result::Result<T, Error>;
