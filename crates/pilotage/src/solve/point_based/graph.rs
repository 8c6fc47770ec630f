//! Policies of discrete sensors as graphs: an action a node, and where to go after each signal.
//!
//! Every vector is the value of a graph that exists: its action, and the vectors it was backed up from. That of the start is exact, but
//! holds every round there was. It is made smaller, and better, by what is believed where: each way goes on with the node that is best
//! for the beliefs that come along it, and nodes are taken for others where that costs little. Each change is kept only if the exact
//! value of the whole graph stays.
//!
//! # References
//! - E. A. Hansen, "Solving POMDPs by searching in policy space", 1998: graphs, and their values by linear equations.
//! - P. Poupart and C. Boutilier, "Bounded finite state controllers", 2003: improving nodes for the beliefs in which they are met.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use nalgebra::DMatrix;

use super::SOLVER;
use super::backup::Backup;
use super::occupied::shares;
use super::point::{ValueVector, VectorSet};
use crate::belief::Keeping;
use crate::model::{ActionId, Model};
use crate::parallel;
use crate::policy::{GraphNode, PolicyGraph};

/// Values of nodes are iterated until they change by less than this share of the largest, or so often.
const CLOSE: f64 = 1e-8;
const SWEEPS: usize = 20_000;

/// A node of a policy.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Node {
    /// What to do.
    pub(super) action: ActionId,
    /// Where to go after each signal, and last, after none. Empty if the episode never goes on.
    pub(super) next: Vec<usize>,
}

/// A policy that needs no belief, with what it is worth. It begins, and after a restart goes on, at the first node.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Graph {
    /// The nodes, all of which can be reached from the first.
    pub(super) nodes: Vec<Node>,
    /// What each node earns from every mode and cell, without end.
    pub(super) values: Vec<Vec<f64>>,
    /// What it earns from the start.
    pub(super) value: f64,
}

/// What it takes to value graphs.
pub(super) struct Grapher<'a> {
    pub(super) backup: &'a Backup,
    /// By action: how likely each signal is, by mode and cell; the last row is that of none.
    pub(super) likely: Vec<DMatrix<f64>>,
    /// By action, whether the episode may go on.
    pub(super) goes_on: Vec<bool>,
}

impl<'a> Grapher<'a> {
    pub(super) fn new(backup: &'a Backup) -> Self {
        use super::signals::Partition;
        let keeping = &*backup.keeping;
        let states: Vec<usize> = (0..keeping.states()).collect();
        let ones = vec![1.0; states.len()];
        let likely = |action| Partition::Signals.likelihoods(keeping, action, &states);
        let goes_on = |action| keeping.backward(action, &ones).iter().any(|x| *x > 0.0);
        Self {
            backup,
            likely: (0..keeping.actions()).map(likely).collect(),
            goes_on: (0..keeping.actions()).map(goes_on).collect(),
        }
    }

    /// The graph that the best vector of the start stands for.
    pub(super) fn of(&self, set: &VectorSet) -> Graph {
        let best = set.best(&self.backup.start).0;
        let root = set.vectors[best].clone();
        let mut numbers: HashMap<*const ValueVector, usize> = HashMap::new();
        numbers.insert(Arc::as_ptr(&root), 0);
        let mut found = vec![root];
        let mut asked = 0;
        while asked < found.len() {
            for next in found[asked].next.clone().into_iter().flatten() {
                let number = found.len();
                if *numbers.entry(Arc::as_ptr(&next)).or_insert(number) == number {
                    found.push(next);
                }
            }
            asked += 1;
        }
        let node = |(index, vector): (usize, &Arc<ValueVector>)| {
            let action = vector.action;
            let signals = self.likely[action].nrows();
            let next = match &vector.next {
                _ if !self.goes_on[action] => Vec::new(),
                // Where a vector knows of nothing that comes after it, others may: they do the same again.
                Some(next) if !next.is_empty() => {
                    let next = next.iter();
                    next.map(|next| numbers[&Arc::as_ptr(next)]).collect()
                }
                _ => vec![index; signals],
            };
            Node { action, next }
        };
        let nodes = found.iter().enumerate().map(node).collect();
        let values = found.iter().map(|vector| vector.values.clone()).collect();
        self.valued(nodes, values)
    }

    /// A graph with its values, iterated from others.
    pub(super) fn valued(&self, nodes: Vec<Node>, mut values: Vec<Vec<f64>>) -> Graph {
        let discount = self.backup.discount;
        for _ in 0..SWEEPS {
            let start = self.backup.start.expected(&values[0]);
            let next = parallel::map(nodes.len(), |node| {
                self.values(&nodes[node], &values, start)
            });
            let (change, largest) = change(&values, &next);
            values = next;
            if change <= CLOSE * (1.0 - discount) * largest {
                break;
            }
        }
        Graph {
            value: self.backup.start.expected(&values[0]),
            nodes,
            values,
        }
    }

    /// The graph as it is kept: what it earns in an episode, and what of it is met there.
    pub(super) fn told(&self, model: &Model, graph: &Graph) -> PolicyGraph {
        let length = model.episode.length;
        let shares = shares(self, graph, length);
        let ways = shares.visits.into_iter().zip(shares.gone);
        let nodes = graph.nodes.iter().zip(ways);
        let nodes = nodes.map(|(node, (visits, gone))| GraphNode {
            action: node.action,
            next: node.next.clone(),
            visits,
            gone,
        });
        PolicyGraph {
            planned_value: Some(self.earned(&graph.nodes, length)),
            nodes: nodes.collect(),
            ..PolicyGraph::new(model, SOLVER)
        }
    }

    /// What a graph earns from the start in an episode of so many steps.
    pub(super) fn earned(&self, nodes: &[Node], length: usize) -> f64 {
        let mut values = vec![vec![0.0; self.backup.keeping.states()]; nodes.len()];
        for _ in 0..length {
            let start = self.backup.start.expected(&values[0]);
            values = parallel::map(nodes.len(), |node| {
                self.values(&nodes[node], &values, start)
            });
        }
        self.backup.start.expected(&values[0])
    }

    /// What a node is worth where others are worth `values`.
    fn values(&self, node: &Node, values: &[Vec<f64>], start: f64) -> Vec<f64> {
        let likely = &self.likely[node.action];
        let mut later = vec![0.0; likely.ncols()];
        for (signal, next) in node.next.iter().enumerate() {
            let next = &values[*next];
            for (state, later) in later.iter_mut().enumerate() {
                *later += likely[(signal, state)] * next[state];
            }
        }
        self.backup.before(node.action, &later, start)
    }
}

/// Largest change, and largest value.
fn change(old: &[Vec<f64>], new: &[Vec<f64>]) -> (f64, f64) {
    let pairs = old.iter().flatten().zip(new.iter().flatten());
    pairs.fold((0.0, 0.0), |(change, largest): (f64, f64), (a, b)| {
        (change.max((a - b).abs()), largest.max(b.abs()))
    })
}

/// Takes nodes that do the same for one, again and again.
pub(super) fn merged(mut graph: Graph) -> Graph {
    loop {
        let mut known: BTreeMap<(ActionId, Vec<usize>), usize> = BTreeMap::new();
        let becomes: Vec<usize> = graph
            .nodes
            .iter()
            .enumerate()
            .map(|(index, node)| {
                *known
                    .entry((node.action, node.next.clone()))
                    .or_insert(index)
            })
            .collect();
        if becomes.iter().enumerate().all(|(node, one)| node == *one) {
            return graph;
        }
        graph = redirected(graph, &becomes);
    }
}

/// The graph whose ways lead to other nodes, without those that are no longer reached.
fn redirected(graph: Graph, becomes: &[usize]) -> Graph {
    let mut nodes = graph.nodes;
    for next in nodes.iter_mut().flat_map(|node| &mut node.next) {
        *next = becomes[*next];
    }
    let (nodes, values) = reached(&nodes, &graph.values, becomes[0]);
    Graph {
        nodes,
        values,
        value: graph.value,
    }
}

/// The nodes that are reached from one of them, which comes first, with their values.
pub(super) fn reached(
    nodes: &[Node],
    values: &[Vec<f64>],
    first: usize,
) -> (Vec<Node>, Vec<Vec<f64>>) {
    let mut order = vec![first];
    let mut numbers = BTreeMap::from([(first, 0)]);
    let mut asked = 0;
    while asked < order.len() {
        for next in &nodes[order[asked]].next {
            let number = order.len();
            if *numbers.entry(*next).or_insert(number) == number {
                order.push(*next);
            }
        }
        asked += 1;
    }
    let node = |index: &usize| Node {
        action: nodes[*index].action,
        next: nodes[*index]
            .next
            .iter()
            .map(|next| numbers[next])
            .collect(),
    };
    let values = order.iter().map(|index| values[*index].clone());
    (order.iter().map(node).collect(), values.collect())
}
