//! Values of actions by stratum and mean, as a policy.

use crate::belief::Belief;
use crate::model::ActionId;
use crate::policy::Policy;
use crate::solve::grid::Grid;

/// Values of all actions on a grid of means, for every stratum.
#[derive(Debug, Clone)]
pub struct GridValues {
    grid: Grid,
    /// By action and stratum: a value for every point of the grid.
    values: Vec<Vec<f64>>,
    strata: usize,
    actions: usize,
}

impl GridValues {
    /// Of values by stratum, point and action.
    pub(super) fn new(grid: Grid, found: Vec<f64>, strata: usize, actions: usize) -> Self {
        let points = grid.len();
        let of = |action: usize, stratum: usize| {
            let at = move |point: usize| (stratum * points + point) * actions + action;
            (0..points).map(|point| found[at(point)]).collect()
        };
        Self {
            values: (0..actions)
                .flat_map(|action| (0..strata).map(move |stratum| (action, stratum)))
                .map(|(action, stratum)| of(action, stratum))
                .collect(),
            grid,
            strata,
            actions,
        }
    }

    fn best(&self, belief: &Belief) -> (ActionId, f64) {
        let stratum = belief.stratum.min(self.strata - 1);
        let value = |action: usize| {
            let values = &self.values[action * self.strata + stratum];
            self.grid.interpolate(values, &belief.mean)
        };
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
        let values = &self.values[action * self.strata + belief.stratum.min(self.strata - 1)];
        Some(self.grid.interpolate(values, &belief.mean))
    }

    fn value(&self, belief: &Belief) -> Option<f64> {
        Some(self.best(belief).1)
    }
}
