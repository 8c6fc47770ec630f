//! Merging clusters that agree in action and value, which the thesis left as future work (chapter 7): the nearest first, as long as
//! trials show no loss.

use super::draft::{Draft, DraftNode};
use super::task::Task;
use crate::belief::{Cluster, Sight};
use crate::solve::learn::{Trial, critical};

/// Pairs tried in a row without success that end it.
const TRIES: usize = 12;

/// The merged draft and the steps that trials took.
pub(super) fn merge(task: &Task<'_>, draft: Draft) -> (Draft, u64) {
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
    (merging.draft, merging.steps)
}

struct Merging<'a> {
    task: &'a Task<'a>,
    before: Trial,
    draft: Draft,
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
            self.draft = smaller;
            self.visits = trial.visits;
        }
        accepted
    }

    /// Clusters that the policy never comes to are of no use to it.
    fn drop_unused(&mut self) {
        let mut smaller = self.draft.clone();
        let mut visits = self.visits.iter();
        smaller
            .nodes
            .retain(|_| visits.next().is_some_and(|visits| *visits > 0.0));
        self.accept(smaller);
    }

    fn merge_agreeing(&mut self) {
        let mut failed: Vec<(DraftNode, DraftNode)> = Vec::new();
        while let Some((i, j)) = self.nearest_agreeing(&failed) {
            let nodes = &self.draft.nodes;
            let pair = (nodes[i].clone(), nodes[j].clone());
            let mut smaller = self.draft.clone();
            smaller.nodes[i] = merged(&pair.0, &pair.1, self.visits[i], self.visits[j]);
            smaller.nodes.remove(j);
            if self.accept(smaller) {
                failed.clear();
            } else {
                failed.push(pair);
            }
            if failed.len() >= TRIES {
                break;
            }
        }
    }

    /// The nearest two nodes that agree and have not failed to merge.
    fn nearest_agreeing(&self, failed: &[(DraftNode, DraftNode)]) -> Option<(usize, usize)> {
        let nodes = &self.draft.nodes;
        let values = nodes.iter().map(|node| node.value);
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |range, value| {
            (range.0.min(value), range.1.max(value))
        });
        let apart = self.task.settings.agree * (high - low);
        let agree = |a: &DraftNode, b: &DraftNode| {
            a.action == b.action && (a.value - b.value).abs() <= apart
        };
        let tried =
            |a: &DraftNode, b: &DraftNode| failed.iter().any(|pair| pair.0 == *a && pair.1 == *b);
        let pairs = (0..nodes.len()).flat_map(|j| (0..j).map(move |i| (i, j)));
        let distance = |(i, j): (usize, usize)| {
            self.draft
                .weights
                .between(&nodes[i].cluster, &nodes[j].cluster)
        };
        pairs
            .filter(|&(i, j)| agree(&nodes[i], &nodes[j]) && !tried(&nodes[i], &nodes[j]))
            .min_by(|&a, &b| distance(a).total_cmp(&distance(b)))
    }
}

/// One node for two, weighted by their visits.
fn merged(a: &DraftNode, b: &DraftNode, visits_a: f64, visits_b: f64) -> DraftNode {
    let share = if visits_a + visits_b > 0.0 {
        visits_b / (visits_a + visits_b)
    } else {
        0.5
    };
    let mean = |a: f64, b: f64| a + share * (b - a);
    let means = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| mean(*a, *b)).collect();
    let sight = |a: &Sight, b: &Sight| Sight {
        place: means(&a.place, &b.place),
        actions: means(&a.actions, &b.actions),
    };
    DraftNode {
        cluster: Cluster {
            now: sight(&a.cluster.now, &b.cluster.now),
            before: sight(&a.cluster.before, &b.cluster.before),
        },
        action: a.action,
        value: mean(a.value, b.value),
    }
}
