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
//! Where no uncertainty levels follow motion and sensor, beliefs are kept in full, and clustered by how uncertain they are as well.
//!
//! Beyond the thesis, and what its chapter 7 asks for: vigilance that tunes itself ([`Settings::vigilances`]), merging of states
//! that agree (`merge`), Watkins' Q(lambda), and a memory of more than one step ([`Settings::depth`]). [`Settings::extended`] has all
//! four.

pub mod art;
mod coding;
mod course;
mod curves;
mod draft;
mod history;
mod merge;
mod policy;
mod settings;
mod task;
mod world_model;

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::solve::Worlds;
pub use curves::drawn;
pub use settings::Settings;

use crate::error::Result;
use crate::model::{ActionId, Model};
use crate::progress::Progress;
use crate::solve::learn::{self, Course};
use crate::solve::solver::refuse_if;
use crate::solve::{Learner, Lesson, Problem, refusals};
use task::{SOLVER, Task};

/// What a learning run found: the automaton has a node for each state.
pub type Learned = learn::Learned<Learning>;

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

/// A cluster of the world model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ClusterFound {
    /// Its centre, length `n`, in units of the state; where beliefs are kept in full, then the traits of strata.
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

/// The learner with its task: `model` tells it no more than the agent knows of itself, and it acts in the worlds that `worlds` makes.
///
/// # Errors
/// [`crate::Error::Setting`] for settings out of range, [`crate::Error::Unsupported`] for a model without bounds,
/// [`crate::Error::NoSteadyState`] for one whose uncertainty grows without end.
pub fn course<'a>(
    model: &Model,
    worlds: &'a Worlds<'a>,
    settings: &Settings,
) -> Result<impl Course<Learning = Learning> + use<'a>> {
    Task::new(model, settings.clone(), worlds)
}

/// Learns an automaton, see [`course`] and [`crate::solve::run_course`].
///
/// # Errors
/// As [`course`] and [`crate::solve::run_course`].
pub fn learn(
    model: &Model,
    worlds: &Worlds<'_>,
    settings: &Settings,
    checkpoint: Option<&Path>,
    observer: &dyn Progress,
) -> Result<Learned> {
    learn::learn(course(model, worlds, settings)?, checkpoint, observer)
}

impl Learner for Settings {
    fn name(&self) -> &'static str {
        SOLVER
    }

    fn accepts(&self, model: &Model) -> Result<()> {
        refuse_if(SOLVER, model, refusals::reward_missing(model))?;
        task::check(model, self)
    }

    fn learn(
        &self,
        problem: &Problem,
        worlds: &Worlds<'_>,
        checkpoint: Option<&Path>,
        observer: &dyn Progress,
    ) -> Result<Lesson> {
        let settings = Self {
            seed: problem.seed(),
            ..self.clone()
        };
        let learned = learn(problem.model(), worlds, &settings, checkpoint, observer)?;
        Ok(Lesson {
            learning: curves::drawn(&learned.automaton, &learned.learning),
            automaton: learned.automaton,
            converged: learned.converged,
            samples: learned.samples,
            remarks: Vec::new(),
        })
    }
}
