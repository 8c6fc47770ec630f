//! Policy search: the planes at which an automaton switches are moved to where it does best in simulated beliefs.

pub mod cma;
pub mod failure;
pub mod refine;
mod search;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use search::search;

use super::settings::{Settings, ensure};
use super::solver::{Plan, Planner, Problem, refuse_if};
use crate::belief::BeliefMdp;
use crate::error::Result;
use crate::model::Model;
use crate::observe::Observer;

/// Most [`PolicySearch::effort`].
const MOST_EFFORT: f64 = 1000.0;

/// Name of the solver in errors and policies.
const SOLVER: &str = "policy-search";

/// The planner that searches switching planes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PolicySearch {
    /// Cost of the strongest control of the actions, in units of the cost of being at a limit, for the planes it begins with; more than
    /// 0.
    pub control_weight: f64,
    /// Factor on the length of all simulations; more than 0, at most 1000, and 1 is the thorough search.
    pub effort: f64,
}

impl Default for PolicySearch {
    fn default() -> Self {
        Self {
            control_weight: 0.01,
            effort: 1.0,
        }
    }
}

impl Settings for PolicySearch {
    fn validate(&self) -> Result<()> {
        let (weight, effort) = (self.control_weight, self.effort);
        let within = |value: f64, most: f64| value > 0.0 && value <= most;
        ensure(
            "control_weight",
            weight,
            within(weight, f64::MAX),
            "above 0",
        )?;
        let range = "above 0, at most 1000";
        ensure("effort", effort, within(effort, MOST_EFFORT), range)
    }
}

impl Planner for PolicySearch {
    fn name(&self) -> &'static str {
        SOLVER
    }

    fn accepts(&self, model: &Model) -> Result<()> {
        refuse_if(SOLVER, model, search::refusal(&BeliefMdp::new(model)))
    }

    fn plan(&self, problem: &Problem, observer: &dyn Observer) -> Result<Plan> {
        let automaton = search(problem.mdp(), self, problem.seed(), observer)?;
        Ok(Plan::automaton(automaton))
    }
}
