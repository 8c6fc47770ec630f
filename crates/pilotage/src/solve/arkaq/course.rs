//! ARKAQ as a course: the state of a run and what a piece of work does to it.

use std::ops::ControlFlow;

use serde::{Deserialize, Serialize};

use super::draft::Draft;
use super::policy::Policy;
use super::settings::Settings;
use super::task::{SOLVER, Task};
use super::world_model::WorldModel;
use super::{Learned, Learning, Point, merge, world_model};
use crate::belief::Memory;
use crate::error::Result;
use crate::progress::Progress;
use crate::solve::learn::{Course, Experience, Owner, critical, fitting, undiscounted};

/// All that a run has to remember between two pieces of work.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct State {
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

impl Course for Task<'_> {
    type Settings = Settings;
    type State = State;
    type Learning = Learning;

    fn owner(&self) -> Owner<'_, Settings> {
        Owner {
            solver: SOLVER,
            problem: &self.body().name,
            fingerprint: self.fingerprint,
            settings: &self.settings,
        }
    }

    /// Explores at the first vigilance.
    fn start(&self) -> Result<State> {
        let mut experience = Experience::default();
        let world = world_model::generate(self, self.settings.vigilances[0], &mut experience)?;
        Ok(State {
            experience,
            curve: Vec::new(),
            tried: 0,
            policy: Policy::new(self, world.states.len()),
            world,
            best: None,
            finished: false,
        })
    }

    fn check(&self, state: &State) -> std::result::Result<(), String> {
        fitting(state.fits(self))
    }

    /// An epoch of a policy, and what follows from it where it was the last at a vigilance.
    fn step(&self, state: &mut State, observer: &dyn Progress) -> Result<ControlFlow<()>> {
        if !state.finished {
            state.run_epoch(self, observer);
            if state.policy.finished(self) {
                state.conclude(self, observer);
                state.next_vigilance(self)?;
            }
        }
        Ok(match state.finished {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        })
    }

    /// Before the first vigilance is done with, what its values say.
    fn learned(&self, state: &State) -> Learned {
        let best = state.best.clone().unwrap_or_else(|| Best {
            draft: state.policy.draft(&state.world),
            world: state.world.clone(),
            converged: false,
        });
        Learned {
            automaton: best.draft.compile(self),
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

impl State {
    /// Whether all its numbers are of a task: a checksum only tells what has been changed by chance.
    fn fits(&self, task: &Task<'_>) -> bool {
        let actions = task.actions();
        let point = |point: &Point| point.states.iter().all(|state| state.0 < actions);
        self.experience.fits(task.body().state_dim())
            && self.curve.iter().all(point)
            && self.tried <= task.settings.vigilances.len()
            && self.world.fits(task)
            && self.policy.fits(task, self.world.states.len())
            && self
                .best
                .iter()
                .all(|best| best.draft.fits(task) && best.world.fits(task))
    }

    fn run_epoch(&mut self, task: &Task<'_>, observer: &dyn Progress) {
        let states = self.world.states.len();
        if self.policy.epochs() == 0 {
            observer.note(&self.world.describe());
        }
        let limit = task.settings.epoch_limit as u64;
        observer.progress("epochs", self.policy.epochs() as u64, limit);
        let recalling = Memory::Recall(self.world.recall.clone());
        let updater = task.updater.clone().remembering(recalling);
        let reward = (self.policy).run_epoch(task, &updater, &mut self.experience);
        let (samples, epochs) = (self.experience.samples, self.policy.epochs() as u64);
        self.curve.push(Point {
            vigilance: self.world.vigilance,
            samples,
            reward,
            states: self.policy.choices(),
        });
        observer.progress("epochs", epochs, limit);
        observer.note(&format!(
            "{samples} steps: {reward:.3} a step, {states} states"
        ));
    }

    /// Makes the automaton of a vigilance and keeps it if it earns surely more than the best so far.
    fn conclude(&mut self, task: &Task<'_>, observer: &dyn Progress) {
        let draft = self.policy.draft(&self.world);
        let mut adopted = true;
        if task.settings.vigilances.len() > 1 {
            let trial = task.trial(&draft.compile(task));
            self.experience.samples += trial.steps();
            adopted = self.best.as_ref().is_none_or(|best| {
                let other = task.trial(&best.draft.compile(task));
                trial.excess(&other, undiscounted) > critical(task.settings.adopt_error)
            });
            observer.note(&format!(
                "vigilance {}: {:.3} an episode with {} nodes, {}",
                self.world.vigilance,
                trial.mean(undiscounted),
                draft.nodes.len(),
                if adopted { "adopted" } else { "not adopted" }
            ));
        }
        if adopted {
            self.best = Some(Best {
                draft,
                world: self.world.clone(),
                converged: self.world.settled && self.policy.converged(task),
            });
        }
    }

    /// Explores at the next vigilance. One that reached the limit of states is the last, as a higher one would reach it too.
    fn next_vigilance(&mut self, task: &Task<'_>) -> Result<()> {
        self.tried += 1;
        match task.settings.vigilances.get(self.tried) {
            Some(&vigilance) if !self.world.capped => {
                self.world = world_model::generate(task, vigilance, &mut self.experience)?;
                self.policy = Policy::new(task, self.world.states.len());
            }
            _ => self.finish(task),
        }
        Ok(())
    }

    /// Merges the states of the best automaton.
    fn finish(&mut self, task: &Task<'_>) {
        self.finished = true;
        if let Some(best) = self.best.as_mut().filter(|_| task.settings.merge) {
            self.experience.samples += merge::merge(task, &mut best.draft);
        }
    }
}
