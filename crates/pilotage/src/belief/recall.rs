//! Memory by clusters (thesis 3.2): what is remembered is the cluster that the last belief fell into, and the next one depends on it.
//!
//! A cluster stands for belief means that were reached from similar places by similar actions. Its number is the mode of a belief,
//! so that clusters at the same place with different pasts can tell what no sensor shows.

use serde::{Deserialize, Serialize};

use crate::model::{ActionId, Interval, ModeId, Model};

/// The centre of a cluster: what it is, and what came before it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Cluster {
    /// The beliefs in it.
    pub now: Sight,
    /// What the cluster before passed on.
    pub before: Sight,
}

/// Where a cluster is and what led there.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Sight {
    /// Mean belief, length `n`, scaled to `[0, 1]` over the world's outer bounds.
    pub place: Vec<f64>,
    /// How much each action led to it, in `[0, 1]`; all 0 where an episode starts.
    pub actions: Vec<f64>,
}

/// Finds the next cluster from the one before, the action and the mean.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Recall {
    /// Bounds of the state variables.
    bounds: Vec<Interval>,
    weights: Weights,
    clusters: Vec<Cluster>,
}

/// Weights of what a cluster is told apart by. Squared distances are 1 between opposite corners of the world, and between two actions.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Weights {
    /// Of the cluster before, against 1 of the belief itself; at least 0.
    pub before: f64,
    /// How much a cluster passes on of the one before it, in `[0, 1)`; the rest is itself. With 0 memory reaches one cluster back.
    pub past: f64,
    /// Of actions, against 1 of places; at least 0.
    pub action: f64,
}

impl Recall {
    /// Clusters, at least one, in the bounds of a model, which are finite.
    pub fn new(model: &Model, weights: Weights, clusters: Vec<Cluster>) -> Self {
        Self {
            bounds: model.state.iter().map(|variable| variable.bounds).collect(),
            weights,
            clusters,
        }
    }

    /// The clusters; a mode is the number of one.
    pub fn clusters(&self) -> &[Cluster] {
        &self.clusters
    }

    /// What they are told apart by.
    pub fn weights(&self) -> Weights {
        self.weights
    }

    /// The cluster of the mean an episode starts with: it comes from where it is, by no action.
    pub fn first(&self, mean: &[f64]) -> ModeId {
        self.nearest(|cluster| {
            let apart = |sight: &Sight| {
                self.to_mean(sight, mean) + self.weights.action * led(&sight.actions, None)
            };
            apart(&cluster.now) + self.weights.before * apart(&cluster.before)
        })
    }

    /// The cluster of a mean reached by an action from another cluster. Allocates nothing.
    pub fn next(&self, before: ModeId, action: ActionId, mean: &[f64]) -> ModeId {
        let from = &self.clusters[before];
        let passed = |now: &[f64], before: &[f64], i: usize| self.weights.passed(now[i], before[i]);
        let place = |i| passed(&from.now.place, &from.before.place, i);
        let led_by = |i| passed(&from.now.actions, &from.before.actions, i);
        self.nearest(|cluster| {
            self.to_mean(&cluster.now, mean)
                + self.weights.action * led(&cluster.now.actions, Some(action))
                + self.weights.before * self.weights.apart(&cluster.before, place, led_by)
        })
    }

    /// The first cluster at the least distance.
    fn nearest(&self, distance: impl Fn(&Cluster) -> f64) -> ModeId {
        let mut best = (0, f64::INFINITY);
        for (id, cluster) in self.clusters.iter().enumerate() {
            let distance = distance(cluster);
            if distance < best.1 {
                best = (id, distance);
            }
        }
        best.0
    }

    /// Squared distance of a place and a mean, 1 for opposite corners.
    fn to_mean(&self, sight: &Sight, mean: &[f64]) -> f64 {
        let variables = self.bounds.iter().zip(mean);
        let squares = variables.zip(&sight.place).map(|((bounds, m), x)| {
            let apart = x - scaled(bounds, *m);
            apart * apart
        });
        squares.sum::<f64>() / mean.len() as f64
    }

    /// Whether sizes and numbers are as they have to be.
    pub(super) fn fits(&self, states: usize, actions: usize, modes: usize) -> bool {
        let holds = |values: &[f64], size: usize| {
            values.len() == size && values.iter().all(|value| value.is_finite())
        };
        let weight = |weight: f64| weight >= 0.0 && weight.is_finite();
        self.bounds.len() == states
            && self
                .bounds
                .iter()
                .all(|bounds| bounds.width() > 0.0 && bounds.width().is_finite())
            && weight(self.weights.before)
            && weight(self.weights.action)
            && weight(self.weights.past)
            && self.clusters.len() == modes
            && self
                .clusters
                .iter()
                .flat_map(|cluster| [&cluster.now, &cluster.before])
                .all(|sight| holds(&sight.place, states) && holds(&sight.actions, actions))
    }
}

impl Weights {
    /// Squared distance of two clusters.
    pub fn between(&self, a: &Cluster, b: &Cluster) -> f64 {
        let apart = |a: &Sight, b: &Sight| self.apart(a, |i| b.place[i], |i| b.actions[i]);
        apart(&a.now, &b.now) + self.before * apart(&a.before, &b.before)
    }

    /// A component of what a cluster passes on, from those of itself and of what was passed on to it.
    pub fn passed(&self, now: f64, before: f64) -> f64 {
        now + self.past * (before - now)
    }

    fn apart(&self, a: &Sight, place: impl Fn(usize) -> f64, led_by: impl Fn(usize) -> f64) -> f64 {
        squares(&a.place, place) / a.place.len() as f64
            + 0.5 * self.action * squares(&a.actions, led_by)
    }
}

fn squares(a: &[f64], b: impl Fn(usize) -> f64) -> f64 {
    let squares = a.iter().enumerate().map(|(i, a)| (a - b(i)) * (a - b(i)));
    squares.sum()
}

/// A number scaled to `[0, 1]` over finite bounds; one outside is that of the nearest end.
pub fn scaled(bounds: &Interval, x: f64) -> f64 {
    ((x - bounds.low) / bounds.width()).clamp(0.0, 1.0)
}

/// Half the squared distance from an action as a unit vector, or from none as the zero vector: 1 between two actions.
fn led(actions: &[f64], action: Option<ActionId>) -> f64 {
    0.5 * squares(actions, |i| f64::from(u8::from(Some(i) == action)))
}
