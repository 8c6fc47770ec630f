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
        let used: Vec<usize> = (0..self.visits.len())
            .filter(|id| self.visits[*id] > 0.0)
            .collect();
        let nearest = |id: usize| {
            let used = used.iter().copied();
            used.min_by(|a, b| {
                self.draft
                    .apart(id, *a)
                    .total_cmp(&self.draft.apart(id, *b))
            })
        };
        let into = (0..self.visits.len()).map(|id| nearest(id).unwrap_or(id));
        let smaller = self.draft.merged(&into.collect::<Vec<_>>());
        self.accept(smaller);
    }

    /// Merges more pairs at a time as long as that succeeds, fewer when it does not.
    fn merge_agreeing(&mut self) {
        let mut failed: Vec<[DraftNode; 2]> = Vec::new();
        let mut most = 1;
        while failed.len() < TRIES + self.draft.nodes.len() / NODES_PER_TRY {
            let pairs = self.nearest_agreeing(&failed, most);
            let Some(&[i, j]) = pairs.first() else { break };
            let mut into: Vec<usize> = (0..self.draft.nodes.len()).collect();
            for &[i, j] in &pairs {
                // The state that is visited more stands for both.
                let (kept, gone) = if self.visits[i] >= self.visits[j] {
                    (i, j)
                } else {
                    (j, i)
                };
                into[gone] = kept;
            }
            let pair = [i, j].map(|id| self.draft.nodes[id].clone());
            if self.accept(self.draft.merged(&into)) {
                failed.clear();
                most *= 2;
            } else if pairs.len() == 1 {
                failed.push(pair);
            } else {
                most = pairs.len() / 2;
            }
        }
    }

    /// The nearest pairs of nodes that agree and have not failed to merge, at most so many and no node in two of them.
    fn nearest_agreeing(&self, failed: &[[DraftNode; 2]], most: usize) -> Vec<[usize; 2]> {
        let nodes = &self.draft.nodes;
        let values = nodes.iter().map(|node| node.value);
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |range, value| {
            (range.0.min(value), range.1.max(value))
        });
        let reach = self.task.settings.agree * (high - low);
        let agree = |a: &DraftNode, b: &DraftNode| {
            a.action == b.action && (a.value - b.value).abs() <= reach
        };
        let tried = |a: &DraftNode, b: &DraftNode| failed.iter().any(|[c, d]| c == a && d == b);
        let pairs = (0..nodes.len()).flat_map(|j| (0..j).map(move |i| [i, j]));
        let mut pairs: Vec<([usize; 2], f64)> = pairs
            .filter(|&[i, j]| agree(&nodes[i], &nodes[j]) && !tried(&nodes[i], &nodes[j]))
            .map(|[i, j]| ([i, j], self.draft.apart(i, j)))
            .collect();
        pairs.sort_by(|a, b| a.1.total_cmp(&b.1));
        let mut free = vec![true; nodes.len()];
        let mut chosen = Vec::new();
        for ([i, j], _) in pairs {
            if chosen.len() < most && free[i] && free[j] {
                (free[i], free[j]) = (false, false);
                chosen.push([i, j]);
            }
        }
        chosen
    }
}
