//! Q_MDP: act as if all uncertainty were gone after this step.
//!
//! ```text
//! Q_MDP(b, a) = E Q(s, a),   s ~ b
//! ```
//!
//! with `Q` of the underlying decision process ([`super::mdp`]). It never pays for information, and its value is an upper bound of
//! what any policy earns.
//!
//! # References
//! M. L. Littman, A. R. Cassandra, L. P. Kaelbling, "Learning policies for partially observable environments: scaling up", 1995.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::mdp::{self, Settings, Space, StateMdp};
use super::settings;
use super::solver::{Plan, Planner, Problem};
use crate::belief::{Belief, BeliefMdp};
use crate::error::Result;
use crate::model::{ActionId, Model};
use crate::parallel;
use crate::policy::{Policy, first_best};
use crate::progress::Progress;

/// Name of the solver in errors and policies.
const SOLVER: &str = "qmdp";

/// The planner that acts as if all uncertainty were gone after this step.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Qmdp {
    /// The grid of true states, and how well it is solved.
    #[serde(flatten)]
    pub grid: Settings,
}

impl settings::Settings for Qmdp {
    fn validate(&self) -> Result<()> {
        self.grid.validate()
    }
}

impl Planner for Qmdp {
    fn name(&self) -> &'static str {
        SOLVER
    }

    fn accepts(&self, model: &Model) -> Result<()> {
        mdp::accepts(SOLVER, model)
    }

    fn plan(&self, problem: &Problem, observer: &dyn Progress) -> Result<Plan> {
        let policy = QmdpPolicy::solve(problem.mdp(), &self.grid, observer)?;
        let converged = policy.converged();
        Ok(Plan {
            converged,
            ..Plan::rule(policy, problem.mdp().clone())
        })
    }
}

/// The policy that is greedy in `Q_MDP`.
#[derive(Debug)]
pub(crate) struct QmdpPolicy {
    mdp: StateMdp,
    /// `E F(s, a)` for a belief centred on each grid point, by mode, level and action; none where the states are points.
    averaged: Vec<Vec<f64>>,
}

impl QmdpPolicy {
    /// Solves the underlying decision process and averages its values over every uncertainty level. The immediate reward is kept
    /// apart: its expectation is known exactly (Eq. 5.2).
    ///
    /// # Errors
    /// As [`StateMdp::solve`].
    pub(crate) fn solve(
        belief_mdp: &BeliefMdp,
        settings: &Settings,
        observer: &dyn Progress,
    ) -> Result<Self> {
        let mdp = StateMdp::solve(belief_mdp, settings, observer)?;
        let (levels, actions) = (belief_mdp.levels(), belief_mdp.model().actions.len());
        let averaged = match mdp.space() {
            Space::Points(_) => Vec::new(),
            Space::Grid(grid) => {
                let smoothers = parallel::map(levels.len(), |level| {
                    grid.smoother(levels.covariance(level))
                });
                let tables = belief_mdp.model().modes.len() * levels.len() * actions;
                parallel::map(tables, |index| {
                    let (place, action) = (index / actions, index % actions);
                    let (mode, level) = (place / levels.len(), place % levels.len());
                    smoothers[level].apply(grid, mdp.future(mode, action))
                })
            }
        };
        Ok(Self { mdp, averaged })
    }

    /// Whether value iteration converged.
    pub(crate) fn converged(&self) -> bool {
        self.mdp.converged
    }

    /// `Q_MDP(b, a)` of every action.
    pub(crate) fn q_values(&self, belief: &Belief) -> Vec<f64> {
        let belief_mdp = self.mdp.belief_mdp();
        let actions = belief_mdp.model().actions.len();
        let average = |action: ActionId| match self.mdp.space() {
            Space::Grid(grid) => {
                let place = belief.mode * belief_mdp.strata() + belief.stratum;
                grid.interpolate(&self.averaged[place * actions + action], &belief.mean)
            }
            Space::Points(_) => {
                let weights = belief_mdp.hypotheses(belief.stratum, &belief.mean);
                let future = self.mdp.future(belief.mode, action);
                weights
                    .iter()
                    .flatten()
                    .zip(future)
                    .map(|((weight, _), future)| weight * future)
                    .sum()
            }
        };
        (0..actions)
            .map(|action| {
                belief_mdp.reward(belief.mode, belief.stratum, &belief.mean, action)
                    + average(action)
            })
            .collect()
    }
}

impl Policy for QmdpPolicy {
    fn action(&self, belief: &Belief) -> ActionId {
        first_best(&self.q_values(belief))
    }

    fn value(&self, belief: &Belief) -> Option<f64> {
        self.q_values(belief).into_iter().reduce(f64::max)
    }
}
