//! Learning on evidence: the state of a run by the tested rules and what an epoch does to it.

use std::ops::ControlFlow;

use serde::{Deserialize, Serialize};

use super::draft::Draft;
use super::memory::{self, Kind, Memory};
use super::steady::Steady;
use super::task::Task;
use super::{Learned, Learning, Point, RegionValue, commit, edges, tidy};
use crate::progress::Progress;
use crate::solve::learn::{Experience, critical, undiscounted};

/// All that a run has to remember between two epochs.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct State {
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

impl State {
    pub(super) fn new(task: &Task<'_>) -> Self {
        Self {
            experience: Experience::default(),
            curve: Vec::new(),
            tried: 0,
            learning: Some(Steady::new(task, Memory::none())),
            best: None,
        }
    }

    /// Whether it is one that a task can have.
    pub(super) fn fits(&self, task: &Task<'_>) -> bool {
        let (axes, actions) = (task.lattice.whole().low.len(), task.actions());
        // With every action at most one memory is tried, and two besides.
        let most_tried = actions + 2;
        let point = |point: &Point| {
            point.memory <= self.tried && point.regions.iter().all(|r| r.fits(axes, actions))
        };
        self.experience.fits(task.body().state_dim())
            && self.tried <= most_tried
            && self.curve.iter().all(point)
            && self.learning.iter().all(|steady| steady.fits(task))
            && self.best.iter().all(|best| {
                best.memory <= self.tried
                    && best.steady.fits(task)
                    && best.draft.fits(task, &best.steady.memory)
            })
    }

    /// An epoch, and what follows from it where it was the last of a memory.
    pub(super) fn advance(&mut self, task: &Task<'_>, observer: &dyn Progress) -> ControlFlow<()> {
        if let Some(steady) = self.learning.take() {
            self.learning = self.learn(task, steady, observer);
            if self.learning.is_none() {
                self.commit(task, observer);
            }
        }
        match self.learning {
            None => ControlFlow::Break(()),
            Some(_) => ControlFlow::Continue(()),
        }
    }

    /// Goes on with what is being learned; returns what is to be learned after that.
    fn learn(
        &mut self,
        task: &Task<'_>,
        mut steady: Steady,
        observer: &dyn Progress,
    ) -> Option<Steady> {
        let limit = task.settings.epoch_limit as u64;
        observer.progress("epochs", steady.epochs() as u64, limit);
        let earned = steady.run_epoch(task, &mut self.experience);
        let reward = earned.reward / earned.steps as f64;
        self.curve.push(self.point(task, &steady, reward));
        observer.progress("epochs", steady.epochs() as u64, limit);
        let regions: usize = steady.regions.iter().map(Vec::len).sum();
        observer.status(&format!(
            "{} steps, {reward:.3} a step, {regions} nodes",
            self.experience.samples
        ));
        if !steady.finished(task) {
            return Some(steady);
        }
        self.conclude(task, steady, observer);
        self.next_memory(task)
    }

    /// Makes the automaton of a memory and keeps it if it earns surely more than the best so far.
    fn conclude(&mut self, task: &Task<'_>, steady: Steady, observer: &dyn Progress) {
        let (draft, trial, steps) = edges::compile(task, &steady);
        let (draft, trial, more_steps) = tidy::tidy(task, &steady, draft, trial);
        self.experience.samples += steps + more_steps;
        let adopted = match &self.best {
            None => true,
            Some(best) => {
                let other = task.trial(&best.draft.compile(task));
                self.experience.samples += other.steps();
                trial.excess(&other, undiscounted) > critical(task.settings.adopt_error)
            }
        };
        observer.note(&format!(
            "{}: {:.3} an episode with {} nodes, {}",
            draft.memory.describe(&action_names(task)),
            trial.mean(undiscounted),
            draft.nodes.len(),
            if adopted { "adopted" } else { "not adopted" }
        ));
        if adopted {
            let converged = steady.converged(task);
            self.best = Some(Best {
                memory: self.tried,
                draft,
                steady,
                converged,
            });
        }
        self.tried += 1;
    }

    /// The next memory worth trying. One needs events at two places; a count of an action is only tried for actions that the agent
    /// believes do not move it, for any other shows in its belief.
    fn next_memory(&self, task: &Task<'_>) -> Option<Steady> {
        let experience = &self.experience;
        // Edges are boxes of state variables, and lead between regions of one stratum.
        if task.coordinates.is_some() || task.space.as_mdp().is_none() {
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
        let model = task.body();
        let still =
            (0..task.actions()).filter(|&action| model.displacement(action, 0).amax() == 0.0);
        let mut kinds = std::iter::once(Kind::Place).chain(still.map(Kind::PlaceAndParity));
        let kind = kinds.nth(self.tried.checked_sub(1)?)?;
        Some(Steady::new(
            task,
            Memory::of_events(kind, places, threshold, unit),
        ))
    }

    /// Learns the less certain levels of the best automaton.
    fn commit(&mut self, task: &Task<'_>, observer: &dyn Progress) {
        let Some(best) = &mut self.best else {
            return;
        };
        let experience = &mut self.experience;
        let own =
            commit::segment_less_certain_levels(task, experience, &best.steady, &mut best.draft);
        if !own.is_empty() {
            observer.note(&format!("levels with regions of their own: {own:?}"));
        }
    }

    fn point(&self, task: &Task<'_>, steady: &Steady, reward: f64) -> Point {
        let by_sheet = steady.regions.iter().enumerate();
        let regions = by_sheet.flat_map(|(sheet, regions)| {
            regions.iter().map(move |region| {
                let (lower, upper) = task.lattice.corners(&region.cells);
                RegionValue {
                    memory: sheet / task.sheets,
                    stratum: task.chain[task.later() + sheet % task.sheets],
                    lower,
                    upper,
                    action: region.action,
                    value: steady.region_value(task, sheet, region),
                }
            })
        });
        Point {
            memory: self.tried,
            samples: self.experience.samples,
            reward,
            regions: regions.collect(),
        }
    }

    /// What was learned so far; before the first memory is learned, what its regions say.
    pub(super) fn learned(&self, task: &Task<'_>) -> Learned {
        let unfinished = || {
            let steady = self.learning.clone();
            let steady = steady.unwrap_or_else(|| Steady::new(task, Memory::none()));
            edges::compile(task, &steady).0
        };
        let best = self.best.as_ref();
        let draft = best.map_or_else(unfinished, |best| best.draft.clone());
        Learned {
            automaton: draft.compile(task),
            converged: best.is_some_and(|best| best.converged),
            samples: self.experience.samples,
            learning: Learning {
                memory: draft.memory.describe(&action_names(task)),
                adopted: best.map_or(self.tried, |best| best.memory),
                curve: self.curve.clone(),
            },
        }
    }
}

fn action_names(task: &Task<'_>) -> Vec<String> {
    let actions = task.body().actions.iter();
    actions.map(|action| action.name.clone()).collect()
}
