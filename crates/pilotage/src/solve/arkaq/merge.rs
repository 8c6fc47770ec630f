//! Merging states that agree in action and value, which the thesis left as future work (chapter 7): the nearest first, as long as
//! trials show no loss.

use super::draft::{Draft, DraftNode};
use super::task::Task;
use crate::solve::learn::{Trial, critical};

/// Pairs tried in a row without success that end it, and more of them where there are many nodes.
const TRIES: usize = 12;
const NODES_PER_TRY: usize = 4;

/// Merges states of a draft; returns the steps that trials took.
pub(super) fn merge(task: &Task<'_>, draft: &mut Draft) -> u64 {
    let before = task.trial(&draft.compile(task));
    let mut merging = Merging {
        task,
        steps: before.steps(),
        visits: before.visits.clone(),
        before,
        draft,
    };
    merging.drop_unused();
    merging.merge_agreeing();
    merging.drop_unused();
    merging.steps
}

struct Merging<'a> {
    task: &'a Task<'a>,
    before: Trial,
    draft: &'a mut Draft,
    /// By node: steps spent there.
    visits: Vec<f64>,
    steps: u64,
}

impl Merging<'_> {
    /// Takes a smaller draft unless trials show a loss.
    fn accept(&mut self, smaller: Draft) -> bool {
        let settings = &self.task.settings;
        let trial = self.task.trial(&smaller.compile(self.task));
        self.steps += trial.steps();
        let surely = 2.0 * critical(settings.merge_error);
        let accepted = trial.loses_nothing(&self.before, settings.worth, surely);
        if accepted {
            *self.draft = smaller;
            self.visits = trial.visits;
        }
        accepted
    }

    /// States that the policy never comes to are of no use to it: the nearest one that it comes to takes their place.
    fn drop_unused(&mut self) {
        let is_used = |id: &usize| self.visits[*id] > 0.0;
        let nearest = |id: usize| {
            let apart = |other: &usize| self.draft.apart(id, *other);
            let used = (0..self.visits.len()).filter(is_used);
            used.min_by(|a, b| apart(a).total_cmp(&apart(b)))
        };
        let into = (0..self.visits.len()).map(|id| match is_used(&id) {
            true => id,
            false => nearest(id).unwrap_or(id),
        });
        let smaller = self.draft.merged(&into.collect::<Vec<_>>());
        self.accept(smaller);
    }

    /// Merges more pairs at a time as long as that succeeds, fewer when it does not.
    fn merge_agreeing(&mut self) {
        let mut pairs = self.agreeing();
        // The first so many of them did not merge.
        let mut failed = 0;
        let mut most = 1;
        while failed < TRIES + self.draft.nodes.len() / NODES_PER_TRY {
            let chosen = disjoint(&pairs[failed..], self.draft.nodes.len(), most);
            if chosen.is_empty() {
                break;
            }
            let mut into: Vec<usize> = (0..self.draft.nodes.len()).collect();
            for &[i, j] in &chosen {
                // The state that is visited more stands for both.
                let (kept, gone) = if self.visits[i] >= self.visits[j] {
                    (i, j)
                } else {
                    (j, i)
                };
                into[gone] = kept;
            }
            if self.accept(self.draft.merged(&into)) {
                pairs = self.agreeing();
                failed = 0;
                most *= 2;
            } else if chosen.len() == 1 {
                failed += 1;
            } else {
                most = chosen.len() / 2;
            }
        }
    }

    /// The pairs of nodes that agree, the nearest first.
    fn agreeing(&self) -> Vec<[usize; 2]> {
        let nodes = &self.draft.nodes;
        let values = nodes.iter().map(|node| node.value);
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |range, value| {
            (range.0.min(value), range.1.max(value))
        });
        let reach = self.task.settings.agree * (high - low);
        let agree = |a: &DraftNode, b: &DraftNode| {
            a.action == b.action && (a.value - b.value).abs() <= reach
        };
        let pairs = (0..nodes.len()).flat_map(|j| (0..j).map(move |i| [i, j]));
        let mut pairs: Vec<([usize; 2], f64)> = pairs
            .filter(|&[i, j]| agree(&nodes[i], &nodes[j]))
            .map(|[i, j]| ([i, j], self.draft.apart(i, j)))
            .collect();
        pairs.sort_by(|a, b| a.1.total_cmp(&b.1));
        pairs.into_iter().map(|(pair, _)| pair).collect()
    }
}

/// The first pairs of so many nodes, at most `most`, with no node in two of them.
fn disjoint(pairs: &[[usize; 2]], nodes: usize, most: usize) -> Vec<[usize; 2]> {
    let mut free = vec![true; nodes];
    let apart = pairs.iter().copied().filter(|&[i, j]| {
        let both = free[i] && free[j];
        if both {
            (free[i], free[j]) = (false, false);
        }
        both
    });
    apart.take(most).collect()
}
