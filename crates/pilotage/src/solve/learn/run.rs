//! The loop that every learner is run by: a piece of work at a time, the state kept after each.

use std::ops::ControlFlow;
use std::path::Path;

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::checkpoint::Owner;
use crate::error::{Error, Result};
use crate::policy::Automaton;
use crate::progress::Progress;

/// A learner with its task: how learning begins, how it goes on, and what was learned. All that changes is its state, so that a run can
/// be stopped after any piece of work and gone on with.
pub trait Course {
    /// What it was told. A run is gone on with under the same settings only.
    type Settings: Clone + PartialEq + Serialize + DeserializeOwned;
    /// All that a run has to remember between two pieces of work.
    type State: Serialize + DeserializeOwned;
    /// How learning went.
    type Learning;

    /// Whose run it is.
    fn owner(&self) -> Owner<'_, Self::Settings>;

    /// The state before anything was learned.
    ///
    /// # Errors
    /// The learner's own.
    fn start(&self) -> Result<Self::State>;

    /// Refuses a state that was read from a file and is none of this task, in words.
    ///
    /// # Errors
    /// What does not fit.
    fn check(&self, state: &Self::State) -> std::result::Result<(), String> {
        let _ = state;
        Ok(())
    }

    /// Does one piece of work; breaks when there is nothing more to learn. A state in which there is nothing is left as it is.
    ///
    /// # Errors
    /// The learner's own.
    fn step(&self, state: &mut Self::State, observer: &dyn Progress) -> Result<ControlFlow<()>>;

    /// What was learned so far.
    fn learned(&self, state: &Self::State) -> Learned<Self::Learning>;
}

/// Says of a state whose numbers do not fit together or the task that they do not.
pub(crate) fn fitting(fits: bool) -> std::result::Result<(), String> {
    match fits {
        true => Ok(()),
        false => Err("its numbers do not fit together".to_owned()),
    }
}

/// What a learning run found.
#[derive(Debug, Clone, PartialEq)]
pub struct Learned<L> {
    /// The automaton. It runs without seeing rewards.
    pub automaton: Automaton,
    /// Whether the learner's own test of convergence was passed.
    pub converged: bool,
    /// Steps of experience, trials included.
    pub samples: u64,
    /// How learning went.
    pub learning: L,
}

/// A learning run that can be watched, stopped and resumed.
pub struct Run<C: Course> {
    course: C,
    state: C::State,
}

impl<C: Course> Run<C> {
    /// A run that has not begun.
    ///
    /// # Errors
    /// As [`Course::start`].
    pub fn new(course: C) -> Result<Self> {
        Ok(Self {
            state: course.start()?,
            course,
        })
    }

    /// Goes on with a run of the same model and settings.
    ///
    /// # Errors
    /// [`Error::Checkpoint`] for a file of another model, version, solver or other settings, and for a damaged one; [`Error::Io`] for
    /// one that cannot be read. The file is not touched.
    pub fn resume(course: C, path: &Path) -> Result<Self> {
        let state = course.owner().load(path)?;
        course.check(&state).map_err(|reason| Error::Checkpoint {
            path: path.to_owned(),
            reason: format!("damaged checkpoint: {reason}; delete it to start afresh"),
        })?;
        Ok(Self { course, state })
    }

    /// Writes the state of the run. Whatever happens, the file is then the old checkpoint or the new one.
    ///
    /// # Errors
    /// [`Error::Io`]; the old file is then untouched.
    pub fn save(&self, path: &Path) -> Result<()> {
        self.course.owner().save(&self.state, path)
    }

    /// Does one piece of work; breaks when there is nothing more to learn.
    ///
    /// # Errors
    /// As [`Course::step`].
    pub fn step(&mut self, observer: &dyn Progress) -> Result<ControlFlow<()>> {
        self.course.step(&mut self.state, observer)
    }

    /// What was learned so far.
    pub fn learned(&self) -> Learned<C::Learning> {
        self.course.learned(&self.state)
    }
}

/// Learns until there is nothing more to learn, or until the observer has enough.
///
/// With a checkpoint file the run writes its state there after every piece of work, and goes on from there if the file exists: stopped
/// and resumed, it ends with the same result as if never stopped.
///
/// # Errors
/// As [`Course::start`], [`Course::step`], [`Run::resume`] and [`Run::save`].
pub fn learn<C: Course>(
    course: C,
    checkpoint: Option<&Path>,
    observer: &dyn Progress,
) -> Result<Learned<C::Learning>> {
    let mut run = match checkpoint.filter(|path| path.exists()) {
        Some(path) => Run::resume(course, path)?,
        None => {
            let run = Run::new(course)?;
            // A file that cannot be written is known before work is done that it should keep.
            checkpoint.map_or(Ok(()), |path| run.save(path))?;
            run
        }
    };
    while observer.goes_on().is_continue() {
        let flow = run.step(observer)?;
        checkpoint.map_or(Ok(()), |path| run.save(path))?;
        if flow.is_break() {
            break;
        }
    }
    Ok(run.learned())
}
