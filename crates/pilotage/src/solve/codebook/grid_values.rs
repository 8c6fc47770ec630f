//! Values of actions by stratum and mean, as a policy.

use std::sync::Arc;

use crate::belief::{Belief, Codebook, Held, Moments};
use crate::model::ActionId;
use crate::policy::{Policy, first_best};

use super::means::Means;

/// Values of all actions on a grid of means, for every stratum. A belief in full lies between several strata, one that is read is of one.
#[derive(Debug, Clone)]
pub struct GridValues {
    means: Means,
    codebook: Arc<Codebook>,
    /// By action and stratum: a value for every point of the grid.
    values: Vec<Vec<f64>>,
    actions: usize,
}

impl GridValues {
    /// Of values by stratum, point and action.
    pub(super) fn new(
        means: Means,
        codebook: Arc<Codebook>,
        found: &[f64],
        actions: usize,
    ) -> Self {
        let (points, strata) = (means.len(), codebook.len());
        let of = |action: usize, stratum: usize| {
            let at = move |point: usize| (stratum * points + point) * actions + action;
            (0..points).map(|point| found[at(point)]).collect()
        };
        Self {
            values: (0..actions)
                .flat_map(|action| (0..strata).map(move |stratum| (action, stratum)))
                .map(|(action, stratum)| of(action, stratum))
                .collect(),
            means,
            codebook,
            actions,
        }
    }

    /// What every action is worth at a belief of these moments, of which its plan was made: between strata and between points.
    pub(super) fn values_between(&self, moments: &Moments) -> Vec<f64> {
        let strata = self.codebook.between(moments, &mut Vec::new());
        let around = self.means.around(&moments.mean);
        let value = |action: usize| -> f64 {
            let of =
                |&(stratum, weight): &(usize, f64)| weight * self.worth(action, stratum, &around);
            strata.iter().map(of).sum()
        };
        (0..self.actions).map(value).collect()
    }

    /// What an action is worth in a stratum, between points with their weights.
    fn worth(&self, action: ActionId, stratum: usize, around: &[(usize, f64)]) -> f64 {
        let strata = self.codebook.len();
        let values = &self.values[action * strata + stratum.min(strata - 1)];
        around
            .iter()
            .map(|(point, part)| part * values[*point])
            .sum()
    }

    fn best(&self, belief: &Belief) -> (ActionId, f64) {
        let around = self.means.around(&belief.mean);
        let value = |action| self.worth(action, belief.stratum, &around);
        let better = |best: (ActionId, f64), action| match value(action) {
            value if value > best.1 => (action, value),
            _ => best,
        };
        (1..self.actions).fold((0, value(0)), better)
    }
}

impl Policy for GridValues {
    fn action(&self, belief: &Belief) -> ActionId {
        self.best(belief).0
    }

    fn action_value(&self, belief: &Belief, action: ActionId) -> Option<f64> {
        let around = self.means.around(&belief.mean);
        Some(self.worth(action, belief.stratum, &around))
    }

    fn action_in_full(&self, held: &Held) -> ActionId {
        match self.values_in_full(held) {
            Some(values) => first_best(&values),
            None => self.action(held.belief()),
        }
    }

    fn values_in_full(&self, held: &Held) -> Option<Vec<f64>> {
        held.moments().map(|moments| self.values_between(moments))
    }

    fn value(&self, belief: &Belief) -> Option<f64> {
        Some(self.best(belief).1)
    }
}
