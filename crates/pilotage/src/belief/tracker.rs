//! Keeping a belief: what a filter of any kind makes of actions and readings, and how a policy reads it.
//!
//! A policy sees a belief as a stratum, a mode and a mean ([`Belief`]). What a [`Tracker`] keeps may be richer: whatever it is, agents,
//! learners and compilers know it by this trait alone.

use super::filter::{Belief, Filter};
use super::reading::Reading;
use super::updater::Held;
use crate::model::ActionId;

/// Keeps a belief from step to step.
pub trait Tracker: Send {
    /// Back to what is believed before anything was sensed.
    fn reset(&mut self);

    /// Takes in an action and what was sensed after it.
    fn update(&mut self, action: ActionId, reading: Reading<'_>);

    /// What is believed now, as a policy reads it.
    fn belief(&self) -> &Belief;

    /// What is believed now, as it is held, where more is known of it than what a policy reads.
    fn held(&self) -> Option<&Held> {
        None
    }
}

/// Makes trackers, each at the start: one for every agent.
pub trait Tracking: Sync {
    /// A tracker of its own.
    fn tracker(&self) -> Box<dyn Tracker + '_>;
}

/// The belief that a [`Filter`] keeps.
#[derive(Debug, Clone)]
pub struct KalmanTracker<'a> {
    filter: &'a Filter,
    belief: Belief,
    scratch: Vec<f64>,
}

impl Tracker for KalmanTracker<'_> {
    fn reset(&mut self) {
        self.filter.reset(&mut self.belief);
    }

    fn update(&mut self, action: ActionId, reading: Reading<'_>) {
        self.filter
            .update(&mut self.belief, action, reading, &mut self.scratch);
    }

    fn belief(&self) -> &Belief {
        &self.belief
    }
}

impl Tracking for Filter {
    fn tracker(&self) -> Box<dyn Tracker + '_> {
        Box::new(KalmanTracker {
            belief: self.initial(),
            scratch: vec![0.0; self.states()],
            filter: self,
        })
    }
}
