//! KAFAQ-learning: an automaton learned by trial (thesis chapter 4).
//!
//! The agent knows its own motion and sensor noise (`A`, `B`, `H`, `Q`, `R`), the world's outer bounds and its start belief. It sees
//! actions, observations and rewards, and knows neither map nor rewards in advance. What it learns, level by level from the most
//! certain one upwards, are regions of belief means that share a best action.
//!
//! The printed pseudo-code (Figure 4.5) compares an exploring action with the best one and splits a region at every difference, so
//! that noise alone makes regions without end. Here every change of a region rests on evidence: temporal-difference targets are
//! collected by neighbourhood and action, and a test with a stated error rate says whether another action is better there
//! ([`Settings::split_error`]). The printed rules are kept as [`Rules::Printed`].
//!
//! Where no uncertainty levels follow motion and sensor, beliefs are kept in full and read as strata, in no order that all of them follow: then
//! all strata are learned at once, without memory, and the automaton carries the strata.
//!
//! Neighbourhoods are the cells of a lattice along the state variables, or along the modes of a motion that mixes them (`axes`).
//!
//! 1. *The steady level* (`steady`): Q-learning with Boltzmann exploration; every epoch, best actions, splits, extensions and
//!    merges (`regions`), until they no longer change.
//! 2. *Memory* (`memory`, `edges`): where events far apart are notably rewarded, the place of the last one may matter. A memory is
//!    learned with the rewards seen, but adopted only if its automaton, which sees none, earns surely more.
//! 3. *Tidying* (`tidy`): what trials show no loss without is dropped.
//! 4. *Less certain levels* (`commit`), each upon the committed ones.
//!
//! # References
//! C. J. C. H. Watkins, *Learning from Delayed Rewards*, 1989 (Q-learning and Q(lambda)).

mod axes;
mod commit;
mod course;
mod curves;
mod draft;
mod edges;
mod evidence;
mod lattice;
mod memory;
mod printed;
mod regions;
mod settings;
mod steady;
mod task;
mod tested;
mod tidy;

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::solve::Worlds;
pub use curves::drawn;
pub use settings::{Rules, Settings};

use crate::belief::StratumId;
use crate::error::Result;
use crate::model::{ActionId, Model};
use crate::progress::Progress;
use crate::solve::learn::{self, Course};
use crate::solve::solver::refuse_if;
use crate::solve::{Learner, Lesson, Problem, refusals};
use task::{SOLVER, Task};

/// What a learning run found.
pub type Learned = learn::Learned<Learning>;

/// How learning went.
#[derive(Debug, Clone, PartialEq)]
pub struct Learning {
    /// What the automaton remembers, in words.
    pub memory: String,
    /// Number of that memory among those tried, see [`Point::memory`].
    pub adopted: usize,
    /// Epoch by epoch.
    pub curve: Vec<Point>,
}

/// An epoch of a learning run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Number of the memory that was being learned, from 0.
    pub memory: usize,
    /// Steps of experience by its end.
    pub samples: u64,
    /// Reward a step, exploration included.
    pub reward: f64,
    /// The regions and their values.
    pub regions: Vec<RegionValue>,
}

/// A region as it was at some time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RegionValue {
    /// Memory it belongs to.
    pub memory: usize,
    /// Stratum of the beliefs it is for: the steady level, or any where beliefs are kept in full.
    pub stratum: StratumId,
    /// Lower corner, in the coordinates of the automaton.
    pub lower: Vec<f64>,
    /// Upper corner.
    pub upper: Vec<f64>,
    /// Its action.
    pub action: ActionId,
    /// `Q` of that action, averaged over the region's visits.
    pub value: f64,
}

impl RegionValue {
    /// Whether it is one of so many coordinates and actions.
    fn fits(&self, axes: usize, actions: usize) -> bool {
        let sides = [&self.lower, &self.upper];
        sides.iter().all(|side| side.len() == axes) && self.action < actions
    }
}

/// The learner with its task: `model` tells it no more than the agent knows of itself, and it acts in the worlds that `worlds` makes.
///
/// # Errors
/// [`crate::Error::Setting`] for settings out of range, [`crate::Error::Unsupported`] for a model without bounds, noise or
/// one chain of levels.
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
        let reason = refusals::reward_missing(model).or_else(|| match model.body().is_linear() {
            true => refusals::steps_differ(model),
            false => refusals::phases(model),
        });
        refuse_if(SOLVER, model, reason)?;
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
