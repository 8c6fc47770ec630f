//! What the learner has: its own motion and sensor noise, its body's bounds, and worlds to act in.

use super::settings::Settings;
use crate::belief::{BeliefMdp, Filter};
use crate::error::{Error, Result};
use crate::model::{Fingerprint, Model};
use crate::policy::Automaton;
use crate::solve::Settings as _;
use crate::solve::learn::{Trial, Worlds, known, run_trial};

/// Name of the solver in errors and policies.
pub(super) const SOLVER: &str = "arkaq";

/// The learner's task.
pub(super) struct Task<'a> {
    /// What the agent assumes, without map, rewards, events and modes.
    pub(super) mdp: BeliefMdp,
    /// The filter before there are clusters.
    pub(super) filter: Filter,
    pub(super) settings: Settings,
    pub(super) worlds: &'a Worlds<'a>,
    /// Fingerprint of the whole problem.
    pub(super) fingerprint: Fingerprint,
}

impl<'a> Task<'a> {
    /// The task of a model, of which only A, B, H, Q, R, the bounds, the start belief, the discount and the length of an episode are
    /// looked at.
    pub(super) fn new(model: &Model, settings: Settings, worlds: &'a Worlds<'a>) -> Result<Self> {
        settings.validate()?;
        if let Some(variable) = model.state.iter().find(|v| !v.bounds.width().is_finite()) {
            return Err(Error::Unsupported {
                solver: SOLVER,
                model: model.name.clone(),
                reason: format!(
                    "it measures beliefs by the world's outer bounds, and {} has none; add `state.bounds`",
                    variable.name
                ),
            });
        }
        let mdp = BeliefMdp::new(&known(model));
        mdp.check()?;
        mdp.check_bounded()?;
        Ok(Self {
            filter: mdp.filter(),
            mdp,
            settings,
            worlds,
            fingerprint: model.fingerprint(),
        })
    }

    /// Number of actions.
    pub(super) fn actions(&self) -> usize {
        self.mdp.model().actions.len()
    }

    /// Discount factor.
    pub(super) fn discount(&self) -> f64 {
        self.mdp.model().discount
    }

    /// Runs an automaton, the same episodes at every trial.
    pub(super) fn trial(&self, automaton: &Automaton) -> Trial {
        let Settings { trial, seed, .. } = self.settings;
        run_trial(self.mdp.model(), self.worlds, automaton, trial, seed)
    }
}
