//! Acting on beliefs kept as cells.

use std::sync::Arc;

use super::backup::Backup;
use super::point::{Point, ValueVector, VectorSet};
use crate::belief::{Cells, CellsKeeping};
use crate::model::ActionId;

/// What to do at a belief, by the vectors of a plan.
#[derive(Debug, Clone)]
pub struct PointBasedPolicy {
    backup: Backup,
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

    /// The action that is best by one look ahead at what may be sensed, and its value. It takes as long as a backup, and never promises
    /// less than [`PointBasedPolicy::value`] at the beliefs of the plan.
    pub fn look_ahead(&self, belief: &Cells) -> (ActionId, f64) {
        let point = Point::new(belief.probabilities());
        let choice = self.backup.choose(&point, &self.set);
        (choice.action, choice.value)
    }
}
