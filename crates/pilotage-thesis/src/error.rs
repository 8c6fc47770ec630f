//! What can go wrong while a table or figure is made.

use pilotage::model::ModelError;

/// Why a table or figure could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A problem cannot be read.
    #[error(transparent)]
    Model(Box<ModelError>),
    /// Planning, learning, running or drawing failed.
    #[error(transparent)]
    Library(#[from] pilotage::Error),
    /// Something that an experiment counts on is not there; the message says what.
    #[error("{0}")]
    Missing(String),
}

impl From<ModelError> for Error {
    fn from(error: ModelError) -> Self {
        Self::Model(Box::new(error))
    }
}

/// Result of an experiment.
pub type Result<T> = std::result::Result<T, Error>;
