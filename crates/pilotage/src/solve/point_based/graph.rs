//! Policies of discrete sensors as graphs: an action a node, and where to go after each signal.
//!
//! # References
//! - E. A. Hansen, "Solving POMDPs by searching in policy space", 1998: graphs, and their values by linear equations.
//! - S. Ji, R. Parr, H. Li, X. Liao and L. Carin, "Point-based policy iteration", 2007: graphs by backups at beliefs.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::sync::Arc;

use super::backup::{Backup, Choice};
use super::point::{Point, ValueVector, VectorSet};
use crate::model::ActionId;
use crate::parallel;

/// Values of nodes are iterated until they change by less than this share of the largest, or so often.
const CLOSE: f64 = 1e-9;
const SWEEPS: usize = 20_000;

/// A node of a policy.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PolicyNode {
    /// What to do.
    pub action: ActionId,
    /// Where to go after each signal, and last, after none. Empty if the episode never goes on.
    pub next: Vec<usize>,
}

/// A policy that needs no belief. It begins, and after a restart goes on, at the first node.
#[derive(Debug, Clone, PartialEq)]
pub struct PolicyGraph {
    /// The nodes, all of which can be reached from the first.
    pub nodes: Vec<PolicyNode>,
    /// What each node earns from every mode and cell.
    pub values: Vec<Vec<f64>>,
    /// What it earns from the start.
    pub value: f64,
    /// For each node the belief for which it was made.
    witnesses: Vec<Option<Arc<Point>>>,
}

impl PolicyGraph {
    /// The graph of acting by one look ahead at the witness of every vector.
    pub(super) fn new(backup: &Backup, set: &VectorSet) -> Self {
        let made = merged(reached(backup, set));
        let values = values(backup, &made);
        Self {
            value: backup.start.expected(&values[0]),
            nodes: made.iter().map(|made| made.node.clone()).collect(),
            witnesses: made.into_iter().map(|made| made.witness).collect(),
            values,
        }
    }

    /// Its nodes as vectors: what is earned by a policy that exists.
    pub(super) fn vectors(&self) -> Vec<Arc<ValueVector>> {
        let vector = |node: usize| {
            Arc::new(ValueVector {
                action: self.nodes[node].action,
                values: self.values[node].clone(),
                witness: self.witnesses[node].clone(),
            })
        };
        (0..self.nodes.len()).map(vector).collect()
    }
}

/// A node, and what it was made of.
#[derive(Debug, Clone)]
struct Made {
    node: PolicyNode,
    choice: Choice,
    witness: Option<Arc<Point>>,
}

/// Nodes reached from the start: first its own, then those of vectors, each backed up at its witness.
fn reached(backup: &Backup, set: &VectorSet) -> Vec<Made> {
    let mut numbers = BTreeMap::new();
    let start = Arc::new(backup.start.clone());
    let mut found = vec![(backup.choose(&start, set), Some(start))];
    let mut asked = 0;
    while asked < found.len() {
        for pick in found[asked].0.picks.clone() {
            if let Entry::Vacant(entry) = numbers.entry(pick) {
                entry.insert(found.len());
                found.push(at_witness(backup, set, pick));
            }
        }
        asked += 1;
    }
    let made = |(choice, witness): (Choice, Option<Arc<Point>>)| Made {
        node: PolicyNode {
            action: choice.action,
            next: choice.picks.iter().map(|pick| numbers[pick]).collect(),
        },
        choice,
        witness,
    };
    found.into_iter().map(made).collect()
}

/// What to do where a vector is best. One without a witness repeats its action for ever.
fn at_witness(backup: &Backup, set: &VectorSet, vector: usize) -> (Choice, Option<Arc<Point>>) {
    match &set.vectors[vector].witness {
        Some(point) => (backup.choose(point, set), Some(point.clone())),
        None => (backup.repeat(vector, set), None),
    }
}

/// Takes nodes that do the same for one, again and again.
fn merged(mut made: Vec<Made>) -> Vec<Made> {
    loop {
        let mut known: BTreeMap<(ActionId, Vec<usize>), usize> = BTreeMap::new();
        let mut becomes = Vec::with_capacity(made.len());
        let mut kept: Vec<Made> = Vec::new();
        for one in &made {
            let next = kept.len();
            let key = (one.node.action, one.node.next.clone());
            let number = *known.entry(key).or_insert(next);
            if number == next {
                kept.push(one.clone());
            }
            becomes.push(number);
        }
        if kept.len() == made.len() {
            return made;
        }
        for next in kept.iter_mut().flat_map(|one| &mut one.node.next) {
            *next = becomes[*next];
        }
        made = kept;
    }
}

/// What each node earns from every mode and cell.
fn values(backup: &Backup, made: &[Made]) -> Vec<Vec<f64>> {
    let choice = |one: &Made| Choice {
        picks: one.node.next.clone(),
        ..one.choice.clone()
    };
    let choices: Vec<Choice> = made.iter().map(choice).collect();
    let mut values = vec![vec![0.0; backup.keeping.states()]; made.len()];
    for _ in 0..SWEEPS {
        let start = backup.start.expected(&values[0]);
        let vector = |node: usize| &values[node][..];
        let next = parallel::map(made.len(), |node| {
            backup.values(&choices[node], &vector, start)
        });
        let (change, largest) = change(&values, &next);
        values = next;
        if change <= CLOSE * (1.0 - backup.discount) * largest {
            break;
        }
    }
    values
}

/// Largest change, and largest value.
fn change(old: &[Vec<f64>], new: &[Vec<f64>]) -> (f64, f64) {
    let pairs = old.iter().flatten().zip(new.iter().flatten());
    pairs.fold((0.0, 0.0), |(change, largest): (f64, f64), (a, b)| {
        (change.max((a - b).abs()), largest.max(b.abs()))
    })
}
