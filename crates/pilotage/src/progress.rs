//! The one hook by which algorithms report what they do. Algorithms hold mathematics only; progress bars, logs and plots hang here.
//!
//! Whatever takes time is handed a [`Progress`]: [`Silent`], or one of your own, which may also stop a learner
//! ([`Progress::goes_on`]).

use std::ops::ControlFlow;

/// Watches an algorithm at work. Every method has a default that does nothing.
pub trait Progress: Sync {
    /// A stage of the work has come so far; with nothing done it begins. `total` is 0 where it is not known. Reports of several
    /// threads may come out of order.
    fn progress(&self, stage: &'static str, done: u64, total: u64) {
        let _ = (stage, done, total);
    }

    /// How the work stands now, in a few words that replace the last ones.
    fn status(&self, message: &str) {
        let _ = message;
    }

    /// Something worth a sentence happened.
    fn note(&self, message: &str) {
        let _ = message;
    }

    /// Asked by learners between two pieces of work: whether to go on, or to hand over what was learned so far.
    fn goes_on(&self) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
}

/// Watches nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Progress for Silent {}
