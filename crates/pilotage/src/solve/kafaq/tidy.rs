//! Merging memories that act alike and dropping nodes that nothing depends on: what the automaton loses by it, all together, must
//! neither be worth a region nor show in trials.

use super::draft::Draft;
use super::regions::actions_by_cell;
use super::steady::Steady;
use super::task::Task;
use crate::solve::learn::{Trial, critical};

/// Memories less used than this may be merged into any other.
const LITTLE_USED: f64 = 0.1;

/// The tidied draft, its trial, and the steps that the trials took.
pub(super) fn tidy(
    task: &Task<'_>,
    steady: &Steady,
    draft: Draft,
    trial: Trial,
) -> (Draft, Trial, u64) {
    let mut tidying = Tidying {
        task,
        steady,
        before: trial.clone(),
        draft,
        trial,
        steps: 0,
    };
    tidying.merge_memories();
    tidying.drop_nodes();
    tidying.drop_dead_edges();
    (tidying.draft, tidying.trial, tidying.steps)
}

struct Tidying<'a> {
    task: &'a Task<'a>,
    steady: &'a Steady,
    before: Trial,
    draft: Draft,
    trial: Trial,
    steps: u64,
}

impl Tidying<'_> {
    /// Takes a simpler draft unless trials show a loss.
    fn accept(&mut self, simpler: Draft) -> bool {
        let trial = self.task.trial(&simpler.compile(self.task));
        self.steps += trial.steps();
        let accepted = self.loses_nothing(&trial);
        if accepted {
            (self.draft, self.trial) = (simpler, trial);
        }
        accepted
    }

    /// Neither return has lost more than a region is worth, nor surely anything.
    fn loses_nothing(&self, trial: &Trial) -> bool {
        let settings = &self.task.settings;
        let surely = 2.0 * critical(settings.merge_error);
        trial.loses_nothing(&self.before, settings.worth, surely)
    }

    fn merge_memories(&mut self) {
        let memories = self.draft.memory.len();
        let total: f64 = self.trial.visits.iter().sum();
        let nodes = self.draft.nodes.iter().zip(&self.trial.visits);
        let mut shares = vec![0.0; memories];
        nodes.for_each(|(node, visits)| shares[node.memory] += visits / total);
        for (memory, share) in shares.into_iter().enumerate() {
            for other in (0..memories).filter(|&other| other != memory) {
                let stands = |memory: usize| self.draft.alias[memory] == memory;
                if !stands(memory) || !stands(other) {
                    continue;
                }
                if share > LITTLE_USED && !self.act_alike(memory, other) {
                    continue;
                }
                let mut merged = self.draft.clone();
                let aliases = merged.alias.iter_mut().filter(|alias| **alias == memory);
                aliases.for_each(|alias| *alias = other);
                self.accept(merged);
            }
        }
    }

    /// Whether there is no evidence, in either memory, that its own actions beat those of the other.
    fn act_alike(&self, memory: usize, other: usize) -> bool {
        let settings = &self.task.settings;
        let worth =
            settings.worth * (1.0 - self.task.discount()) * self.steady.mean_value(self.task);
        let z = critical(settings.merge_error);
        let [first, second] = [memory, other]
            .map(|memory| actions_by_cell(&self.task.lattice, &self.steady.regions[memory]));
        [(memory, &first, &second), (other, &second, &first)]
            .into_iter()
            .all(|(memory, own, others)| {
                let evidence = &self.steady.evidence[memory].all;
                let gain = evidence.compare(own, others);
                gain.surely(z) <= 0.0 || gain.sum <= worth * evidence.total()
            })
    }

    /// Drops nodes, the least used first; a memory in use keeps one.
    fn drop_nodes(&mut self) {
        let visits = self.trial.visits.clone();
        let mut order: Vec<usize> = (0..visits.len()).collect();
        order.sort_by(|&a, &b| visits[a].total_cmp(&visits[b]));
        let all = self.draft.nodes.clone();
        let mut kept = vec![true; all.len()];
        for node in order {
            kept[node] = false;
            let mut simpler = self.draft.clone();
            let nodes = all.iter().zip(&kept).filter(|(_, kept)| **kept);
            simpler.nodes = nodes.map(|(node, _)| node.clone()).collect();
            let memory = all[node].memory;
            let alone = !simpler.has_nodes(memory);
            if simpler.nodes.is_empty() || (alone && visits[node] > 0.0) {
                kept[node] = true;
            } else if alone {
                self.draft = simpler;
            } else {
                kept[node] = !self.accept(simpler);
            }
        }
        self.trial = self.task.trial(&self.draft.compile(self.task));
        self.steps += self.trial.steps();
    }

    /// Drops edges that no node leads along.
    fn drop_dead_edges(&mut self) {
        let nodes = &self.draft.nodes;
        self.draft.edges.retain(|edge| {
            let leaves = |node: &&super::draft::DraftNode| {
                node.memory == edge.memory && node.action == edge.action
            };
            nodes.iter().any(|node| leaves(&node))
        });
    }
}
