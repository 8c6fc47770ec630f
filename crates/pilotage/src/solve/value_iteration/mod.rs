//! Value iteration on beliefs: uncertainty level and mean.
//!
//! The thesis' branches (5.3, [`super::kbvi`]) fix a sequence of actions in advance, so to them sensing is worth nothing. Here the agent
//! is free to choose again after every observation, and the value of every belief is found once, on a grid of means ([`GridPolicy`]).

mod extent;
mod grid_policy;
mod horizon;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use super::grid::Settings;
pub use grid_policy::{GridPolicy, solve};

use super::refusals;
use super::settings;
use super::solver::{Plan, Planner, Problem, refuse_if};
use crate::error::Result;
use crate::model::Model;
use crate::progress::Progress;

/// Name of the solver in errors and policies.
const SOLVER: &str = "value-iteration";

/// The planner that iterates values on a grid of means.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ValueIteration {
    /// The grid, and how well it is solved.
    #[serde(flatten)]
    pub grid: Settings,
}

impl settings::Settings for ValueIteration {
    fn validate(&self) -> Result<()> {
        self.grid.validate()
    }
}

impl Planner for ValueIteration {
    fn name(&self) -> &'static str {
        SOLVER
    }

    fn accepts(&self, model: &Model) -> Result<()> {
        let n = model.state_dim();
        let fits = n <= extent::MOST_VARIABLES || self.grid.points.is_some();
        let reason = refusals::nothing_paid(model)
            .or_else(|| (!fits).then(|| extent::too_many_variables(n)))
            .or_else(|| refusals::bound_missing(model));
        refuse_if(SOLVER, model, reason)
    }

    /// A level has one mode, which is not so where it changes at a place and the belief is not sure of being there.
    fn suits(&self, model: &Model) -> bool {
        !refusals::guesses_modes(model)
    }

    fn plan(&self, problem: &Problem, observer: &dyn Progress) -> Result<Plan> {
        let policy = solve(problem.mdp(), &self.grid, observer)?;
        // Levels that tell the time are others than the problem's.
        let mdp = policy.mdp().clone();
        let (value, converged) = (policy.planned_value(), policy.converged);
        let remarks = policy.remarks().to_vec();
        Ok(Plan {
            value: Some(value),
            converged,
            remarks,
            ..Plan::rule(policy, mdp)
        })
    }
}
