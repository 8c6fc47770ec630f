//! Agents: a belief and a policy, put together so that they can act.

use crate::belief::{Belief, Held, Reading, Tracker, Tracking};
use crate::model::ActionId;
use crate::policy::{Automaton, GraphRunner, NodeId, Policy};

/// Something that acts on what it senses.
pub trait Agent: Send {
    /// Forgets everything and believes the start.
    fn reset(&mut self);

    /// Chooses an action.
    fn act(&mut self) -> ActionId;

    /// Takes in what was sensed after the action.
    fn observe(&mut self, action: ActionId, reading: Reading<'_>);

    /// The belief it acts on now; `None` for one that keeps none.
    fn belief(&self) -> Option<&Belief>;

    /// The same as it is held, where more is known of it than what a policy reads.
    fn held(&self) -> Option<&Held> {
        None
    }

    /// The node of an automaton at which its belief is; `None` only without nodes or a belief.
    fn node(&self, automaton: &Automaton) -> Option<NodeId> {
        match self.held() {
            Some(held) => automaton.matched_in_full(held),
            None => automaton.matched(self.belief()?),
        }
    }

    /// All that it believes now, with weights that sum to 1; nothing where it keeps no belief.
    fn hypotheses(&self) -> Vec<(f64, &Belief)> {
        self.belief()
            .map(|belief| (1.0, belief))
            .into_iter()
            .collect()
    }
}

/// A tracker and a policy.
pub struct TrackingAgent<'a> {
    tracker: Box<dyn Tracker + 'a>,
    policy: &'a dyn Policy,
}

impl<'a> TrackingAgent<'a> {
    /// The agent at the start of an episode.
    pub fn new(tracking: &'a dyn Tracking, policy: &'a dyn Policy) -> Self {
        Self {
            tracker: tracking.tracker(),
            policy,
        }
    }

    /// The belief of now.
    pub(crate) fn believed(&self) -> &Belief {
        self.tracker.belief()
    }
}

impl Agent for TrackingAgent<'_> {
    fn reset(&mut self) {
        self.tracker.reset();
    }

    fn act(&mut self) -> ActionId {
        match self.tracker.held() {
            Some(held) => self.policy.action_in_full(held),
            None => self.policy.action(self.tracker.belief()),
        }
    }

    fn observe(&mut self, action: ActionId, reading: Reading<'_>) {
        self.tracker.update(action, reading);
    }

    fn belief(&self) -> Option<&Belief> {
        Some(self.believed())
    }

    fn held(&self) -> Option<&Held> {
        self.tracker.held()
    }
}

/// A policy graph acts on what it senses, and on nothing else.
impl Agent for GraphRunner {
    fn reset(&mut self) {
        self.reset();
    }

    fn act(&mut self) -> ActionId {
        self.decide().1
    }

    fn observe(&mut self, _action: ActionId, reading: Reading<'_>) {
        self.observe(reading);
    }

    fn belief(&self) -> Option<&Belief> {
        None
    }
}
