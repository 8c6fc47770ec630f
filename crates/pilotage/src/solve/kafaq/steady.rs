//! SegmentSteadyLevel (Figure 4.5): regions of the most certain level, for one memory, learned by acting.
//!
//! Where beliefs are kept in full there is no level that the others lead to. Then all strata are learned at once, each with regions of its
//! own. What is kept of a stratum and a memory is a *sheet*. As beliefs in full go wherever actions lead them, every other episode follows the
//! regions themselves, so that there is evidence where the automaton would come to.

use serde::{Deserialize, Serialize};

use super::evidence::Halves;
use super::memory::{Kind, Memory};
use super::regions::{Region, Reviser, actions_by_cell};
use super::task::Task;
use crate::belief::Belief;
use crate::model::{ActionId, Then};
use crate::random::uniform;
use crate::solve::learn::{Actor, Experience, Table, Transition, boltzmann};

/// Events that are written down to find their places.
const EVENTS: usize = 20_000;

/// Everything learned so far with one memory.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Steady {
    pub memory: Memory,
    pub table: Table,
    /// By memory and stratum.
    pub evidence: Vec<Halves>,
    /// By memory and stratum.
    pub regions: Vec<Vec<Region>>,
    pub crossings: Crossings,
    epoch: usize,
    calm: usize,
    temperature: f64,
}

/// How often each memory was left by each action for each cell, and how often an event had then happened.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Crossings {
    actions: usize,
    cells: usize,
    /// By memory, action, cell.
    arrivals: Vec<f64>,
    pub events: Vec<Crossing>,
}

/// Events that led from a memory to another by an action, by the cell they were seen in.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Crossing {
    pub memory: usize,
    pub action: usize,
    pub to: usize,
    pub counts: Vec<f64>,
}

impl Crossings {
    fn new(memories: usize, actions: usize, cells: usize) -> Self {
        Self {
            actions,
            cells,
            arrivals: vec![0.0; memories * actions * cells],
            events: Vec::new(),
        }
    }

    fn fits(&self, memories: usize, actions: usize, cells: usize) -> bool {
        let key = |event: &Crossing| (event.memory, event.action, event.to);
        let event = |event: &Crossing| {
            let (memory, action, to) = key(event);
            memory < memories && to < memories && action < actions && event.counts.len() == cells
        };
        (self.actions, self.cells) == (actions, cells)
            && self.arrivals.len() == memories * actions * cells
            && self.events.iter().all(event)
            && self.events.is_sorted_by(|a, b| key(a) < key(b))
    }

    fn place(&self, memory: usize, action: usize, cell: usize) -> usize {
        (memory * self.actions + action) * self.cells + cell
    }

    /// Arrivals in a cell from a memory by an action.
    pub(super) fn arrivals(&self, memory: usize, action: usize, cell: usize) -> f64 {
        self.arrivals[self.place(memory, action, cell)]
    }

    fn arrive(&mut self, memory: usize, action: usize, cell: usize) {
        let place = self.place(memory, action, cell);
        self.arrivals[place] += 1.0;
    }

    fn event(&mut self, memory: usize, action: usize, to: usize, cell: usize) {
        let key = (memory, action, to);
        let of = |crossing: &Crossing| (crossing.memory, crossing.action, crossing.to);
        let at = match self.events.binary_search_by_key(&key, of) {
            Ok(at) => at,
            Err(at) => {
                let counts = vec![0.0; self.cells];
                self.events.insert(
                    at,
                    Crossing {
                        memory,
                        action,
                        to,
                        counts,
                    },
                );
                at
            }
        };
        self.events[at].counts[cell] += 1.0;
    }
}

/// What an epoch of learning earned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Earned {
    pub steps: u64,
    pub reward: f64,
}

impl Steady {
    /// Nothing learned yet: one region for every sheet, the whole world.
    pub(super) fn new(task: &Task<'_>, memory: Memory) -> Self {
        let (memories, cells, actions) = (memory.len(), task.lattice.len(), task.actions());
        let sheets = memories * task.sheets;
        let whole = Region {
            cells: task.lattice.whole(),
            action: 0,
        };
        Self {
            table: Table::new(sheets * cells, actions),
            evidence: vec![Halves::new(cells, actions); sheets],
            regions: vec![vec![whole]; sheets],
            crossings: Crossings::new(memories, actions, cells),
            epoch: 0,
            calm: 0,
            temperature: task.settings.hot,
            memory,
        }
    }

    /// Whether it is what can have been learned of a task.
    pub(super) fn fits(&self, task: &Task<'_>) -> bool {
        let (settings, cells, actions) = (&task.settings, task.lattice.len(), task.actions());
        if !self.memory.fits(task.body().state_dim(), actions) {
            return false;
        }
        let memories = self.memory.len();
        let sheets = memories * task.sheets;
        let regions = |regions: &Vec<Region>| {
            let fits = |region: &Region| region.fits(&task.lattice, actions);
            !regions.is_empty() && regions.iter().all(fits)
        };
        self.table.fits(sheets * cells, actions)
            && self.evidence.len() == sheets
            && self
                .evidence
                .iter()
                .all(|evidence| evidence.fits(cells, actions))
            && self.regions.len() == sheets
            && self.regions.iter().all(regions)
            && self.crossings.fits(memories, actions, cells)
            && self.epoch <= settings.epoch_limit
            && self.calm <= settings.calm
            && (settings.cold..=settings.hot).contains(&self.temperature)
    }

    /// Whether the regions no longer change.
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

    /// The row of the table that a sheet and cell have.
    pub(super) fn row(&self, task: &Task<'_>, sheet: usize, cell: usize) -> usize {
        sheet * task.lattice.len() + cell
    }

    /// The sheet of a memory and a belief, and whether it is learned there: less certain levels act as the first one.
    fn sheet(&self, task: &Task<'_>, memory: usize, belief: &Belief) -> (usize, bool) {
        let learned = task.sheet(belief.stratum);
        let sheet = memory * task.sheets + learned.unwrap_or(0);
        (sheet, learned.is_some())
    }

    /// Acts for an epoch of whole episodes, then revises the regions.
    pub(super) fn run_epoch(&mut self, task: &Task<'_>, experience: &mut Experience) -> Earned {
        let settings = &task.settings;
        let entries = self.regions.len() * task.lattice.len() * task.actions();
        let least = settings.epoch.max(settings.epoch_per_cell * entries) as u64;
        let mut earned = Earned {
            steps: 0,
            reward: 0.0,
        };
        let mut actor = task.actor();
        let ruling = self.ruling(task);
        while earned.steps < least {
            let followed = ruling.as_deref();
            let followed = followed.filter(|_| experience.episodes.is_multiple_of(2));
            self.run_episode(task, &mut actor, followed, experience, &mut earned);
        }
        self.epoch += 1;
        let worth = settings.worth * (1.0 - task.discount()) * self.mean_value(task);
        let reviser = Reviser::new(&task.lattice, settings, worth);
        let pairs = self.evidence.iter().zip(&mut self.regions);
        let changed: f64 = pairs
            .map(|(evidence, regions)| reviser.revise(evidence, regions))
            .sum();
        self.settle(task, changed);
        earned
    }

    /// By sheet and cell: the action of its region, where regions are followed.
    fn ruling(&self, task: &Task<'_>) -> Option<Vec<Vec<ActionId>>> {
        let of = |regions: &Vec<Region>| actions_by_cell(&task.lattice, regions);
        let followed = task.space.as_mdp().is_none();
        followed.then(|| self.regions.iter().map(of).collect())
    }

    fn run_episode(
        &mut self,
        task: &Task<'_>,
        actor: &mut Actor<'_>,
        followed: Option<&[Vec<ActionId>]>,
        experience: &mut Experience,
        earned: &mut Earned,
    ) {
        let (mut draws, mut exploration) = experience.next_episode(task.settings.seed);
        actor.reset(&mut draws);
        self.table.forget_traces();
        let mut memory = 0;
        for _ in 0..task.body().episode.length {
            let cell = task.cell(&actor.belief().mean);
            let (sheet, learned) = self.sheet(task, memory, actor.belief());
            let row = self.row(task, sheet, cell);
            let temperature = self.temperature * experience.reward_range();
            let explore = task.settings.explore;
            let action = match followed {
                Some(ruling) if uniform(&mut exploration) >= explore => ruling[sheet][cell],
                _ => boltzmann(self.table.row(row), temperature, explore, &mut exploration),
            };
            let step = actor.step(action, &mut draws);
            experience.collect(step.reward);
            earned.steps += 1;
            earned.reward += step.reward;
            self.note_event(task, experience, step.reward, &actor.belief().mean);
            let next_memory = match step.then {
                Then::Restart => 0,
                _ => self
                    .memory
                    .next(memory, action, step.reward, &actor.belief().mean),
            };
            let next_cell = task.cell(&actor.belief().mean);
            if learned {
                let (next_sheet, _) = self.sheet(task, next_memory, actor.belief());
                let next = self.row(task, next_sheet, next_cell);
                let transition = Transition {
                    row,
                    action,
                    reward: step.reward,
                    next: (step.then != Then::End).then_some(next),
                };
                let target =
                    self.table
                        .td_update(task.settings.rates(), task.discount(), transition);
                let coin = uniform(&mut exploration) < 0.5;
                self.evidence[sheet].add(coin, cell, action, target);
                self.crossings.arrive(memory, action, next_cell);
                if self.memory.is_event(step.reward) {
                    self.crossings.event(memory, action, next_memory, next_cell);
                }
            }
            memory = next_memory;
            if step.then == Then::End {
                break;
            }
        }
    }

    /// Without memory, notable rewards are written down, so that the next memory knows their places.
    fn note_event(&self, task: &Task<'_>, experience: &mut Experience, reward: f64, mean: &[f64]) {
        let notable = experience.is_notable(reward, task.settings.notable);
        if self.memory.kind == Kind::None && notable && experience.events.len() < EVENTS {
            experience.events.push((reward, mean.to_vec()));
        }
    }

    /// Lets old evidence fade, counts calm epochs and cools down. Evidence is enough once it has filled a window in every sheet that
    /// is in use.
    fn settle(&mut self, task: &Task<'_>, changed: f64) {
        let settings = &task.settings;
        let window = (settings.window * task.lattice.len() * task.actions()) as f64;
        let totals: Vec<f64> = self
            .evidence
            .iter()
            .map(|evidence| evidence.all.total())
            .collect();
        let all: f64 = totals.iter().sum();
        let enough = totals
            .iter()
            .all(|&total| total >= settings.fade * window || total < settings.rare * all);
        for (evidence, _) in self
            .evidence
            .iter_mut()
            .zip(&totals)
            .filter(|(_, total)| **total > window)
        {
            evidence.fade(settings.fade);
        }
        if self.temperature <= settings.cold {
            let still = enough && changed <= settings.still * all;
            self.calm = if still { self.calm + 1 } else { 0 };
        }
        self.temperature = (self.temperature * settings.cooling).max(settings.cold);
    }

    /// Mean size of the best value over all visits, against which worth is measured.
    pub(super) fn mean_value(&self, task: &Task<'_>) -> f64 {
        let (mut sum, mut visits) = (0.0, 0.0);
        for (sheet, evidence) in self.evidence.iter().enumerate() {
            for cell in 0..task.lattice.len() {
                let weight = evidence.all.visits(cell);
                sum += weight * self.table.best(self.row(task, sheet, cell)).abs();
                visits += weight;
            }
        }
        if visits > 0.0 { sum / visits } else { 0.0 }
    }

    /// Mean value of a region's action over its visits.
    pub(super) fn region_value(&self, task: &Task<'_>, sheet: usize, region: &Region) -> f64 {
        let (mut sum, mut visits) = (0.0, 1e-9);
        for cell in task.lattice.cells(&region.cells) {
            let weight = self.evidence[sheet].all.visits(cell);
            sum += weight * self.table.row(self.row(task, sheet, cell))[region.action];
            visits += weight;
        }
        sum / visits
    }
}
