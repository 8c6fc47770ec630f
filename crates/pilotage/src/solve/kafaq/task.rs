//! What a learner has: its own motion and sensor noise, its body's bounds, and a world to act in.

use super::axes::{axes, extents};
use super::lattice::{Lattice, boxes_needed, cells_needed};
use super::settings::{Rules, Settings};
use crate::belief::{BeliefMdp, BeliefSpace, StratumId, Updater};
use crate::error::Result;
use crate::model::{Fingerprint, Model};
use crate::policy::{Automaton, Coordinates, MOST_COORDINATES};
use crate::scenario::Scenario;
use crate::solve::Settings as _;
use crate::solve::learn::{Actor, Trial, Worlds, beliefs, run_trial, unbounded};
use crate::solve::solver::{refuse, refuse_if};
use crate::world::{ProblemWorld, World};

/// Name of the solver in errors and policies.
pub(super) const SOLVER: &str = "kafaq";

/// Most boxes of neighbourhoods: all of them are kept.
const MOST_BOXES: f64 = 1e7;

/// The learner's task.
pub(super) struct Task<'a> {
    /// What the agent believes by what it knows of itself.
    pub(super) space: Box<dyn BeliefSpace>,
    pub(super) settings: Settings,
    pub(super) worlds: &'a Worlds<'a>,
    /// What the lattice is laid along; `None` for the state variables.
    pub(super) coordinates: Option<Coordinates>,
    pub(super) lattice: Lattice,
    pub(super) updater: Updater,
    /// Strata from the least certain to the most certain one: levels from the start to the steady one, or all strata of beliefs in full.
    pub(super) chain: Vec<StratumId>,
    /// Strata that are learned at once, the last of the chain: the steady level, whose less certain ones follow it afterwards, or all of
    /// beliefs in full, between which they go to and fro.
    pub(super) sheets: usize,
    /// Fingerprint of the whole problem.
    pub(super) fingerprint: Fingerprint,
}

impl<'a> Task<'a> {
    /// The task of a model, of which only its body, the discount and the length of an episode are looked at.
    pub(super) fn new(model: &Model, settings: Settings, worlds: &'a Worlds<'a>) -> Result<Self> {
        settings.validate()?;
        let fingerprint = model.fingerprint();
        let body = model.body();
        let in_full = !body.is_linear();
        if in_full {
            check_in_full(&body, &settings)?;
        }
        let space = beliefs(&body, settings.strata())?;
        let refuse = |reason: String| refuse(SOLVER, model, reason);
        check_bounds(model)?;
        let chain = match space.as_mdp() {
            Some(mdp) => chain(mdp).map_err(refuse)?,
            None => (0..space.strata()).collect(),
        };
        let covariance = space.covariance(chain[chain.len() - 1]);
        let coordinates = if in_full { None } else { axes(model) };
        let extents = extents(&body, coordinates.as_ref(), covariance);
        let known = extents.iter().position(|extent| extent.deviation <= 0.0);
        if let Some(known) = known.filter(|_| !in_full) {
            return Err(refuse(format!(
                "its neighbourhoods are measured by the steady uncertainty, and {} is known exactly; add noise to [motion] or [sensor]",
                model.state[known].name
            )));
        }
        let sheets = if in_full { chain.len() } else { 1 };
        let most_along = match in_full {
            true => settings.cells_along_in_full(sheets, extents.len()),
            false => settings.cells_along,
        };
        let bounds: Vec<_> = extents.iter().map(|extent| extent.bounds).collect();
        let side: Vec<f64> = extents
            .iter()
            .map(|extent| {
                let finest = settings.cell * extent.deviation;
                let step = settings.cell_stride * extent.stride;
                let most = extent.bounds.width() / most_along as f64;
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
            updater: space.updater(),
            lattice: Lattice::new(&bounds, &side),
            coordinates,
            space,
            settings,
            worlds,
            chain,
            sheets,
            fingerprint,
        })
    }

    /// What the agent knows of itself.
    pub(super) fn body(&self) -> &Model {
        self.space.model()
    }

    /// Number of actions.
    pub(super) fn actions(&self) -> usize {
        self.body().actions.len()
    }

    /// Discount factor.
    pub(super) fn discount(&self) -> f64 {
        self.body().discount
    }

    /// The steady level; of beliefs in full, the most certain stratum.
    pub(super) fn steady(&self) -> StratumId {
        self.chain[self.chain.len() - 1]
    }

    /// Strata of the chain that are learned upon those that are learned at once.
    pub(super) fn later(&self) -> usize {
        self.chain.len() - self.sheets
    }

    /// Number of a stratum among those that are learned at once, if it is one of them.
    pub(super) fn sheet(&self, stratum: StratumId) -> Option<usize> {
        self.chain[self.later()..]
            .iter()
            .position(|learned| *learned == stratum)
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
        let covariance = self.space.covariance(self.steady());
        (0..covariance.nrows())
            .map(|i| covariance[(i, i)].sqrt())
            .collect()
    }

    /// An actor in a new world.
    pub(super) fn actor(&self) -> Actor<'_> {
        Actor::new(self.worlds, &self.updater, self.updater.readings())
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
    let body = model.body();
    if !body.is_linear() {
        check_in_full(&body, settings)?;
        return check_bounds(model);
    }
    let worlds = || -> Box<dyn World> { Box::new(ProblemWorld::new(&Scenario::assumed(model))) };
    Task::new(model, settings.clone(), &worlds).map(drop)
}

fn check_in_full(body: &Model, settings: &Settings) -> Result<()> {
    let reason = "the printed rules follow one chain of uncertainty levels, and its beliefs are kept in full; set `rules` to `tested`";
    let printed = settings.rules == Rules::Printed;
    refuse_if(SOLVER, body, printed.then(|| reason.to_owned()))
}

fn check_bounds(model: &Model) -> Result<()> {
    let reason = unbounded(model).map(|variable| {
        format!("it collects evidence over the world's outer bounds, and {variable} has none; add `state.bounds`")
    });
    refuse_if(SOLVER, model, reason)
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
