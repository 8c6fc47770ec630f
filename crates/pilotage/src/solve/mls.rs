//! Most likely state: act as if the state that is most probable were certain.
//!
//! The most likely state of a Gaussian is its mean; of hypotheses that are points it is the one of largest weight, ties to the first.
//!
//! # References
//! I. Nourbakhsh, R. Powers, S. Birchfield, "DERVISH: an office-navigating robot", AI Magazine 16(2), 1995.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::mdp::{self, Settings, Space, StateMdp};
use super::settings;
use super::solver::{Plan, Planner, Problem};
use crate::belief::{Belief, BeliefMdp};
use crate::error::Result;
use crate::model::{ActionId, Model};
use crate::policy::Policy;
use crate::progress::Progress;

/// Name of the solver in errors and policies.
const SOLVER: &str = "mls";

/// The planner that acts as if the most likely state were certain.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Mls {
    /// The grid of true states, and how well it is solved.
    #[serde(flatten)]
    pub grid: Settings,
}

impl settings::Settings for Mls {
    fn validate(&self) -> Result<()> {
        self.grid.validate()
    }
}

impl Planner for Mls {
    fn name(&self) -> &'static str {
        SOLVER
    }

    fn accepts(&self, model: &Model) -> Result<()> {
        mdp::accepts(SOLVER, model)
    }

    fn plan(&self, problem: &Problem, observer: &dyn Progress) -> Result<Plan> {
        let policy = MostLikelyState::solve(problem.mdp(), &self.grid, observer)?;
        let converged = policy.converged();
        Ok(Plan {
            converged,
            ..Plan::rule(policy, problem.mdp().clone())
        })
    }
}

/// The policy of the underlying decision process ([`super::mdp`]), asked at the most likely state.
#[derive(Debug)]
pub(crate) struct MostLikelyState {
    mdp: StateMdp,
}

impl MostLikelyState {
    /// Solves the underlying decision process.
    ///
    /// # Errors
    /// As [`StateMdp::solve`].
    pub(crate) fn solve(
        belief_mdp: &BeliefMdp,
        settings: &Settings,
        observer: &dyn Progress,
    ) -> Result<Self> {
        let mdp = StateMdp::solve(belief_mdp, settings, observer)?;
        Ok(Self { mdp })
    }

    /// Whether value iteration converged.
    pub(crate) fn converged(&self) -> bool {
        self.mdp.converged
    }

    /// The state that is most probable at a belief, length `n`.
    pub(crate) fn most_likely(&self, belief: &Belief) -> Vec<f64> {
        let points = match self.mdp.space() {
            Space::Grid(_) => None,
            Space::Points(_) => self
                .mdp
                .belief_mdp()
                .hypotheses(belief.stratum, &belief.mean),
        };
        let heavier = |best: (f64, _), next: (f64, _)| if next.0 > best.0 { next } else { best };
        match points.into_iter().flatten().reduce(heavier) {
            Some((_, point)) => point.as_slice().to_vec(),
            None => belief.mean.clone(),
        }
    }
}

impl Policy for MostLikelyState {
    fn action(&self, belief: &Belief) -> ActionId {
        self.mdp.action(belief.mode, &self.most_likely(belief))
    }

    /// What the most likely state is worth to an agent that is told it.
    fn value(&self, belief: &Belief) -> Option<f64> {
        let q = self.mdp.q_values(belief.mode, &self.most_likely(belief));
        q.into_iter().reduce(f64::max)
    }
}
