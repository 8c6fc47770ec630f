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
mod checkpoint;
mod commit;
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
mod tidy;

use std::path::Path;

use serde::{Deserialize, Serialize};

pub use crate::solve::learn::Worlds;
pub use settings::{Rules, Settings};

use crate::error::Result;
use crate::model::{ActionId, Model};
use crate::observe::Observer;
use crate::policy::Automaton;
use crate::scenario::Scenario;
use crate::solve::learn::{Experience, Trial, critical, undiscounted};
use crate::world::{ProblemWorld, World};
use draft::Draft;
use memory::{Kind, Memory};
use steady::Steady;
use task::Task;

/// What a learning run found.
#[derive(Debug, Clone, PartialEq)]
pub struct Learned {
    /// The automaton. It runs without seeing rewards.
    pub automaton: Automaton,
    /// Whether its regions had stopped changing.
    pub converged: bool,
    /// Steps of experience, trials included.
    pub samples: u64,
    /// How it came about.
    pub learning: Learning,
}

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
    /// Lower corner, in the coordinates of the automaton.
    pub lower: Vec<f64>,
    /// Upper corner.
    pub upper: Vec<f64>,
    /// Its action.
    pub action: ActionId,
    /// `Q` of that action, averaged over the region's visits.
    pub value: f64,
}

/// Whether a model can be learned with these settings.
///
/// # Errors
/// [`crate::Error::Setting`] and [`crate::Error::Unsupported`], as [`learn`].
pub fn accepts(model: &Model, settings: &Settings) -> Result<()> {
    let worlds = || -> Box<dyn World> { Box::new(ProblemWorld::new(&Scenario::assumed(model))) };
    Task::new(model, settings.clone(), &worlds).map(drop)
}

/// Learns an automaton in the worlds that `worlds` makes, of which `model` tells no more than the agent knows of itself.
///
/// With a checkpoint file the run writes its state there after every epoch, and goes on from there if the file exists: stopped and
/// resumed, it ends with the same result as if never stopped. The printed rules take seconds and write none.
///
/// # Errors
/// [`crate::Error::Setting`] for settings out of range, [`crate::Error::Unsupported`] for a model without bounds, noise or one chain of levels,
/// [`crate::Error::Checkpoint`] for a checkpoint of another run or a damaged one, [`crate::Error::Io`] where it cannot be read or written.
pub fn learn(
    model: &Model,
    worlds: &Worlds<'_>,
    settings: &Settings,
    checkpoint: Option<&Path>,
    observer: &dyn Observer,
) -> Result<Learned> {
    if settings.rules == Rules::Printed {
        return Ok(printed::learn(
            &Task::new(model, settings.clone(), worlds)?,
            observer,
        ));
    }
    let mut run = match checkpoint.filter(|path| path.exists()) {
        Some(path) => Run::resume(model, worlds, settings, path)?,
        None => {
            let run = Run::new(model, worlds, settings)?;
            // A file that cannot be written is known before work is done that it should keep.
            checkpoint.map_or(Ok(()), |path| run.save(path))?;
            run
        }
    };
    while !run.finished() {
        run.advance(observer);
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
    /// Memories tried so far.
    tried: usize,
    /// What is being learned; nothing once the run is over.
    learning: Option<Steady>,
    best: Option<Best>,
}

/// The best automaton so far and what it was made of.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Best {
    /// Number of its memory.
    memory: usize,
    draft: Draft,
    steady: Steady,
    converged: bool,
}

impl<'a> Run<'a> {
    /// A run that has not begun.
    ///
    /// # Errors
    /// As [`learn`].
    pub fn new(model: &Model, worlds: &'a Worlds<'a>, settings: &Settings) -> Result<Self> {
        let task = Task::new(model, settings.clone(), worlds)?;
        let state = State {
            experience: Experience::default(),
            curve: Vec::new(),
            tried: 0,
            learning: Some(Steady::new(&task, Memory::none())),
            best: None,
        };
        Ok(Self { task, state })
    }

    /// Whether there is nothing more to learn.
    pub fn finished(&self) -> bool {
        self.state.learning.is_none()
    }

    /// Does one piece of work: an epoch, and what follows from it where it was the last of a memory.
    pub fn advance(&mut self, observer: &dyn Observer) {
        let Some(mut steady) = self.state.learning.take() else {
            return;
        };
        let earned = steady.run_epoch(&self.task, &mut self.state.experience);
        self.state
            .curve
            .push(self.point(&steady, earned.reward / earned.steps as f64));
        observer.progress(
            "epochs",
            steady.epochs() as u64,
            self.task.settings.epoch_limit as u64,
        );
        let regions: usize = steady.regions.iter().map(Vec::len).sum();
        observer.status(&format!(
            "{} steps, {:.3} a step, {regions} nodes",
            self.state.experience.samples,
            earned.reward / earned.steps as f64
        ));
        self.state.learning = if steady.finished(&self.task) {
            self.conclude(steady, observer);
            self.next_memory()
        } else {
            Some(steady)
        };
        if self.state.learning.is_none() {
            self.commit(observer);
        }
    }

    /// Makes the automaton of a memory and keeps it if it earns surely more than the best so far.
    fn conclude(&mut self, steady: Steady, observer: &dyn Observer) {
        let (draft, trial, steps) = edges::compile(&self.task, &steady);
        let (draft, trial, more_steps) = tidy::tidy(&self.task, &steady, draft, trial);
        self.state.experience.samples += steps + more_steps;
        let adopted = match &self.state.best {
            None => true,
            Some(best) => {
                let other = self.trial(&best.draft);
                self.state.experience.samples += other.steps();
                trial.excess(&other, undiscounted) > critical(self.task.settings.adopt_error)
            }
        };
        observer.note(&format!(
            "{}: {:.3} an episode with {} nodes, {}",
            draft.memory.describe(&self.action_names()),
            trial.mean(undiscounted),
            draft.nodes.len(),
            if adopted { "adopted" } else { "not adopted" }
        ));
        if adopted {
            let converged = steady.converged(&self.task);
            self.state.best = Some(Best {
                memory: self.state.tried,
                draft,
                steady,
                converged,
            });
        }
        self.state.tried += 1;
    }

    /// The next memory worth trying. One needs events at two places; a count of an action is only tried for actions that the agent
    /// believes do not move it, for any other shows in its belief.
    fn next_memory(&self) -> Option<Steady> {
        let (task, experience) = (&self.task, &self.state.experience);
        // Edges are boxes of state variables.
        if task.coordinates.is_some() {
            return None;
        }
        let threshold = task.settings.notable * experience.rewards.1;
        let notable = experience
            .events
            .iter()
            .filter(|event| event.0 >= threshold);
        let means: Vec<&[f64]> = notable.map(|event| event.1.as_slice()).collect();
        let unit = task.deviations();
        let places = memory::places(&means, task.settings.place, &unit);
        if places.len() < 2 {
            return None;
        }
        let model = task.mdp.model();
        let still = (0..task.actions()).filter(|&action| model.displacement(action).amax() == 0.0);
        let mut kinds = std::iter::once(Kind::Place).chain(still.map(Kind::PlaceAndParity));
        let kind = kinds.nth(self.state.tried.checked_sub(1)?)?;
        Some(Steady::new(
            task,
            Memory::of_events(kind, places, threshold, unit),
        ))
    }

    /// Learns the less certain levels of the best automaton.
    fn commit(&mut self, observer: &dyn Observer) {
        let Some(best) = &mut self.state.best else {
            return;
        };
        let experience = &mut self.state.experience;
        let own = commit::segment_less_certain_levels(
            &self.task,
            experience,
            &best.steady,
            &mut best.draft,
        );
        if !own.is_empty() {
            observer.note(&format!("levels with regions of their own: {own:?}"));
        }
    }

    fn trial(&self, draft: &Draft) -> Trial {
        self.task.trial(&draft.compile(&self.task))
    }

    fn action_names(&self) -> Vec<String> {
        let actions = self.task.mdp.model().actions.iter();
        actions.map(|action| action.name.clone()).collect()
    }

    fn point(&self, steady: &Steady, reward: f64) -> Point {
        let by_memory = steady.regions.iter().enumerate();
        let regions = by_memory.flat_map(|(memory, regions)| {
            regions.iter().map(move |region| {
                let (lower, upper) = self.task.lattice.corners(&region.cells);
                RegionValue {
                    memory,
                    lower,
                    upper,
                    action: region.action,
                    value: steady.region_value(&self.task, memory, region),
                }
            })
        });
        Point {
            memory: self.state.tried,
            samples: self.state.experience.samples,
            reward,
            regions: regions.collect(),
        }
    }

    /// What was learned so far; before the first memory is learned, what its regions say.
    pub fn learned(&self) -> Learned {
        let State {
            best,
            learning,
            experience,
            curve,
            tried,
        } = &self.state;
        let unfinished = || {
            let steady = learning
                .clone()
                .unwrap_or_else(|| Steady::new(&self.task, Memory::none()));
            edges::compile(&self.task, &steady).0
        };
        let draft = best
            .as_ref()
            .map_or_else(unfinished, |best| best.draft.clone());
        Learned {
            automaton: draft.compile(&self.task),
            converged: best.as_ref().is_some_and(|best| best.converged),
            samples: experience.samples,
            learning: Learning {
                memory: draft.memory.describe(&self.action_names()),
                adopted: best.as_ref().map_or(*tried, |best| best.memory),
                curve: curve.clone(),
            },
        }
    }
}
