//! The previous cluster as memory (thesis 3.2): a state of the automaton is the cluster the belief is in and how it came there.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::art::Outcome;
use crate::belief::{ClusterId, Clusters, Recall};
use crate::model::{ActionId, ModeId};

/// A cluster and the steps that led to it.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub(super) struct History {
    /// The cluster the belief is in.
    pub cluster: ClusterId,
    /// The last steps, the very last one first: the action, and the cluster it was taken in. Shorter soon after the start of an episode.
    pub past: Vec<(ActionId, ClusterId)>,
}

impl History {
    /// That of an episode that starts in a cluster.
    pub(super) fn start(cluster: ClusterId) -> Self {
        Self {
            cluster,
            past: Vec::new(),
        }
    }

    /// The history after an action that led to a cluster, of which `depth` steps are remembered.
    pub(super) fn then(&self, action: ActionId, cluster: ClusterId, depth: usize) -> Self {
        let steps = std::iter::once((action, self.cluster)).chain(self.past.iter().copied());
        Self {
            cluster,
            past: steps.take(depth).collect(),
        }
    }

    /// Whether it is one of so many clusters and actions, and not longer than what is remembered.
    pub(super) fn fits(&self, clusters: usize, actions: usize, depth: usize) -> bool {
        let step =
            |&(action, cluster): &(ActionId, ClusterId)| action < actions && cluster < clusters;
        self.cluster < clusters && self.past.len() <= depth && self.past.iter().all(step)
    }

    /// In words.
    pub(super) fn name(&self, actions: &[String]) -> String {
        let mut name = format!("cluster {}", self.cluster);
        for (action, from) in &self.past {
            name += &format!(", {} from {from}", actions[*action]);
        }
        name
    }

    /// How far it is from another: squared distances of the clusters, and 1 for every step by another action or that one of them lacks.
    pub(super) fn apart(&self, other: &Self, clusters: &Clusters) -> f64 {
        let steps = self.past.iter().zip(&other.past).map(|(a, b)| {
            let action = f64::from(u8::from(a.0 != b.0));
            action + clusters.between(a.1, b.1)
        });
        let lacking = self.past.len().abs_diff(other.past.len()) as f64;
        clusters.between(self.cluster, other.cluster) + steps.sum::<f64>() + lacking
    }

    /// How many of the last steps are the same, and whether at least the action of the one before is.
    fn agreement(&self, other: &Self) -> (usize, bool) {
        let same = |(a, b): &(&(ActionId, ClusterId), &(ActionId, ClusterId))| a == b;
        let steps = || self.past.iter().zip(&other.past);
        let agreed = steps().take_while(same).count();
        let action = steps().nth(agreed).is_some_and(|(a, b)| a.0 == b.0);
        (agreed, action)
    }
}

/// The histories that were met, each a state of the automaton.
pub(super) struct Histories {
    depth: usize,
    /// Most of them.
    limit: usize,
    states: Vec<History>,
    number: BTreeMap<History, ModeId>,
    /// By cluster: the states in it.
    inside: Vec<Vec<ModeId>>,
}

impl Histories {
    /// None, of so many clusters.
    pub(super) fn new(clusters: usize, depth: usize, limit: usize) -> Self {
        Self {
            depth,
            limit,
            states: Vec::new(),
            number: BTreeMap::new(),
            inside: vec![Vec::new(); clusters],
        }
    }

    /// Takes in a history, as the network takes in an input: it is known, or it is new, or it is new and there are too many already. A
    /// place is kept for every cluster.
    pub(super) fn meet(&mut self, history: &History) -> Outcome {
        if self.number.contains_key(history) {
            return Outcome::Resonated;
        }
        let empty = self.inside.iter().filter(|states| states.is_empty());
        let kept = empty.count() - usize::from(self.inside[history.cluster].is_empty());
        if self.states.len() + kept >= self.limit {
            return Outcome::Full;
        }
        self.add(history.clone());
        Outcome::Committed
    }

    fn add(&mut self, history: History) {
        self.inside[history.cluster].push(self.states.len());
        self.number.insert(history.clone(), self.states.len());
        self.states.push(history);
    }

    /// What is remembered of a history after an action that led to a cluster.
    pub(super) fn after(&self, history: &History, action: ActionId, cluster: ClusterId) -> History {
        history.then(action, cluster, self.depth)
    }

    /// The automaton's states and how they follow one another.
    pub(super) fn into_automaton(
        mut self,
        clusters: Clusters,
        actions: usize,
    ) -> (Vec<History>, Recall) {
        for cluster in 0..clusters.len() {
            if self.inside[cluster].is_empty() {
                self.add(History::start(cluster));
            }
        }
        let first = (0..clusters.len()).map(|cluster| self.like(&History::start(cluster)));
        let first = first.collect();
        let mut next = Vec::with_capacity(self.states.len() * actions * clusters.len());
        for history in &self.states {
            for action in 0..actions {
                for cluster in 0..clusters.len() {
                    next.push(self.like(&self.after(history, action, cluster)));
                }
            }
        }
        (self.states, Recall::new(clusters, actions, first, next))
    }

    /// The state of a history; of one never met, the state in its cluster that agrees with it for longest, the first of equals.
    fn like(&self, history: &History) -> ModeId {
        if let Some(state) = self.number.get(history) {
            return *state;
        }
        let states = self.inside[history.cluster].iter().copied().rev();
        let nearest = states.max_by_key(|state| self.states[*state].agreement(history));
        nearest.unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_history_remembers_as_many_steps_as_it_is_deep() {
        let start = History::start(2);
        let one = start.then(0, 3, 2);
        let two = one.then(1, 4, 2);
        assert_eq!(two.past, [(1, 3), (0, 2)]);
        assert_eq!(two.then(0, 5, 2).past, [(0, 4), (1, 3)]);
        assert_eq!(two.then(0, 5, 0), History::start(5));
        let actions = ["MOVE".to_owned(), "TURN".to_owned()];
        assert_eq!(two.name(&actions), "cluster 4, TURN from 3, MOVE from 2");
    }

    #[test]
    fn one_never_met_is_like_the_one_that_agrees_for_longest() {
        let mut histories = Histories::new(3, 2, 6);
        let met = |cluster, past: &[(usize, usize)]| History {
            cluster,
            past: past.to_vec(),
        };
        for history in [
            met(0, &[]),
            met(0, &[(1, 1)]),
            met(0, &[(1, 1), (0, 2)]),
            met(0, &[(0, 1), (0, 2)]),
        ] {
            assert_eq!(histories.meet(&history), Outcome::Committed);
        }
        assert_eq!(histories.meet(&met(0, &[])), Outcome::Resonated);
        assert_eq!(histories.like(&met(0, &[(0, 1), (0, 2)])), 3);
        // Agrees in the last step, and in the action before.
        assert_eq!(histories.like(&met(0, &[(1, 1), (0, 0)])), 2);
        assert_eq!(histories.like(&met(0, &[(0, 1), (1, 2)])), 3);
        // Agrees in nothing: the first.
        assert_eq!(histories.like(&met(0, &[(2, 2)])), 0);
        // Two places are kept for the other clusters.
        assert_eq!(histories.meet(&met(0, &[(1, 0)])), Outcome::Full);
        assert_eq!(histories.meet(&met(1, &[(0, 0)])), Outcome::Committed);
        assert_eq!(histories.meet(&met(1, &[(1, 0)])), Outcome::Full);
    }
}
