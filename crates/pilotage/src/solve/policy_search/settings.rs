//! What a search for switching planes is told.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::Result;
use crate::model::Model;
use crate::solve::refusals;
use crate::solve::settings::{Settings, ensure};

/// Most [`PolicySearch::effort`].
const MOST_EFFORT: f64 = 1000.0;

/// Name of the solver in errors and policies.
pub(super) const SOLVER: &str = "policy-search";

/// What a search aims at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Objective {
    /// The discounted return of an episode, the reward of failing included.
    #[default]
    Return,
    /// Staying within the failure limits; rewards are not looked at.
    Survival,
}

/// The planner that searches switching planes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PolicySearch {
    /// What is sought: `return`, or `survival` for staying within the failure limits whatever is paid. A model that pays nothing is
    /// survived.
    pub objective: Objective,
    /// Cost of the strongest control of the actions, in units of the cost of being at a limit, for the planes it begins with; more than
    /// 0.
    pub control_weight: f64,
    /// Factor on the length of all simulations; more than 0, at most 1000, and 1 is the thorough search.
    pub effort: f64,
}

impl Default for PolicySearch {
    fn default() -> Self {
        Self {
            objective: Objective::default(),
            control_weight: 0.01,
            effort: 1.0,
        }
    }
}

impl PolicySearch {
    /// A search for survival.
    pub fn survival() -> Self {
        Self {
            objective: Objective::Survival,
            ..Self::default()
        }
    }

    /// What is sought in a model: where nothing is paid there is only survival.
    pub(super) fn aim(&self, model: &Model) -> Objective {
        match refusals::nothing_paid(model) {
            Some(_) => Objective::Survival,
            None => self.objective,
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
