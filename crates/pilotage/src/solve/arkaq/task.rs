//! What the learner has: its own motion and sensor noise, its body's bounds, and worlds to act in.

use super::settings::Settings;
use crate::belief::{BeliefSpace, Updater};
use crate::error::Result;
use crate::model::{Fingerprint, Interval, Model};
use crate::policy::Automaton;
use crate::scenario::Scenario;
use crate::solve::Settings as _;
use crate::solve::learn::{Trial, Worlds, beliefs, run_trial, unbounded};
use crate::solve::solver::refuse_if;
use crate::world::{ProblemWorld, World};

/// Name of the solver in errors and policies.
pub(super) const SOLVER: &str = "arkaq";

/// The learner's task.
pub(super) struct Task<'a> {
    /// What the agent believes by what it knows of itself.
    pub(super) space: Box<dyn BeliefSpace>,
    /// What keeps that before there are clusters.
    pub(super) updater: Updater,
    pub(super) settings: Settings,
    pub(super) worlds: &'a Worlds<'a>,
    /// Fingerprint of the whole problem.
    pub(super) fingerprint: Fingerprint,
}

impl<'a> Task<'a> {
    /// The task of a model, of which only its body, the discount and the length of an episode are looked at.
    pub(super) fn new(model: &Model, settings: Settings, worlds: &'a Worlds<'a>) -> Result<Self> {
        settings.validate()?;
        check_bounds(model)?;
        let space = beliefs(&model.body(), settings.strata())?;
        if let Some(mdp) = space.as_mdp() {
            mdp.check_bounded()?;
        }
        Ok(Self {
            updater: space.updater(),
            space,
            settings,
            worlds,
            fingerprint: model.fingerprint(),
        })
    }

    /// What the agent knows of itself.
    pub(super) fn body(&self) -> &Model {
        self.space.model()
    }

    /// What places among clusters lie between.
    pub(super) fn extents(&self) -> Vec<Interval> {
        self.updater.extents(self.body())
    }

    /// Number of actions.
    pub(super) fn actions(&self) -> usize {
        self.body().actions.len()
    }

    /// Discount factor.
    pub(super) fn discount(&self) -> f64 {
        self.body().discount
    }

    /// Runs an automaton, the same episodes at every trial.
    pub(super) fn trial(&self, automaton: &Automaton) -> Trial {
        let Settings { trial, seed, .. } = self.settings;
        run_trial(self.body(), self.worlds, automaton, trial, seed)
    }
}

/// Whether a model can be learned, as far as that is known before its beliefs are.
///
/// # Errors
/// [`crate::Error::Unsupported`] with the reason, and what [`Task::new`] says where a filter keeps its beliefs.
pub(super) fn check(model: &Model, settings: &Settings) -> Result<()> {
    settings.validate()?;
    if !model.body().is_linear() {
        return check_bounds(model);
    }
    let worlds = || -> Box<dyn World> { Box::new(ProblemWorld::new(&Scenario::assumed(model))) };
    Task::new(model, settings.clone(), &worlds).map(drop)
}

fn check_bounds(model: &Model) -> Result<()> {
    let reason = unbounded(model).map(|variable| {
        format!("it measures beliefs by the world's outer bounds, and {variable} has none; add `state.bounds`")
    });
    refuse_if(SOLVER, model, reason)
}
