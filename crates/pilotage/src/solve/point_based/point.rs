//! Beliefs at which values are backed up, and the vectors that are their values.

use std::sync::Arc;

use crate::belief::Cells;
use crate::model::ActionId;

/// A belief, by the modes and cells that are possible in it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Point {
    pub(super) states: Vec<usize>,
    pub(super) masses: Vec<f64>,
}

impl Point {
    pub(super) fn new(masses: &[f64]) -> Self {
        let met = || masses.iter().enumerate().filter(|(_, mass)| **mass > 0.0);
        Self {
            states: met().map(|(state, _)| state).collect(),
            masses: met().map(|(_, mass)| *mass).collect(),
        }
    }

    /// What a value by mode and cell is expected to be.
    pub(super) fn expected(&self, values: &[f64]) -> f64 {
        let states = self.states.iter().zip(&self.masses);
        states.map(|(state, mass)| mass * values[*state]).sum()
    }

    /// Sum of the differences of probabilities to another belief, from 0 to 2.
    pub(super) fn apart(&self, other: &Cells) -> f64 {
        let other = other.probabilities();
        let mut rest = 1.0;
        let mut apart = 0.0;
        for (state, mass) in self.states.iter().zip(&self.masses) {
            apart += (mass - other[*state]).abs();
            rest -= other[*state];
        }
        apart + rest.max(0.0)
    }
}

/// What a policy earns from every mode and cell, and the action with which it begins.
#[derive(Debug, Clone, PartialEq)]
pub struct ValueVector {
    /// The action.
    pub action: ActionId,
    /// Expected discounted return, by mode and cell.
    pub values: Vec<f64>,
    /// What to go on with after each signal of a discrete sensor, and last, after none; empty where the episode never goes on. A vector
    /// that repeats its action has `None`.
    pub(super) next: Option<Vec<Arc<ValueVector>>>,
}

/// Vectors, of which the best one at a belief is its value.
#[derive(Debug, Clone)]
pub(super) struct VectorSet {
    pub(super) vectors: Vec<Arc<ValueVector>>,
    /// Value of the start.
    pub(super) start: f64,
}

impl VectorSet {
    /// Vectors, without those that another one exceeds everywhere.
    pub(super) fn new(vectors: Vec<Arc<ValueVector>>, start: &Point) -> Self {
        let mut set = Self {
            vectors: undominated(vectors),
            start: 0.0,
        };
        set.start = set.best(start).1;
        set
    }

    /// The best vector at a belief, the first of several, and what it is worth there.
    pub(super) fn best(&self, point: &Point) -> (usize, f64) {
        let mut best = (0, f64::NEG_INFINITY);
        for (index, vector) in self.vectors.iter().enumerate() {
            let value = point.expected(&vector.values);
            if value > best.1 {
                best = (index, value);
            }
        }
        best
    }
}

fn undominated(vectors: Vec<Arc<ValueVector>>) -> Vec<Arc<ValueVector>> {
    let mut kept: Vec<Arc<ValueVector>> = Vec::with_capacity(vectors.len());
    for vector in vectors {
        let exceeds = |a: &ValueVector, b: &ValueVector| {
            let pairs = a.values.iter().zip(&b.values);
            pairs.into_iter().all(|(a, b)| a >= b)
        };
        if kept.iter().any(|known| exceeds(known, &vector)) {
            continue;
        }
        kept.retain(|known| !exceeds(&vector, known));
        kept.push(vector);
    }
    kept
}
