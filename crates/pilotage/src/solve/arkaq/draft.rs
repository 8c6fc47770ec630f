//! The automaton as it is learned: states with actions and values.

use serde::{Deserialize, Serialize};

use super::history::History;
use super::task::{SOLVER, Task};
use crate::belief::{Memory, Recall};
use crate::model::{ActionId, ModeId};
use crate::policy::{Automaton, Matching, Node, Place};

/// Nodes before they are compiled.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Draft {
    pub recall: Recall,
    pub nodes: Vec<DraftNode>,
}

/// What is remembered, what to do then, and what that is worth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct DraftNode {
    pub history: History,
    pub action: ActionId,
    pub value: f64,
}

impl Draft {
    /// Whether it is one that a task can have.
    pub(super) fn fits(&self, task: &Task<'_>) -> bool {
        let (actions, depth) = (task.actions(), task.settings.depth);
        let clusters = self.recall.clusters().len();
        let node =
            |node: &DraftNode| node.history.fits(clusters, actions, depth) && node.action < actions;
        let axes = task.extents().len();
        self.recall.fits(axes, actions, self.nodes.len()) && self.nodes.iter().all(node)
    }

    /// The same with some nodes put for others: `into` says by node which one, itself if it stays.
    pub(super) fn merged(&self, into: &[ModeId]) -> Self {
        let nodes = self.nodes.iter().enumerate();
        let kept = nodes.filter(|(id, _)| into[*id] == *id);
        Self {
            recall: self.recall.merged(into),
            nodes: kept.map(|(_, node)| node.clone()).collect(),
        }
    }

    /// How far two nodes are from each other.
    pub(super) fn apart(&self, a: usize, b: usize) -> f64 {
        let clusters = self.recall.clusters();
        self.nodes[a]
            .history
            .apart(&self.nodes[b].history, clusters)
    }

    /// The automaton that a controller runs. What its filter recalls are its modes, with one node each.
    pub(super) fn compile(&self, task: &Task<'_>) -> Automaton {
        let mut automaton = Automaton::new(task.space.as_ref(), SOLVER, Matching::Nearest);
        automaton.fingerprint = task.fingerprint;
        let model = task.body();
        automaton.scale = model
            .state
            .iter()
            .map(|variable| variable.bounds.width())
            .collect();
        let name = |node: &DraftNode| node.history.name(&automaton.actions);
        automaton.modes = self.nodes.iter().map(name).collect();
        let levels = 0..=automaton.levels.len() - 1;
        let centres = self.recall.clusters().centres();
        let node = |(id, node): (usize, &DraftNode)| {
            Node::new(
                levels.clone(),
                id,
                Place::Point(centres[node.history.cluster][..model.state_dim()].to_vec()),
                node.action,
                Some(node.value),
            )
        };
        automaton.nodes = self.nodes.iter().enumerate().map(node).collect();
        let recalling = Memory::Recall(self.recall.clone());
        automaton.updater = task.updater.clone().remembering(recalling);
        automaton
    }
}
