//! PolicyGenerator (Figure 3.2): Q-learning on the states of the world model.

use serde::{Deserialize, Serialize};

use super::draft::{Draft, DraftNode};
use super::task::Task;
use super::world_model::WorldModel;
use crate::belief::Updater;
use crate::model::{ActionId, Then};
use crate::solve::learn::{Actor, Experience, Table, Transition, boltzmann};

/// Values of the states, as far as they are learned.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Policy {
    table: Table,
    /// By state: the best action at the end of the last epoch.
    best: Vec<ActionId>,
    /// By state: visits in the last epoch.
    visits: Vec<f64>,
    epoch: usize,
    calm: usize,
    temperature: f64,
}

impl Policy {
    /// Nothing learned yet.
    pub(super) fn new(task: &Task<'_>, states: usize) -> Self {
        Self {
            table: Table::new(states, task.actions()),
            best: vec![0; states],
            visits: vec![0.0; states],
            epoch: 0,
            calm: 0,
            temperature: task.settings.hot,
        }
    }

    /// Whether it is one that a task can have, of so many states.
    pub(super) fn fits(&self, task: &Task<'_>, states: usize) -> bool {
        let (settings, actions) = (&task.settings, task.actions());
        self.table.fits(states, actions)
            && self.best.len() == states
            && self.best.iter().all(|action| *action < actions)
            && self.visits.len() == states
            && self.epoch <= settings.epoch_limit
            && self.calm <= settings.calm
            && (settings.cold..=settings.hot).contains(&self.temperature)
    }

    /// Whether the best actions no longer change.
    pub(super) fn converged(&self, task: &Task<'_>) -> bool {
        self.calm >= task.settings.calm
    }

    /// Whether learning is over.
    pub(super) fn finished(&self, task: &Task<'_>) -> bool {
        self.converged(task) || self.epoch >= task.settings.epoch_limit
    }

    /// Epochs so far.
    pub(super) fn epochs(&self) -> usize {
        self.epoch
    }

    /// Acts for an epoch of whole episodes; `updater` recalls the states. Returns the reward of a step.
    pub(super) fn run_epoch(
        &mut self,
        task: &Task<'_>,
        updater: &Updater,
        experience: &mut Experience,
    ) -> f64 {
        let settings = &task.settings;
        let entries = self.best.len() * task.actions();
        let least = settings.epoch.max(settings.epoch_per_entry * entries) as u64;
        let first = experience.samples;
        let mut actor = Actor::new(task.worlds, updater, updater.readings());
        let mut reward = 0.0;
        self.visits.fill(0.0);
        while experience.samples - first < least {
            reward += self.run_episode(task, &mut actor, experience);
        }
        self.epoch += 1;
        self.settle(task);
        reward / (experience.samples - first) as f64
    }

    fn run_episode(
        &mut self,
        task: &Task<'_>,
        actor: &mut Actor<'_>,
        experience: &mut Experience,
    ) -> f64 {
        let settings = &task.settings;
        let (mut draws, mut exploration) = experience.next_episode(settings.seed);
        actor.reset(&mut draws);
        self.table.forget_traces();
        let mut reward = 0.0;
        for _ in 0..task.body().episode.length {
            let row = actor.belief().mode;
            let temperature = self.temperature * experience.reward_range();
            let values = self.table.row(row);
            let action = boltzmann(values, temperature, settings.explore, &mut exploration);
            let step = actor.step(action, &mut draws);
            experience.collect(step.reward);
            reward += step.reward;
            let transition = Transition {
                row,
                action,
                reward: step.reward,
                next: (step.then != Then::End).then_some(actor.belief().mode),
            };
            self.table
                .td_update(settings.rates(), task.discount(), transition);
            self.visits[row] += 1.0;
            if step.then == Then::End {
                break;
            }
        }
        reward
    }

    /// Notes the best actions, counts calm epochs and cools down.
    fn settle(&mut self, task: &Task<'_>) {
        let settings = &task.settings;
        let mut changed = 0.0;
        for (row, best) in self.best.iter_mut().enumerate() {
            let now = self.table.best_action(row);
            if now != *best {
                changed += self.visits[row];
            }
            *best = now;
        }
        if self.temperature <= settings.cold {
            let still = changed <= settings.still * self.visits.iter().sum::<f64>();
            self.calm = if still { self.calm + 1 } else { 0 };
        }
        self.temperature = (self.temperature * settings.cooling).max(settings.cold);
    }

    /// By state: the best action and its value.
    pub(super) fn choices(&self) -> Vec<(ActionId, f64)> {
        let best = self.best.iter().enumerate();
        best.map(|(row, &action)| (action, self.table.best(row)))
            .collect()
    }

    /// The states with their best actions and values.
    pub(super) fn draft(&self, world: &WorldModel) -> Draft {
        let states = world.states.iter().enumerate();
        let nodes = states.map(|(row, history)| DraftNode {
            history: history.clone(),
            action: self.best[row],
            value: self.table.best(row),
        });
        Draft {
            recall: world.recall.clone(),
            nodes: nodes.collect(),
        }
    }
}
