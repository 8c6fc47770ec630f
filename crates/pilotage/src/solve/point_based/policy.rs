//! Acting on beliefs kept as cells.
//!
//! What is kept in full is asked in full. Where only what it is read as is known, the belief with these moments takes its place.

use std::sync::Arc;

use super::backup::Backup;
use super::graph::{self, Grapher};
use super::point::{Point, ValueVector, VectorSet};
use super::{occupied, size};
use crate::belief::{Belief, Cells, CellsKeeping, Codebook, Held, Keeping};
use crate::model::{ActionId, Model};
use crate::policy::{Policy, PolicyGraph};
use crate::progress::Progress;
use crate::solve::Size;

/// What to do at a belief, by the vectors of a plan.
#[derive(Debug, Clone)]
pub struct PointBasedPolicy {
    pub(super) backup: Backup,
    set: VectorSet,
}

impl PointBasedPolicy {
    pub(super) fn new(backup: Backup, set: VectorSet) -> Self {
        Self { backup, set }
    }

    /// What keeps the beliefs.
    pub fn keeping(&self) -> &CellsKeeping {
        &self.backup.keeping
    }

    /// The vectors.
    pub fn vectors(&self) -> &[Arc<ValueVector>] {
        &self.set.vectors
    }

    /// What the best vector is worth at a belief: at least that can be earned from there.
    pub fn value(&self, belief: &Cells) -> f64 {
        self.set.best(&Point::new(belief.probabilities())).1
    }

    /// The action of the best vector.
    pub fn action(&self, belief: &Cells) -> ActionId {
        let best = self.set.best(&Point::new(belief.probabilities())).0;
        self.set.vectors[best].action
    }

    /// The policy as a graph, where the sensor is discrete, of no more nodes than it may have, and else of as few as cost no more than it may
    /// lose. What is planned is what the graph earns on the cells over an episode, exactly; it may be more than the vectors promise.
    pub fn graph(
        &self,
        model: &Model,
        limits: Size,
        observer: &dyn Progress,
    ) -> Option<PolicyGraph> {
        if !self.backup.keeping.is_discrete() {
            return None;
        }
        let grapher = Grapher::new(&self.backup);
        let whole = graph::merged(grapher.of(&self.set));
        let found = size::sized(&grapher, whole, limits, observer);
        let found = occupied::settled(&grapher, found, model.episode.length);
        Some(grapher.told(model, &found))
    }

    /// What each action is worth by one look ahead at what may be sensed. It takes as long as a backup, and the best is never worth less
    /// than [`PointBasedPolicy::value`] at the beliefs of the plan.
    pub fn look_ahead(&self, belief: &Cells) -> Vec<f64> {
        let point = Point::new(belief.probabilities());
        let actions = 0..self.backup.keeping.actions();
        actions
            .map(|action| self.backup.choice(action, &point, &self.set).value)
            .collect()
    }
}

/// The vectors, for beliefs that are read by a codebook.
#[derive(Debug, Clone)]
pub(super) struct Read {
    pub(super) policy: PointBasedPolicy,
    pub(super) codebook: Arc<Codebook>,
}

impl Read {
    fn cells(&self, belief: &Belief) -> Cells {
        let last = self.codebook.len().saturating_sub(1);
        let stratum = self.codebook.stratum(belief.stratum.min(last));
        let moments = stratum.at(belief.mean.clone());
        self.policy.keeping().with_moments(&moments)
    }
}

impl Policy for Read {
    fn action(&self, belief: &Belief) -> ActionId {
        self.policy.action(&self.cells(belief))
    }

    fn action_in_full(&self, held: &Held) -> ActionId {
        match held.cells() {
            Some(cells) => self.policy.action(cells),
            None => self.action(held.belief()),
        }
    }

    fn values_in_full(&self, held: &Held) -> Option<Vec<f64>> {
        held.cells().map(|cells| self.policy.look_ahead(cells))
    }

    fn value(&self, belief: &Belief) -> Option<f64> {
        Some(self.policy.value(&self.cells(belief)))
    }
}
