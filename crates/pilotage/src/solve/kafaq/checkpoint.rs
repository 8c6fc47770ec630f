//! Stopping a run and going on with it.

use std::path::Path;

use super::settings::Settings;
use super::task::{SOLVER, Task};
use super::{Run, Worlds};
use crate::error::Result;
use crate::model::Model;
use crate::solve::learn::checkpoint::Owner;

impl<'a> Run<'a> {
    /// Writes the state of the run. Whatever happens, the file is then the old checkpoint or the new one.
    ///
    /// # Errors
    /// [`crate::Error::Io`]; the old file is then untouched.
    pub fn save(&self, path: &Path) -> Result<()> {
        self.task.owner().save(&self.state, path)
    }

    /// Goes on with a run of the same model and settings.
    ///
    /// # Errors
    /// [`crate::Error::Checkpoint`] for a file of another model, version, solver or other settings, and for a damaged one; [`crate::Error::Io`] for one that
    /// cannot be read. The file is not touched.
    pub fn resume(
        model: &Model,
        worlds: &'a Worlds<'a>,
        settings: &Settings,
        path: &Path,
    ) -> Result<Self> {
        let task = Task::new(model, settings.clone(), worlds)?;
        let state = task.owner().load(path)?;
        Ok(Self { task, state })
    }
}

impl Task<'_> {
    fn owner(&self) -> Owner<'_, Settings> {
        Owner {
            solver: SOLVER,
            problem: &self.mdp.model().name,
            fingerprint: self.fingerprint,
            settings: &self.settings,
        }
    }
}
