//! The linear-quadratic-Gaussian controller: the best linear feedback on the mean of the Kalman filter, `u = -L m`.
//!
//! Costs count as negative reward: what is planned and what is earned are both `-cost`, so that more is better everywhere.
//!
//! A model that has a `[cost]` and pays no reward is solved exactly: a free control over a finite episode ([`LqgController`]). For other
//! models it is a baseline: the action whose control is nearest to the command ([`NearestAction`]), which for two opposite forces
//! is the sign of the command.
//!
//! # References
//! K. J. Åström, *Introduction to Stochastic Control Theory*, 1970, chapter 8.

mod controller;
mod nearest;
mod stage;

pub use controller::LqgController;
pub use nearest::{NearestAction, Weights};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Form;
use super::refusals;
use super::settings::{Settings, ensure};
use super::solver::{Found, Plan, Planner, Problem, refuse_if};
use crate::error::Result;
use crate::model::{Interval, Model};
use crate::progress::Progress;

/// Name of the solver in errors and policies.
const SOLVER: &str = "lqg";

/// The linear-quadratic-Gaussian controller.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Lqg {
    /// What deviations cost, where an action is chosen. A free control always has the model's own cost.
    #[serde(flatten)]
    pub weights: Weights,
}

impl Settings for Lqg {
    fn validate(&self) -> Result<()> {
        for (setting, weights, least) in [
            ("state_weights", &self.weights.state, 0.0),
            ("control_weights", &self.weights.control, f64::MIN_POSITIVE),
        ] {
            let weights = weights.as_deref().unwrap_or_default();
            let fits = |weight: &f64| weight.is_finite() && *weight >= least;
            let range = nearest::WEIGHTS;
            ensure(
                setting,
                format!("{weights:?}"),
                weights.iter().all(fits),
                range,
            )?;
        }
        Ok(())
    }
}

impl Planner for Lqg {
    fn name(&self) -> &'static str {
        SOLVER
    }

    fn accepts(&self, model: &Model) -> Result<()> {
        let reason = use_of(model)
            .err()
            .or_else(|| refusals::steps_differ(model))
            .or_else(|| refusals::drifts(model));
        refuse_if(SOLVER, model, reason)
    }

    fn plan(&self, problem: &Problem, _: &dyn Progress) -> Result<Plan> {
        if !self.makes_automaton(problem.model()) {
            let controller = LqgController::new(problem.mdp())?;
            return Ok(Plan {
                value: Some(controller.planned_value()),
                ..Plan::of(Found::Control(controller))
            });
        }
        let policy = NearestAction::new(problem.model(), &self.weights)?;
        // Two nodes say it exactly where there are two actions.
        let nodes = match problem.form() {
            Form::Nearest => policy.automaton(problem.mdp()),
            Form::Segments | Form::Tree | Form::Grid | Form::Graph => None,
        };
        Ok(match nodes {
            Some(automaton) => Plan::automaton(automaton),
            None => Plan::rule(policy, problem.mdp().clone()),
        })
    }

    fn makes_automaton(&self, model: &Model) -> bool {
        use_of(model) != Ok(Use::Control)
    }
}

/// Which of its two uses a model is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Use {
    /// A free control and a quadratic cost, solved exactly.
    Control,
    /// A choice among actions, for whatever reward the model pays.
    Actions,
}

/// Which use a model is for, or why it is for neither and what would do.
fn use_of(model: &Model) -> std::result::Result<Use, String> {
    let limited = |&(_, side): &(usize, Interval)| side != Interval::ALL;
    let fails = model.episode.alive.sides.iter().any(limited);
    let pays = !model.rewards.is_empty() || !model.events.is_empty() || fails;
    match (&model.cost, pays) {
        (Some(_), false) => Ok(Use::Control),
        (Some(_), true) => Ok(Use::Actions),
        (None, _) if fails => Ok(Use::Actions),
        (None, _) => Err(
            "nothing says what is to be held near the origin; add a [cost], or limits to `episode.alive`".to_owned(),
        ),
    }
}
