//! Agents: a belief and a policy, put together so that they can act.

use crate::belief::{Belief, Filter};
use crate::model::ActionId;
use crate::policy::Policy;

/// Something that acts on what it senses.
pub trait Agent: Send {
    /// Forgets everything and believes the start.
    fn reset(&mut self);

    /// Chooses an action.
    fn act(&mut self) -> ActionId;

    /// Takes in what was sensed (length `m`) after the action.
    fn observe(&mut self, action: ActionId, observation: &[f64]);

    /// The belief it acts on now.
    fn belief(&self) -> &Belief;

    /// All that it believes now, with weights that sum to 1.
    fn hypotheses(&self) -> Vec<(f64, &Belief)> {
        vec![(1.0, self.belief())]
    }
}

/// A Kalman filter and a policy.
pub struct FilterAgent<'a> {
    filter: &'a Filter,
    policy: &'a dyn Policy,
    belief: Belief,
    scratch: Vec<f64>,
}

impl<'a> FilterAgent<'a> {
    /// The agent at the start of an episode.
    pub fn new(filter: &'a Filter, policy: &'a dyn Policy) -> Self {
        Self {
            filter,
            policy,
            belief: filter.initial(),
            scratch: vec![0.0; filter.states()],
        }
    }
}

impl Agent for FilterAgent<'_> {
    fn reset(&mut self) {
        self.filter.reset(&mut self.belief);
    }

    fn act(&mut self) -> ActionId {
        self.policy.action(&self.belief)
    }

    fn observe(&mut self, action: ActionId, observation: &[f64]) {
        self.filter
            .update(&mut self.belief, action, observation, &mut self.scratch);
    }

    fn belief(&self) -> &Belief {
        &self.belief
    }
}
