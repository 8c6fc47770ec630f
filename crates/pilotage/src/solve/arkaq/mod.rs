//! ARKAQ-learning: clusters of beliefs with an action each (thesis chapter 3).
//!
//! The agent knows its own motion and sensor noise (`A`, `B`, `H`, `Q`, `R`), the world's outer bounds and its start belief. It sees
//! actions, observations and rewards, and knows neither map nor rewards in advance. Learning has the two phases of Figure 3.2:
//!
//! 1. *The world model* (`world_model`): acting at random, the agent clusters its beliefs with the network [`art`], then takes note of
//!    which clusters follow one another by which actions. A state of the automaton is the cluster it is in with the one before and the
//!    action between (`history`): states in the same cluster with different pasts tell what no sensor shows.
//! 2. *The policy* (`policy`): Q-learning with Boltzmann exploration on these states, which no longer change.
//!
//! The thesis' network makes clusters without end where much is continuous (3.4.6). Here [`Settings::state_limit`] ends exploration,
//! and the result says so.
//!
//! Beyond the thesis, and what its chapter 7 asks for: vigilance that tunes itself ([`Settings::vigilances`]), merging of states
//! that agree (`merge`), Watkins' Q(lambda), and a memory of more than one step ([`Settings::depth`]). [`Settings::extended`] has all
//! four.

pub mod art;
mod checkpoint;
mod coding;
mod draft;
mod history;
mod merge;
mod policy;
mod settings;
mod task;
mod world_model;

use std::path::Path;

use serde::{Deserialize, Serialize};

pub use crate::solve::learn::Worlds;
pub use settings::Settings;

use crate::error::Result;
use crate::model::{ActionId, Model};
use crate::observe::Observer;
use crate::policy::Automaton;
use crate::scenario::Scenario;
use crate::solve::learn::{Experience, critical, undiscounted};
use crate::world::{ProblemWorld, World};
use draft::Draft;
use policy::Policy;
use task::Task;
use world_model::WorldModel;

/// What a learning run found.
#[derive(Debug, Clone, PartialEq)]
pub struct Learned {
    /// The automaton, a node for each state. It runs without seeing rewards.
    pub automaton: Automaton,
    /// Whether no new states were found and the best actions had stopped changing.
    pub converged: bool,
    /// Steps of experience, trials included.
    pub samples: u64,
    /// How learning went.
    pub learning: Learning,
}

/// How learning went.
#[derive(Debug, Clone, PartialEq)]
pub struct Learning {
    /// Whether the world model is incomplete because it reached [`Settings::state_limit`].
    pub capped: bool,
    /// Vigilance of the network.
    pub vigilance: f64,
    /// Clusters of the world model.
    pub clusters: Vec<ClusterFound>,
    /// Its states, before any were merged.
    pub states: usize,
    /// How learning went, epoch by epoch, at all vigilances tried.
    pub curve: Vec<Point>,
}

impl Learning {
    /// What was found, in words.
    pub fn describe(&self) -> String {
        let cap = if self.capped {
            ", stopped by `state_limit`"
        } else {
            ""
        };
        format!(
            "{} clusters at vigilance {}, {} states{cap}",
            self.clusters.len(),
            self.vigilance,
            self.states
        )
    }
}

/// A cluster of the world model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ClusterFound {
    /// Its centre, length `n`, in units of the state.
    pub centre: Vec<f64>,
    /// How much of it was rewarded notably, in `[0, 1]`.
    pub rewarded: f64,
    /// Steps of experience at which it was founded.
    pub founded: u64,
}

/// An epoch of a learning run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Vigilance of the world model that a policy was being learned for.
    pub vigilance: f64,
    /// Steps of experience by its end.
    pub samples: u64,
    /// Reward a step, exploration included.
    pub reward: f64,
    /// By state: the best action and its value.
    pub states: Vec<(ActionId, f64)>,
}

/// Whether a model can be learned with these settings.
///
/// # Errors
/// As [`learn`].
pub fn accepts(model: &Model, settings: &Settings) -> Result<()> {
    let worlds = || -> Box<dyn World> { Box::new(ProblemWorld::new(&Scenario::assumed(model))) };
    Task::new(model, settings.clone(), &worlds).map(drop)
}

/// Learns an automaton in the worlds that `worlds` makes, of which `model` tells no more than the agent knows of itself.
///
/// With a checkpoint file the run writes its state there after every epoch, and goes on from there if the file exists: stopped and
/// resumed, it ends with the same result as if never stopped.
///
/// # Errors
/// [`crate::Error::Setting`] for settings out of range, [`crate::Error::Unsupported`] for a model without bounds,
/// [`crate::Error::NoSteadyState`] for one whose uncertainty grows without end, [`crate::Error::Checkpoint`] for a checkpoint of another
/// run or a damaged one, [`crate::Error::Io`] where it cannot be read or written.
pub fn learn(
    model: &Model,
    worlds: &Worlds<'_>,
    settings: &Settings,
    checkpoint: Option<&Path>,
    observer: &dyn Observer,
) -> Result<Learned> {
    let mut run = match checkpoint.filter(|path| path.exists()) {
        Some(path) => Run::resume(model, worlds, settings, path)?,
        None => Run::new(model, worlds, settings)?,
    };
    while !run.finished() {
        run.advance(observer)?;
        if let Some(path) = checkpoint {
            run.save(path)?;
        }
    }
    Ok(run.learned())
}

/// A learning run that can be watched, stopped and resumed.
pub struct Run<'a> {
    task: Task<'a>,
    state: State,
}

/// All that a run has to remember between two calls of [`Run::advance`].
#[derive(Debug, Clone, Serialize, Deserialize)]
struct State {
    experience: Experience,
    curve: Vec<Point>,
    /// Vigilances that are done with.
    tried: usize,
    /// What is being learned.
    world: WorldModel,
    policy: Policy,
    best: Option<Best>,
    finished: bool,
}

/// The best automaton so far and what it was made of.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Best {
    draft: Draft,
    world: WorldModel,
    converged: bool,
}

impl<'a> Run<'a> {
    /// A run that has explored at its first vigilance.
    ///
    /// # Errors
    /// As [`learn`].
    pub fn new(model: &Model, worlds: &'a Worlds<'a>, settings: &Settings) -> Result<Self> {
        let task = Task::new(model, settings.clone(), worlds)?;
        let mut experience = Experience::default();
        let world = world_model::generate(&task, settings.vigilances[0], &mut experience)?;
        let state = State {
            experience,
            curve: Vec::new(),
            tried: 0,
            policy: Policy::new(&task, world.states.len()),
            world,
            best: None,
            finished: false,
        };
        Ok(Self { task, state })
    }

    /// Whether there is nothing more to learn.
    pub fn finished(&self) -> bool {
        self.state.finished
    }

    /// Does one piece of work: an epoch of a policy, and what follows from it where it was the last at a vigilance.
    ///
    /// # Errors
    /// [`crate::Error::Input`] where a world's observation is not finite.
    pub fn advance(&mut self, observer: &dyn Observer) -> Result<()> {
        let (task, state) = (&self.task, &mut self.state);
        if state.finished {
            return Ok(());
        }
        let states = state.world.states.len();
        if state.policy.epochs() == 0 {
            observer.note(&state.world.describe());
        }
        let filter = task.filter.clone().recalling(state.world.recall.clone());
        let reward = state.policy.run_epoch(task, &filter, &mut state.experience);
        let (samples, epochs) = (state.experience.samples, state.policy.epochs() as u64);
        state.curve.push(Point {
            vigilance: state.world.vigilance,
            samples,
            reward,
            states: state.policy.choices(),
        });
        observer.progress("epochs", epochs, task.settings.epoch_limit as u64);
        observer.note(&format!(
            "{samples} steps: {reward:.3} a step, {states} states"
        ));
        if state.policy.finished(task) {
            self.conclude(observer);
            self.next_vigilance()?;
        }
        Ok(())
    }

    /// Makes the automaton of a vigilance and keeps it if it earns surely more than the best so far.
    fn conclude(&mut self, observer: &dyn Observer) {
        let (task, state) = (&self.task, &mut self.state);
        let draft = state.policy.draft(&state.world);
        let mut adopted = true;
        if task.settings.vigilances.len() > 1 {
            let trial = task.trial(&draft.compile(task));
            state.experience.samples += trial.steps();
            adopted = state.best.as_ref().is_none_or(|best| {
                let other = task.trial(&best.draft.compile(task));
                trial.excess(&other, undiscounted) > critical(task.settings.adopt_error)
            });
            observer.note(&format!(
                "vigilance {}: {:.3} an episode with {} nodes, {}",
                state.world.vigilance,
                trial.mean(undiscounted),
                draft.nodes.len(),
                if adopted { "adopted" } else { "not adopted" }
            ));
        }
        if adopted {
            state.best = Some(Best {
                draft,
                world: state.world.clone(),
                converged: state.world.settled && state.policy.converged(task),
            });
        }
    }

    /// Explores at the next vigilance. One that reached the limit of states is the last, as a higher one would reach it too.
    fn next_vigilance(&mut self) -> Result<()> {
        let (task, state) = (&self.task, &mut self.state);
        state.tried += 1;
        match task.settings.vigilances.get(state.tried) {
            Some(&vigilance) if !state.world.capped => {
                state.world = world_model::generate(task, vigilance, &mut state.experience)?;
                state.policy = Policy::new(task, state.world.states.len());
            }
            _ => self.finish(),
        }
        Ok(())
    }

    /// Merges the states of the best automaton.
    fn finish(&mut self) {
        let (task, state) = (&self.task, &mut self.state);
        state.finished = true;
        if let Some(best) = state.best.as_mut().filter(|_| task.settings.merge) {
            state.experience.samples += merge::merge(task, &mut best.draft);
        }
    }

    /// What was learned so far; before the first vigilance is done with, what its values say.
    pub fn learned(&self) -> Learned {
        let state = &self.state;
        let best = state.best.clone().unwrap_or_else(|| Best {
            draft: state.policy.draft(&state.world),
            world: state.world.clone(),
            converged: false,
        });
        Learned {
            automaton: best.draft.compile(&self.task),
            converged: best.converged,
            samples: state.experience.samples,
            learning: Learning {
                capped: best.world.capped,
                vigilance: best.world.vigilance,
                clusters: best.world.clusters(),
                states: best.world.states.len(),
                curve: state.curve.clone(),
            },
        }
    }
}
