//! What a learner has: its own motion and sensor noise, its body's bounds, and a world to act in.

use super::axes::{axes, extents};
use super::lattice::{Lattice, cells_needed};
use super::settings::Settings;
use crate::belief::{Belief, BeliefMdp, Filter, LevelId};
use crate::error::{Error, Result};
use crate::model::{ActionId, Model, Then, WorldSpec};
use crate::parallel;
use crate::policy::{Automaton, Controller, Coordinates, MOST_COORDINATES};
use crate::simulate::{Agent, Episode, run_episode};
use crate::world::{Draws, Step, World};

/// Name of the solver in errors and policies.
pub(super) const SOLVER: &str = "kafaq";

/// Trials are episodes of this number and up, which learning never reaches.
const TRIALS: u64 = 1 << 40;

/// Episodes of a trial that one thread runs at a time.
const CHUNK: usize = 25;

/// Makes a world to act in.
pub type Worlds<'a> = dyn Fn() -> Box<dyn World> + Sync + 'a;

/// The learner's task.
pub(super) struct Task<'a> {
    /// What the agent assumes, without map, rewards, events and modes.
    pub mdp: BeliefMdp,
    pub settings: Settings,
    pub worlds: &'a Worlds<'a>,
    /// What the lattice is laid along; `None` for the state variables.
    pub coordinates: Option<Coordinates>,
    pub lattice: Lattice,
    pub filter: Filter,
    /// Levels from the start to the steady one.
    pub chain: Vec<LevelId>,
    /// Fingerprint of the whole problem.
    pub fingerprint: u64,
}

impl<'a> Task<'a> {
    /// The task of a model, of which only A, B, H, Q, R, the bounds, the start belief, the discount and the length of an episode are
    /// looked at.
    pub fn new(model: &Model, settings: Settings, worlds: &'a Worlds<'a>) -> Result<Self> {
        settings.validate()?;
        let fingerprint = model.fingerprint();
        let mdp = BeliefMdp::new(&known(model));
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
        let covariance = mdp.levels().covariance(chain[chain.len() - 1]);
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
    pub fn actions(&self) -> usize {
        self.mdp.model().actions.len()
    }

    /// Discount factor.
    pub fn discount(&self) -> f64 {
        self.mdp.model().discount
    }

    /// The steady level.
    pub fn steady(&self) -> LevelId {
        self.chain[self.chain.len() - 1]
    }

    /// The neighbourhood of a mean.
    pub fn cell(&self, mean: &[f64]) -> usize {
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
    pub fn deviations(&self) -> Vec<f64> {
        let covariance = self.mdp.levels().covariance(self.steady());
        (0..covariance.nrows())
            .map(|i| covariance[(i, i)].sqrt())
            .collect()
    }

    /// An actor in a new world.
    pub fn actor(&self) -> Actor<'_> {
        let model = self.mdp.model();
        Actor {
            world: (self.worlds)(),
            filter: &self.filter,
            belief: self.filter.initial(),
            scratch: vec![0.0; model.state_dim()],
            observation: vec![0.0; model.observation_dim()],
        }
    }

    /// Runs an automaton, the same episodes at every trial.
    pub fn trial(&self, automaton: &Automaton) -> Trial {
        let controller = Controller::new(automaton);
        let model = self.mdp.model();
        let episodes = self.settings.trial;
        let chunks = parallel::map(episodes.div_ceil(CHUNK), |chunk| {
            let mut world = (self.worlds)();
            let mut agent = Visitor {
                controller: controller.clone(),
                visits: vec![0.0; automaton.nodes.len()],
            };
            let mut observation = vec![0.0; model.observation_dim()];
            let range = chunk * CHUNK..((chunk + 1) * CHUNK).min(episodes);
            let returns: Vec<Episode> = range
                .map(|episode| {
                    let mut draws = Draws::new(self.settings.seed, TRIALS + episode as u64);
                    let limits = (model.episode.length, model.discount);
                    run_episode(
                        world.as_mut(),
                        &mut agent,
                        &mut draws,
                        &mut observation,
                        limits,
                        &mut |_, _| {},
                    )
                })
                .collect();
            (returns, agent.visits)
        });
        let mut trial = Trial {
            episodes: Vec::with_capacity(episodes),
            visits: vec![0.0; automaton.nodes.len()],
        };
        for (episodes, visits) in chunks {
            trial.episodes.extend(episodes);
            trial
                .visits
                .iter_mut()
                .zip(visits)
                .for_each(|(sum, visits)| *sum += visits);
        }
        trial
    }
}

/// A world and the belief about it.
pub(super) struct Actor<'a> {
    world: Box<dyn World>,
    filter: &'a Filter,
    pub belief: Belief,
    scratch: Vec<f64>,
    observation: Vec<f64>,
}

impl Actor<'_> {
    /// Starts an episode.
    pub fn reset(&mut self, draws: &mut Draws) {
        self.world.reset(draws);
        self.filter.reset(&mut self.belief);
    }

    /// Takes an action and what it brings into the belief.
    pub fn step(&mut self, action: ActionId, draws: &mut Draws) -> Step {
        let step = self.world.step(action, draws, &mut self.observation);
        match step.then {
            Then::Continue => {
                let (belief, scratch) = (&mut self.belief, &mut self.scratch);
                self.filter
                    .update(belief, action, &self.observation, scratch);
            }
            Then::Restart => self.filter.reset(&mut self.belief),
            Then::End => {}
        }
        step
    }
}

/// The part of a model that a learner is told.
fn known(model: &Model) -> Model {
    let mut start = model.start.clone();
    start.iter_mut().for_each(|hypothesis| hypothesis.mode = 0);
    Model {
        modes: vec![String::new()],
        start,
        rewards: Vec::new(),
        events: Vec::new(),
        cost: None,
        map: None,
        world: WorldSpec::default(),
        ..model.clone()
    }
}

/// Levels from the start to the steady one. They form a chain where all actions disturb motion and sensor alike.
fn chain(mdp: &BeliefMdp) -> std::result::Result<Vec<LevelId>, String> {
    let levels = mdp.levels();
    if levels.classes().len() > 1 {
        return Err("its actions disturb motion or sensor in different ways, so that uncertainty has no one order of levels to be learned in; \
                    use kbvi-closed"
            .to_owned());
    }
    let start = mdp.start().level;
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

/// What an automaton earned.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Trial {
    pub episodes: Vec<Episode>,
    /// Steps spent in each node.
    pub visits: Vec<f64>,
}

impl Trial {
    /// Steps taken.
    pub fn steps(&self) -> u64 {
        self.episodes
            .iter()
            .map(|episode| episode.steps as u64)
            .sum()
    }

    /// Mean of a return.
    pub fn mean(&self, of: fn(&Episode) -> f64) -> f64 {
        self.episodes.iter().map(of).sum::<f64>() / self.episodes.len() as f64
    }

    /// Standard errors by which a return exceeds that of another trial, episode by episode.
    pub fn excess(&self, other: &Self, of: fn(&Episode) -> f64) -> f64 {
        let pairs = self.episodes.iter().zip(&other.episodes);
        let differences: Vec<f64> = pairs.map(|(a, b)| of(a) - of(b)).collect();
        let estimate = crate::simulate::Estimate::of(differences.iter().copied());
        if estimate.mean == 0.0 {
            0.0
        } else {
            estimate.mean / estimate.stderr
        }
    }
}

/// Discounted return of an episode.
pub(super) fn discounted(episode: &Episode) -> f64 {
    episode.discounted
}

/// Undiscounted return of an episode.
pub(super) fn undiscounted(episode: &Episode) -> f64 {
    episode.undiscounted
}

/// Runs an automaton and counts where it is.
struct Visitor {
    controller: Controller,
    visits: Vec<f64>,
}

impl Agent for Visitor {
    fn reset(&mut self) {
        self.controller.reset();
    }

    fn act(&mut self) -> usize {
        let (node, action) = self.controller.decide();
        self.visits[node] += 1.0;
        action
    }

    fn observe(&mut self, action: usize, observation: &[f64]) {
        self.controller.observe(action, observation);
    }

    fn belief(&self) -> &Belief {
        self.controller.belief()
    }
}
