//! KBVI, Kalman-based value iteration: the thesis' own method (chapter 5). Branches of actions fixed in advance are searched at every
//! belief, and the beliefs that the agent meets become nodes.

pub mod branches;
pub mod formulas;
pub mod generate;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::rollout::check_runs;
use super::settings::{Settings, ensure};
use super::solver::{Found, Plan, Planner, Problem, refuse_if};
use super::{Form, refusals};
use crate::error::Result;
use crate::model::Model;
use crate::policy::Matching;
use crate::progress::Progress;
use branches::Branches;
use formulas::Formulas;

/// Name of the solver in errors and policies.
const SOLVER: &str = "kbvi";

/// The planner of open-loop branches.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Kbvi {
    /// First horizon tried, in steps; at most 1000.
    pub first_horizon: usize,
    /// Last horizon tried; at least the first, at most 1000.
    pub last_horizon: usize,
    /// Horizons over which the number of nodes must not change; at least 1.
    pub repeats: usize,
    /// Steps for which an action is kept once chosen; at least 1.
    pub group: usize,
    /// Runs of the agent for each horizon; at least 1, at most a million. (Figure 5.8 makes one.)
    pub runs: usize,
    /// Whether it looks less far ahead with every step of an episode, as in Figure 5.8: `true` or `false`.
    pub decreasing: bool,
    /// The formulas.
    #[serde(flatten)]
    pub formulas: Formulas,
}

impl Default for Kbvi {
    fn default() -> Self {
        let generate = generate::Settings::default();
        Self {
            first_horizon: generate.search.horizon,
            last_horizon: generate.last_horizon,
            repeats: generate.repeats,
            group: generate.search.group,
            runs: generate.runs,
            decreasing: generate.decreasing,
            formulas: generate.search.formulas,
        }
    }
}

impl Settings for Kbvi {
    fn validate(&self) -> Result<()> {
        generate::check_horizons(self.first_horizon, self.last_horizon)?;
        check_runs("runs", self.runs)?;
        for (setting, value) in [("repeats", self.repeats), ("group", self.group)] {
            ensure(setting, value, value >= 1, "at least 1")?;
        }
        Ok(())
    }
}

/// Whether branches can be searched in a model.
///
/// # Errors
/// [`crate::Error::Unsupported`] with the reason, and what would do.
pub fn accepts(model: &Model) -> Result<()> {
    let reason = refusals::reward_missing(model)
        .or_else(|| refusals::pays_afterwards(model))
        .or_else(|| refusals::steps_differ(model));
    refuse_if(SOLVER, model, reason)
}

impl Planner for Kbvi {
    fn name(&self) -> &'static str {
        SOLVER
    }

    fn accepts(&self, model: &Model) -> Result<()> {
        accepts(model)
    }

    fn plan(&self, problem: &Problem, observer: &dyn Progress) -> Result<Plan> {
        let search = branches::Settings {
            horizon: self.first_horizon,
            group: self.group,
            formulas: self.formulas,
        };
        let settings = generate::Settings {
            matching: match problem.form() {
                Form::Segments => Matching::Segments,
                Form::Nearest | Form::Tree | Form::Grid | Form::Graph => Matching::Nearest,
            },
            search,
            last_horizon: self.last_horizon,
            repeats: self.repeats,
            runs: self.runs,
            decreasing: self.decreasing,
            seed: problem.seed(),
        };
        let generated = generate::generate(problem.mdp(), &settings, observer)?;
        let value = generated.automaton.planned_value;
        let policy = match problem.form() {
            Form::Nearest | Form::Segments | Form::Tree | Form::Graph => {
                Found::Automaton(generated.automaton)
            }
            Form::Grid => {
                let last = generated.history.last();
                let horizon = last.map_or(search.horizon, |last| last.0);
                let planner = Branches::new(problem.mdp().clone(), search);
                Found::Rule {
                    policy: Box::new(planner.with_horizon(horizon)),
                    space: Box::new(problem.mdp().clone()),
                }
            }
        };
        Ok(Plan {
            value,
            policy_convergence_horizon: generated.convergence_horizon,
            converged: generated.convergence_horizon.is_some(),
            ..Plan::of(policy)
        })
    }
}
