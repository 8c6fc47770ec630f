//! Policies: what to do at a belief.
//!
//! A [`Policy`] is whatever says what to do at every belief. The one that people keep is the [`Automaton`]: [`Node`]s, each with a
//! [`Place`] among the beliefs and an action, and the filter that keeps the belief. It is saved and read as JSON ([`Automaton::save`],
//! [`Automaton::load`], [`schema`]). An [`AutomatonRunner`] runs it without allocating.
//!
//! A [`PolicyGraph`] is no [`Policy`] in this sense, as it needs no belief: signals of a discrete sensor lead from node to node. A
//! [`GraphRunner`] runs it. Whichever a file holds is [`Saved`].

mod automaton;
mod builder;
mod check;
mod components;
mod convert;
mod coordinates;
mod file;
mod graph;
mod layout;
mod runner;
mod saved;
mod store;
mod tree;

pub use crate::files::{check_writable, write_whole};
pub use automaton::{Automaton, Matching, Node, NodeId, Observed, Place};
pub use coordinates::{Coordinates, MOST_COORDINATES};
pub use file::schema;
pub use graph::{Exit, GraphNode, GraphRunner, PolicyGraph};
pub use runner::AutomatonRunner;
pub use saved::Saved;
pub(crate) use tree::{Asked, StratumFeatures};
pub use tree::{Branch, Feature, Term, Test, Tree};

use crate::belief::{Belief, Held};
use crate::model::ActionId;

/// A rule that says what to do at every belief.
pub trait Policy: Send + Sync {
    /// The action at a belief.
    fn action(&self, belief: &Belief) -> ActionId;

    /// The return expected from taking an action at a belief and following the policy from then on, where it knows.
    fn action_value(&self, belief: &Belief, action: ActionId) -> Option<f64> {
        let _ = (belief, action);
        None
    }

    /// The action at a belief in full: that at what it is read as, unless the policy sees more of it.
    fn action_in_full(&self, held: &Held) -> ActionId {
        self.action(held.belief())
    }

    /// The return expected from each action at a belief in full, where the policy sees more of it than what it is read as.
    fn values_in_full(&self, held: &Held) -> Option<Vec<f64>> {
        let _ = held;
        None
    }

    /// The return the policy expects from a belief, where it knows.
    fn value(&self, belief: &Belief) -> Option<f64> {
        let _ = belief;
        None
    }
}

/// Index of the largest value; of values equal but for rounding, the first.
pub(crate) fn first_best(values: &[f64]) -> usize {
    let mut best = 0;
    for (index, &value) in values.iter().enumerate() {
        if value > values[best] + 1e-12 * values[best].abs().max(1.0) {
            best = index;
        }
    }
    best
}
