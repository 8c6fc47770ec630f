//! The automaton as it is learned: regions by level and memory, and edges that change the memory.

use serde::{Deserialize, Serialize};

use super::lattice::CellBox;
use super::memory::{Kind, Memory};
use super::task::{SOLVER, Task};
use crate::belief::{Belief, Filter, Memory as Remembers, Updater};
use crate::model::{ActionId, Region as Place, Steps, Switch, When};
use crate::policy::{Automaton, Matching, Node, Place as Segment};

/// Nodes and edges before they are compiled.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Draft {
    pub nodes: Vec<DraftNode>,
    pub edges: Vec<Edge>,
    pub memory: Memory,
    /// The memory that stands for each memory.
    pub alias: Vec<usize>,
}

/// A region of a memory at a level, given by its place in the chain of levels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct DraftNode {
    pub level: usize,
    pub memory: usize,
    pub cells: CellBox,
    pub action: ActionId,
    pub value: f64,
}

/// "Coming from a region of this memory that takes this action, with the mean now in the box": the memory becomes another.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Edge {
    pub memory: usize,
    pub action: ActionId,
    pub cells: CellBox,
    pub to: usize,
}

impl Draft {
    /// Whether it is one of a task, with this memory.
    pub(super) fn fits(&self, task: &Task<'_>, memory: &Memory) -> bool {
        let (memories, actions) = (memory.len(), task.actions());
        let node = |node: &DraftNode| {
            node.level < task.chain.len()
                && node.memory < memories
                && task.lattice.holds(&node.cells)
                && node.action < actions
        };
        let edge = |edge: &Edge| {
            edge.memory < memories
                && edge.action < actions
                && task.lattice.holds(&edge.cells)
                && edge.to < memories
                && task.coordinates.is_none()
        };
        self.memory == *memory
            && !self.nodes.is_empty()
            && self.nodes.iter().all(node)
            && self.edges.iter().all(edge)
            && self.alias.len() == memories
            && self.alias.iter().all(|alias| *alias < memories)
    }

    /// Whether a memory has a node at the steady level.
    pub(super) fn has_nodes(&self, memory: usize) -> bool {
        self.nodes.iter().any(|node| node.memory == memory)
    }

    /// The automaton that a controller runs.
    pub(super) fn compile(&self, task: &Task<'_>) -> Automaton {
        let mut automaton = Automaton::new(task.space.as_ref(), SOLVER, Matching::Segments);
        automaton.fingerprint = task.fingerprint;
        if let Some(coordinates) = &task.coordinates {
            automaton.scale = vec![1.0; coordinates.count()];
            automaton.coordinates = Some(coordinates.clone());
        }
        automaton.modes = (0..self.memory.len())
            .map(|memory| self.memory.name(memory))
            .collect();
        automaton.nodes = self
            .nodes
            .iter()
            .map(|node| self.compile_node(task, node))
            .collect();
        automaton.updater = self.updater(task);
        automaton
    }

    /// What keeps the belief, with memories for modes.
    fn updater(&self, task: &Task<'_>) -> Updater {
        let switches = self.switches(task);
        let Some(mdp) = task.space.as_mdp() else {
            return task
                .updater
                .clone()
                .remembering(Remembers::Switches(switches));
        };
        let start = Belief {
            mode: self.alias[0],
            ..mdp.start().clone()
        };
        Filter::with_switches(mdp.model(), mdp.levels(), &start, switches).into()
    }

    /// A node also stands for the less certain levels that have no regions of their own.
    fn compile_node(&self, task: &Task<'_>, node: &DraftNode) -> Node {
        let memory = |other: &&DraftNode| other.memory == node.memory && other.level < node.level;
        let before = self
            .nodes
            .iter()
            .filter(memory)
            .map(|other| other.level)
            .max();
        let first = before.map_or(0, |level| level + 1);
        let levels = &task.chain[first..=node.level];
        let (lower, upper) = task.lattice.corners(&node.cells);
        let middle = lower
            .iter()
            .zip(&upper)
            .map(|(low, high)| 0.5 * (low + high))
            .collect();
        let place = Segment::Segment {
            lower,
            minimum: middle,
            upper,
        };
        Node::new(
            levels[0]..=levels[levels.len() - 1],
            node.memory,
            place,
            node.action,
            Some(node.value),
        )
    }

    fn switches(&self, task: &Task<'_>) -> Vec<Switch> {
        let edges = self.edges.iter().map(|edge| Switch {
            actions: Some(vec![edge.action]),
            mode: Some(edge.memory),
            region: task.lattice.place(&edge.cells),
            when: When::After,
            steps: Steps::ALL,
            becomes: self.alias[edge.to],
        });
        let counted = match self.memory.kind {
            Kind::PlaceAndParity(action) => Some(action),
            Kind::None | Kind::Place => None,
        };
        let turns = counted.into_iter().flat_map(|action| {
            (0..self.memory.len()).map(move |memory| Switch {
                actions: Some(vec![action]),
                mode: Some(memory),
                region: Place::everywhere(),
                when: When::After,
                steps: Steps::ALL,
                becomes: self.alias[self.memory.without_event(memory, action)],
            })
        });
        edges.chain(turns).collect()
    }
}
