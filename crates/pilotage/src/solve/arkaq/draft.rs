//! The automaton as it is learned: clusters with actions and values.

use serde::{Deserialize, Serialize};

use super::task::{SOLVER, Task};
use crate::belief::recall::Weights;
use crate::belief::{Cluster, Recall};
use crate::model::ActionId;
use crate::policy::{Automaton, Matching, Node, Place};

/// Nodes before they are compiled.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Draft {
    pub weights: Weights,
    pub nodes: Vec<DraftNode>,
}

/// A cluster, what to do in it, and what that is worth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct DraftNode {
    pub cluster: Cluster,
    pub action: ActionId,
    pub value: f64,
}

impl Draft {
    /// The automaton that a controller runs. Its filter recalls the clusters: each is a mode, with one node.
    pub fn compile(&self, task: &Task<'_>) -> Automaton {
        let mut automaton = Automaton::new(&task.mdp, SOLVER, Matching::Nearest);
        automaton.fingerprint = task.fingerprint;
        let state = &task.mdp.model().state;
        automaton.scale = state
            .iter()
            .map(|variable| variable.bounds.width())
            .collect();
        automaton.modes = (0..self.nodes.len())
            .map(|id| format!("cluster {id}"))
            .collect();
        let levels = 0..=automaton.levels.len() - 1;
        let node = |(id, node): (usize, &DraftNode)| {
            let places = state.iter().zip(&node.cluster.now.place);
            let point = places
                .map(|(variable, x)| variable.bounds.low + x * variable.bounds.width())
                .collect();
            Node::new(
                levels.clone(),
                id,
                Place::Point(point),
                node.action,
                Some(node.value),
            )
        };
        automaton.nodes = self.nodes.iter().enumerate().map(node).collect();
        let clusters = self.nodes.iter().map(|node| node.cluster.clone()).collect();
        let recall = Recall::new(task.mdp.model(), self.weights, clusters);
        automaton.filter = task.filter.clone().recalling(recall);
        automaton
    }
}
