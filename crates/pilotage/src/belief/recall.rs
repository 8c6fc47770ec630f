//! Memory by clusters (thesis 3.2): what is remembered is the clusters that the last beliefs fell into, and the actions between them.
//!
//! The mean of a belief falls into the nearest cluster; where a belief is kept in full, its place has more than a mean. A mode of the belief stands for what is remembered, so that modes in the same
//! cluster with different pasts can tell what no sensor shows. How modes follow one another is a table: a finite automaton that is fed
//! with actions and clusters.

use serde::{Deserialize, Serialize};

use crate::model::{ActionId, Interval, ModeId, Model};

/// Number of a cluster.
pub(crate) type ClusterId = usize;

/// Clusters of belief means: a mean is in the one whose centre is nearest, lengths measured by the world's outer bounds. Where beliefs are
/// kept in full, the traits of a stratum follow the mean.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Clusters {
    pub(crate) bounds: Vec<Interval>,
    /// By cluster, length `n` and a number for each trait, in units of the state and the traits.
    pub(crate) centres: Vec<Vec<f64>>,
}

/// Finds the next mode from the one before, the action and the mean.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Recall {
    pub(crate) clusters: Clusters,
    pub(crate) actions: usize,
    /// By cluster: the mode of an episode that starts in it.
    pub(crate) first: Vec<ModeId>,
    /// By mode, action and cluster: the mode afterwards.
    pub(crate) next: Vec<ModeId>,
}

impl Clusters {
    /// Clusters, at least one, in the bounds of a model, which are finite.
    pub fn new(model: &Model, centres: Vec<Vec<f64>>) -> Self {
        Self {
            bounds: model.state.iter().map(|variable| variable.bounds).collect(),
            centres,
        }
    }

    /// Clusters, at least one, of places that lie between the given ends.
    pub(crate) fn between_ends(bounds: Vec<Interval>, centres: Vec<Vec<f64>>) -> Self {
        Self { bounds, centres }
    }

    /// Number of clusters.
    pub(crate) fn len(&self) -> usize {
        self.centres.len()
    }

    /// Their centres, in units of the state.
    pub(crate) fn centres(&self) -> &[Vec<f64>] {
        &self.centres
    }

    /// The cluster of a mean; the first of equals. Allocates nothing.
    pub(crate) fn nearest(&self, mean: &[f64]) -> ClusterId {
        let mut best = (0, f64::INFINITY);
        for (id, centre) in self.centres.iter().enumerate() {
            let distance = self.distance(centre, mean);
            if distance < best.1 {
                best = (id, distance);
            }
        }
        best.0
    }

    fn fits(&self, states: usize) -> bool {
        let finite = |bounds: &Interval| bounds.width() > 0.0 && bounds.width().is_finite();
        let place =
            |centre: &Vec<f64>| centre.len() == states && centre.iter().all(|x| x.is_finite());
        !self.centres.is_empty()
            && self.bounds.len() == states
            && self.bounds.iter().all(finite)
            && self.centres.iter().all(place)
    }

    /// Squared distance between two clusters, 1 for opposite corners of the world.
    pub(crate) fn between(&self, a: ClusterId, b: ClusterId) -> f64 {
        self.distance(&self.centres[a], &self.centres[b])
    }

    fn distance(&self, a: &[f64], b: &[f64]) -> f64 {
        let variables = self.bounds.iter().zip(a.iter().zip(b));
        let squares = variables.map(|(bounds, (a, b))| {
            let apart = scaled(bounds, *a) - scaled(bounds, *b);
            apart * apart
        });
        squares.sum::<f64>() / a.len() as f64
    }
}

impl Recall {
    /// A table of modes: `first` by cluster; `next` by mode, action and cluster, the cluster running fastest.
    pub fn new(clusters: Clusters, actions: usize, first: Vec<ModeId>, next: Vec<ModeId>) -> Self {
        Self {
            clusters,
            actions,
            first,
            next,
        }
    }

    /// The clusters that means fall into.
    pub(crate) fn clusters(&self) -> &Clusters {
        &self.clusters
    }

    /// The mode of the mean that an episode starts with.
    pub(crate) fn first(&self, mean: &[f64]) -> ModeId {
        self.first[self.clusters.nearest(mean)]
    }

    /// The mode of a mean that was reached by an action. Allocates nothing.
    pub(crate) fn next(&self, before: ModeId, action: ActionId, mean: &[f64]) -> ModeId {
        let row = (before * self.actions + action) * self.clusters.len();
        self.next[row + self.clusters.nearest(mean)]
    }

    /// The same with some modes put for others: `into` says by mode which one, itself if it stays. Those that stay keep their order.
    pub(crate) fn merged(&self, into: &[ModeId]) -> Self {
        let stays = |mode: ModeId| into[mode] == mode;
        let staying = (0..into.len()).filter(|mode| stays(*mode));
        let mut number = vec![0; into.len()];
        for (stayed, mode) in staying.enumerate() {
            number[mode] = stayed;
        }
        let renumbered = |mode: &ModeId| number[into[*mode]];
        let rows = self.next.chunks(self.actions * self.clusters.len());
        let kept = rows.enumerate().filter(|(mode, _)| stays(*mode));
        Self {
            clusters: self.clusters.clone(),
            actions: self.actions,
            first: self.first.iter().map(renumbered).collect(),
            next: kept
                .flat_map(|(_, row)| row.iter().map(renumbered))
                .collect(),
        }
    }

    /// Whether sizes and numbers are as they have to be.
    pub(crate) fn fits(&self, states: usize, actions: usize, modes: usize) -> bool {
        let is_mode = |mode: &ModeId| *mode < modes;
        self.clusters.fits(states)
            && self.actions == actions
            && self.first.len() == self.clusters.len()
            && self.next.len() == modes * actions * self.clusters.len()
            && self.first.iter().chain(&self.next).all(is_mode)
    }
}

/// A number scaled to `[0, 1]` over finite bounds; one outside is that of the nearest end.
pub(crate) fn scaled(bounds: &Interval, x: f64) -> f64 {
    ((x - bounds.low) / bounds.width()).clamp(0.0, 1.0)
}
