//! Backups: the best action at a belief by one look ahead, and the vector of doing so.

use std::sync::Arc;

use nalgebra::DMatrix;

use super::point::{Point, ValueVector, VectorSet};
use super::signals::Partition;
use crate::belief::{CellsKeeping, Keeping};
use crate::model::ActionId;

/// A signal that is less likely says nothing about what to do after it.
const NEVER: f64 = 1e-14;

/// Blind policies are followed until so little of their value is missing, or so many steps.
const MISSING: f64 = 1e-10;
const STEPS: usize = 20_000;

/// A model on cells, as backups see it.
#[derive(Debug, Clone)]
pub(super) struct Backup {
    pub(super) keeping: Arc<CellsKeeping>,
    pub(super) discount: f64,
    /// Most bins along a reading.
    pub(super) bins: usize,
    pub(super) start: Point,
}

/// An action at a belief, what to go on with after each signal, and what that is worth.
#[derive(Debug, Clone)]
pub(super) struct Choice {
    pub(super) action: ActionId,
    pub(super) value: f64,
    /// The vector to go on with after each signal; empty where the episode never goes on.
    pub(super) picks: Vec<usize>,
    pub(super) partition: Partition,
}

impl Backup {
    pub(super) fn new(keeping: Arc<CellsKeeping>, discount: f64, bins: usize) -> Self {
        Self {
            start: Point::new(keeping.start().probabilities()),
            keeping,
            discount,
            bins,
        }
    }

    /// The best choice at a belief, the first of several.
    pub(super) fn choose(&self, point: &Point, set: &VectorSet) -> Choice {
        let choices = (0..self.keeping.actions()).map(|action| self.choice(action, point, set));
        let better = |best: Choice, next: Choice| match next.value > best.value {
            true => next,
            false => best,
        };
        let worst = Choice {
            action: 0,
            value: f64::NEG_INFINITY,
            picks: Vec::new(),
            partition: Partition::Signals,
        };
        choices.fold(worst, better)
    }

    /// An action, and the best there is to go on with after it.
    pub(super) fn choice(&self, action: ActionId, point: &Point, set: &VectorSet) -> Choice {
        let keeping = &*self.keeping;
        let mut from = vec![0.0; keeping.states()];
        for (state, mass) in point.states.iter().zip(&point.masses) {
            from[*state] = *mass;
        }
        let mut to = vec![0.0; from.len()];
        keeping.forward(action, &from, &mut to);
        let restarted = point.expected(keeping.restarts(action));
        let mut value =
            point.expected(keeping.rewards(action)) + self.discount * restarted * set.start;
        let mut picks = Vec::new();
        let mut partition = Partition::Signals;
        let ahead = Point::new(&to);
        if !ahead.states.is_empty() {
            partition = Partition::new(keeping, action, &to, self.bins);
            let likely = partition.likelihoods(keeping, action, &ahead.states);
            let later;
            (picks, later) = best_after(likely, &ahead, set);
            value += self.discount * later;
        }
        Choice {
            action,
            value,
            picks,
            partition,
        }
    }

    /// What a choice is worth in every mode and cell.
    pub(super) fn vector(&self, choice: &Choice, set: &VectorSet) -> ValueVector {
        let next = choice.picks.iter().map(|pick| set.vectors[*pick].clone());
        ValueVector {
            action: choice.action,
            values: self.values(choice, set),
            next: Some(match self.keeping.is_discrete() {
                true => next.collect(),
                // Bins are the belief's own, and nobody follows them.
                false => Vec::new(),
            }),
        }
    }

    fn values(&self, choice: &Choice, set: &VectorSet) -> Vec<f64> {
        let states: Vec<usize> = (0..self.keeping.states()).collect();
        let mut later = vec![0.0; states.len()];
        if !choice.picks.is_empty() {
            let partition = &choice.partition;
            let likely = partition.likelihoods(&self.keeping, choice.action, &states);
            for (state, later) in later.iter_mut().enumerate() {
                let signals = choice.picks.iter().zip(likely.column(state));
                *later = signals
                    .filter(|(_, likely)| **likely > 0.0)
                    .map(|(pick, likely)| likely * set.vectors[*pick].values[state])
                    .sum();
            }
        }
        self.before(choice.action, &later, set.start)
    }

    /// What an action is worth where `later` is had after it.
    pub(super) fn before(&self, action: ActionId, later: &[f64], start: f64) -> Vec<f64> {
        let mut values = self.keeping.backward(action, later);
        let rewards = self.keeping.rewards(action).iter();
        let restarts = self.keeping.restarts(action).iter();
        for (value, (reward, restart)) in values.iter_mut().zip(rewards.zip(restarts)) {
            *value = reward + self.discount * (*value + restart * start);
        }
        values
    }

    /// What repeating an action for ever is worth, and never more.
    pub(super) fn blind(&self, action: ActionId) -> ValueVector {
        let rewards = self.keeping.rewards(action).iter();
        let worst = rewards.fold(0.0f64, |worst, reward| worst.min(*reward));
        let mut values = vec![worst / (1.0 - self.discount); self.keeping.states()];
        for _ in 0..STEPS {
            let start = self.start.expected(&values);
            let next = self.before(action, &values, start);
            let pairs = next.iter().zip(&values);
            let change = pairs.fold(0.0f64, |most, (a, b)| most.max((a - b).abs()));
            values = next;
            if change <= MISSING * (1.0 - self.discount) {
                break;
            }
        }
        ValueVector {
            action,
            values,
            next: None,
        }
    }
}

/// The best vector after each signal (rows of how likely it is in each state), and what they are worth together.
fn best_after(mut joint: DMatrix<f64>, ahead: &Point, set: &VectorSet) -> (Vec<usize>, f64) {
    let (signals, met) = joint.shape();
    for (mut column, mass) in joint.column_iter_mut().zip(&ahead.masses) {
        column *= *mass;
    }
    let vectors = DMatrix::from_fn(met, set.vectors.len(), |i, vector| {
        set.vectors[vector].values[ahead.states[i]]
    });
    // What each vector is worth together with each signal.
    let worth = &joint * &vectors;
    let best = |signal: usize| {
        let row = worth.row(signal);
        let first = (0, f64::NEG_INFINITY);
        let pairs = row.iter().copied().enumerate();
        pairs.fold(first, |best, next| match next.1 > best.1 {
            true => next,
            false => best,
        })
    };
    let mut chosen: Vec<(usize, f64)> = (0..signals).map(best).collect();
    // What cannot be sensed here goes where the likeliest signal goes, so that nothing is kept for it.
    let likely = |signal: &usize| joint.row(*signal).sum();
    let likeliest = (0..signals).max_by(|a, b| likely(a).total_cmp(&likely(b)));
    let usual = likeliest.map_or(0, |signal| chosen[signal].0);
    for signal in (0..signals).filter(|signal| likely(signal) <= NEVER) {
        chosen[signal] = (usual, worth[(signal, usual)]);
    }
    let value = chosen.iter().map(|(_, value)| value).sum();
    (chosen.into_iter().map(|(pick, _)| pick).collect(), value)
}
