//! What a learner has: its own motion and sensor noise, its body's bounds, and a world to act in.

use super::axes::{axes, extents};
use super::lattice::{Lattice, boxes_needed, cells_needed};
use super::settings::Settings;
use crate::belief::{BeliefMdp, Filter, StratumId};
use crate::error::{Error, Result};
use crate::model::{Fingerprint, Model};
use crate::policy::{Automaton, Coordinates, MOST_COORDINATES};
use crate::solve::Settings as _;
use crate::solve::learn::{Actor, Trial, Worlds, known, run_trial};

/// Name of the solver in errors and policies.
pub(super) const SOLVER: &str = "kafaq";

/// Most boxes of neighbourhoods: all of them are kept.
const MOST_BOXES: f64 = 1e7;

/// The learner's task.
pub(super) struct Task<'a> {
    /// What the agent assumes, without map, rewards, events and modes.
    pub(super) mdp: BeliefMdp,
    pub(super) settings: Settings,
    pub(super) worlds: &'a Worlds<'a>,
    /// What the lattice is laid along; `None` for the state variables.
    pub(super) coordinates: Option<Coordinates>,
    pub(super) lattice: Lattice,
    pub(super) filter: Filter,
    /// Levels from the start to the steady one.
    pub(super) chain: Vec<StratumId>,
    /// Fingerprint of the whole problem.
    pub(super) fingerprint: Fingerprint,
}

impl<'a> Task<'a> {
    /// The task of a model, of which only A, B, H, Q, R, the bounds, the start belief, the discount and the length of an episode are
    /// looked at.
    pub(super) fn new(model: &Model, settings: Settings, worlds: &'a Worlds<'a>) -> Result<Self> {
        settings.validate()?;
        let fingerprint = model.fingerprint();
        let mdp = BeliefMdp::new(&known(model));
        mdp.check()?;
        let refuse = |reason: String| Error::Unsupported {
            solver: SOLVER,
            model: model.name.clone(),
            reason,
        };
        if let Some(variable) = model.state.iter().find(|v| !v.bounds.width().is_finite()) {
            return Err(refuse(format!(
                "it collects evidence over the world's outer bounds, and {} has none; add `state.bounds`",
                variable.name
            )));
        }
        let chain = chain(&mdp).map_err(refuse)?;
        let covariance = mdp.covariance(chain[chain.len() - 1]);
        let coordinates = axes(model);
        let extents = extents(model, coordinates.as_ref(), covariance);
        if let Some(known) = extents.iter().position(|extent| extent.deviation <= 0.0) {
            return Err(refuse(format!(
                "its neighbourhoods are measured by the steady uncertainty, and {} is known exactly; add noise to [motion] or [sensor]",
                model.state[known].name
            )));
        }
        let bounds: Vec<_> = extents.iter().map(|extent| extent.bounds).collect();
        let side: Vec<f64> = extents
            .iter()
            .map(|extent| {
                let finest = settings.cell * extent.deviation;
                let step = settings.cell_stride * extent.stride;
                let most = extent.bounds.width() / settings.cells_along as f64;
                finest.max(step).max(most)
            })
            .collect();
        let cells = cells_needed(&bounds, &side);
        if cells > settings.cell_limit as f64 {
            return Err(refuse(format!(
                "its bounds hold {cells:e} neighbourhoods of {} standard deviations, more than the {} allowed; set the learner's `cell` or `cell_limit` higher",
                settings.cell, settings.cell_limit
            )));
        }
        let boxes = boxes_needed(&bounds, &side);
        if boxes > MOST_BOXES {
            return Err(refuse(format!(
                "its neighbourhoods form {boxes:e} regions, more than the {MOST_BOXES:e} that can be looked at; set the learner's `cells_along` lower"
            )));
        }
        Ok(Self {
            filter: mdp.filter(),
            lattice: Lattice::new(&bounds, &side),
            coordinates,
            mdp,
            settings,
            worlds,
            chain,
            fingerprint,
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

    /// The steady level.
    pub(super) fn steady(&self) -> StratumId {
        self.chain[self.chain.len() - 1]
    }

    /// The neighbourhood of a mean.
    pub(super) fn cell(&self, mean: &[f64]) -> usize {
        match &self.coordinates {
            None => self.lattice.cell(mean),
            Some(coordinates) => {
                let mut place = [0.0; MOST_COORDINATES];
                coordinates.write(mean, &mut place);
                self.lattice.cell(&place[..coordinates.count()])
            }
        }
    }

    /// Standard deviation along each variable at the steady level.
    pub(super) fn deviations(&self) -> Vec<f64> {
        let covariance = self.mdp.covariance(self.steady());
        (0..covariance.nrows())
            .map(|i| covariance[(i, i)].sqrt())
            .collect()
    }

    /// An actor in a new world.
    pub(super) fn actor(&self) -> Actor<'_> {
        Actor::new(self.worlds, &self.filter, self.filter.readings())
    }

    /// Runs an automaton, the same episodes at every trial.
    pub(super) fn trial(&self, automaton: &Automaton) -> Trial {
        let Settings { trial, seed, .. } = self.settings;
        run_trial(self.mdp.model(), self.worlds, automaton, trial, seed)
    }
}

/// Levels from the start to the steady one. They form a chain where all actions disturb motion and sensor alike.
fn chain(mdp: &BeliefMdp) -> std::result::Result<Vec<StratumId>, String> {
    let levels = mdp.levels();
    if levels.classes().len() > 1 {
        return Err("its actions disturb motion or sensor in different ways, so that uncertainty has no one order of levels to be learned in; \
                    use value-iteration"
            .to_owned());
    }
    let start = mdp.start().stratum;
    let Some(steady) = levels.steady(start, 0) else {
        return Err(format!(
            "its uncertainty does not settle within {} levels; set `belief.level_tolerance` higher",
            levels.len()
        ));
    };
    let mut chain = vec![start];
    while chain[chain.len() - 1] != steady {
        chain.push(levels.step(chain[chain.len() - 1], 0).next);
    }
    Ok(chain)
}
