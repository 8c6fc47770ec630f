//! A policy of either kind, as a file holds it.

use super::{Automaton, PolicyGraph};
use crate::model::Fingerprint;

/// What a policy file holds.
// There is one at a time, so its size does not matter.
#[allow(clippy::large_enum_variant)]
#[derive(Debug, Clone, PartialEq)]
pub enum Saved {
    /// An automaton, with what keeps its belief.
    Automaton(Automaton),
    /// A policy graph, which needs no belief.
    Graph(PolicyGraph),
}

impl Saved {
    /// Name of the problem it was made for.
    pub fn problem(&self) -> &str {
        match self {
            Self::Automaton(automaton) => &automaton.problem,
            Self::Graph(graph) => &graph.problem,
        }
    }

    /// Name of the solver that made it.
    pub fn solver(&self) -> &str {
        match self {
            Self::Automaton(automaton) => &automaton.solver,
            Self::Graph(graph) => &graph.solver,
        }
    }

    /// Number of its nodes.
    pub fn nodes(&self) -> usize {
        match self {
            Self::Automaton(automaton) => automaton.nodes.len(),
            Self::Graph(graph) => graph.nodes.len(),
        }
    }

    /// Return expected from the start, where the solver knows.
    pub fn planned_value(&self) -> Option<f64> {
        match self {
            Self::Automaton(automaton) => automaton.planned_value,
            Self::Graph(graph) => graph.planned_value,
        }
    }

    pub(super) fn fingerprint(&self) -> Fingerprint {
        match self {
            Self::Automaton(automaton) => automaton.fingerprint,
            Self::Graph(graph) => graph.fingerprint,
        }
    }
}
