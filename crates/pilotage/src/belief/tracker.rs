//! Keeping a belief: what a filter of any kind makes of actions and readings, and how a policy reads it.
//!
//! A policy sees a belief as a stratum, a mode and a mean ([`Belief`]). What a [`Tracker`] keeps may be richer: whatever it is, agents,
//! learners and compilers know it by this trait alone.

use super::filter::{Belief, Filter};
use crate::model::ActionId;

/// What was sensed after a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reading<'a> {
    /// Numbers: the `m` readings of the sensor.
    Values(&'a [f64]),
    /// One of finitely many signals, counted from 0. A filter that knows numbers only hears nothing in it.
    Symbol(u32),
    /// Nothing: the sensor was silent, or what it said was lost.
    Nothing,
}

impl<'a> Reading<'a> {
    /// The numbers, where there are some.
    pub fn values(self) -> Option<&'a [f64]> {
        match self {
            Self::Values(values) => Some(values),
            Self::Symbol(_) | Self::Nothing => None,
        }
    }
}

impl<'a> From<&'a [f64]> for Reading<'a> {
    fn from(values: &'a [f64]) -> Self {
        Self::Values(values)
    }
}

impl<'a, const M: usize> From<&'a [f64; M]> for Reading<'a> {
    fn from(values: &'a [f64; M]) -> Self {
        Self::Values(values)
    }
}

impl<'a> From<&'a Vec<f64>> for Reading<'a> {
    fn from(values: &'a Vec<f64>) -> Self {
        Self::Values(values)
    }
}

/// Keeps a belief from step to step.
pub trait Tracker: Send {
    /// Back to what is believed before anything was sensed.
    fn reset(&mut self);

    /// Takes in an action and what was sensed after it.
    fn update(&mut self, action: ActionId, reading: Reading<'_>);

    /// What is believed now, as a policy reads it.
    fn belief(&self) -> &Belief;
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
