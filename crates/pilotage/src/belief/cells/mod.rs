//! Beliefs as probabilities of cells: of any shape, for models of one or two state variables.
//!
//! The state space is cut into cells ([`CellsKeeping::new`] says where), and a belief is a probability for each mode and cell; within a
//! cell all states are taken to be alike likely. Where an action leads from each cell, what it pays there and what may be sensed is found
//! once. Mass that moves beyond the cells stays in those at the border, as it does at walls.
//!
//! # References
//! S. Thrun, W. Burgard and D. Fox, *Probabilistic Robotics*, 2005, chapter 4.1 (the histogram filter).

mod extent;
mod grid;
mod motion;
mod sensing;
mod shape;
mod stage;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use super::full::{Acted, Keeping, Moments, Sensed};
use super::reading::Reading;
use crate::error::{Error, Result};
use crate::model::{ActionId, Doing, Dynamics, ModeId, Model, When};
pub(crate) use grid::Grid;
use motion::{Mover, Rows};
pub(crate) use sensing::{Heard, Sensor};
use stage::Stage;

/// A cell that is so many times less likely than the likeliest is left out after a reading.
const HARDLY: f64 = 1e-12;

/// A probability for each mode and cell, which sum to 1: those of the first mode first.
#[derive(Debug, Clone, PartialEq)]
pub struct Cells {
    mass: Vec<f64>,
}

impl Cells {
    /// Probabilities by mode and cell; those of the first mode first.
    pub fn probabilities(&self) -> &[f64] {
        &self.mass
    }

    /// Makes masses probabilities; `false` if there is none, and nothing is changed.
    fn normalise(&mut self) -> bool {
        let sum: f64 = self.mass.iter().sum();
        if sum <= 0.0 || sum.is_nan() {
            return false;
        }
        self.mass.iter_mut().for_each(|mass| *mass /= sum);
        true
    }
}

/// What an action does in a mode.
#[derive(Debug, Clone)]
struct Flow {
    before: Stage,
    /// Where it leads from cells.
    rows: Arc<Rows>,
    after: Stage,
}

/// What an action is expected to pay and to do, by mode and cell.
#[derive(Debug, Clone)]
struct Account {
    reward: Vec<f64>,
    ended: Vec<f64>,
    restarted: Vec<f64>,
}

/// Keeps beliefs as probabilities of cells.
#[derive(Debug, Clone)]
pub struct CellsKeeping {
    grid: Grid,
    modes: usize,
    start: Cells,
    /// By action and mode.
    flows: Vec<Vec<Flow>>,
    /// By action.
    accounts: Vec<Account>,
    sensor: Sensor,
    /// Cells in which no state can be, where the belief knows.
    blocked: Vec<bool>,
    discrete: bool,
}

fn unsupported(model: &Model, reason: String) -> Error {
    Error::Unsupported {
        solver: "cells",
        model: model.name.clone(),
        reason,
    }
}

impl CellsKeeping {
    /// Cells of a model of one or two state variables, in which nothing changes with the step of the episode: as many along a variable as
    /// its [`BeliefSettings::cells`](crate::model::BeliefSettings::cells) say; if they do not, 40 to 200 for one and 16 to 40 for two, at
    /// least eight (two) to a standard deviation of any noise and to the narrowest place where something is paid or happens; and up to a
    /// quarter more if controls then lead across whole cells. They lie between the bounds, and beyond them as far as the controls lead in
    /// ten steps if they are no walls to the belief (at most half of their width for one variable and a quarter for two). Where there is
    /// no bound, or one three times farther out than anything else, they reach from the starts (5 standard deviations) and the places of
    /// which rewards and events speak as far as actions lead from the starts in ten steps, and from there grow by a tenth each. Walls have
    /// thin cells of their own, whole numbers a cell each, angles the full circle, and squares of a map a whole number of cells.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for other models, with the reason and what would do.
    pub fn new(model: &Model) -> Result<Self> {
        let clock = model.clock();
        if clock > 0 {
            return Err(unsupported(
                model,
                format!(
                    "what it pays or changes, or how it moves or is sensed, depends on the step of the episode up to step {clock}, and cells do not tell steps apart; set `tracker = \"sum\"` in [belief]"
                ),
            ));
        }
        let dynamics = Dynamics::new(model);
        let grid = extent::grid(model, &dynamics)?;
        let mover = Mover::new(model, &dynamics, &grid);
        let mut start = Cells {
            mass: motion::start(&mover),
        };
        if !start.normalise() {
            let reason = "no start is within what `alive` in [episode] allows; move the start";
            return Err(unsupported(model, reason.to_owned()));
        }
        let flows = flows(model, &dynamics, &grid, &mover);
        let account = |action: &Vec<Flow>| account(model, &grid, action);
        let discrete = dynamics.symbols() > 0;
        Ok(Self {
            modes: model.modes.len(),
            start,
            accounts: flows.iter().map(account).collect(),
            flows,
            sensor: Sensor::new(&dynamics, &grid, model.laws.modes_seen && !discrete),
            blocked: blocked(model, &dynamics, &grid),
            discrete,
            grid,
        })
    }

    /// Number of cells of a mode.
    pub fn cells(&self) -> usize {
        self.grid.count()
    }

    /// Number of modes times cells.
    pub(crate) fn states(&self) -> usize {
        self.modes * self.cells()
    }

    /// Number of modes.
    pub(crate) fn modes(&self) -> usize {
        self.modes
    }

    pub(crate) fn sensor(&self) -> &Sensor {
        &self.sensor
    }

    /// Whether one of finitely many signals is heard.
    pub(crate) fn is_discrete(&self) -> bool {
        self.discrete
    }

    /// Expected reward of an action, by mode and cell.
    pub(crate) fn rewards(&self, action: ActionId) -> &[f64] {
        &self.accounts[action].reward
    }

    /// Probability that an action leads back to the start, by mode and cell.
    pub(crate) fn restarts(&self, action: ActionId) -> &[f64] {
        &self.accounts[action].restarted
    }

    /// The belief that has these masses, which need not sum to 1.
    pub(crate) fn belief(&self, mass: Vec<f64>) -> Cells {
        let mut cells = Cells { mass };
        match cells.normalise() {
            true => cells,
            false => self.start.clone(),
        }
    }

    /// Adds to `to` where an action leads masses by mode and cell, as far as the episode goes on.
    pub(crate) fn forward(&self, action: ActionId, from: &[f64], to: &mut [f64]) {
        let count = self.cells();
        let mut moved = vec![0.0; count];
        for (mode, flow) in self.flows[action].iter().enumerate() {
            let from = &from[mode * count..][..count];
            if from.iter().all(|mass| *mass == 0.0) {
                continue;
            }
            let part = |shares: &[f64], moved: &mut [f64]| {
                let leaving: Vec<f64> = from.iter().zip(shares).map(|(m, s)| m * s).collect();
                moved.fill(0.0);
                flow.rows.forward(&leaving, moved);
            };
            part(&flow.before.stays, &mut moved);
            let mut arrive = |mode: ModeId, shares: Option<&[f64]>, moved: &[f64]| {
                let to = &mut to[mode * count..][..count];
                for (cell, (to, mass)) in to.iter_mut().zip(moved).enumerate() {
                    *to += mass * shares.map_or(1.0, |shares| shares[cell]);
                }
            };
            arrive(mode, Some(&flow.after.stays), &moved);
            for (becomes, shares) in &flow.after.switched {
                arrive(*becomes, Some(shares), &moved);
            }
            for (becomes, shares) in &flow.before.switched {
                part(shares, &mut moved);
                arrive(*becomes, None, &moved);
            }
        }
    }

    /// What is expected, by mode and cell, of values that are had once an action has led on: the transpose of
    /// [`CellsKeeping::forward`].
    pub(crate) fn backward(&self, action: ActionId, values: &[f64]) -> Vec<f64> {
        let count = self.cells();
        let of = |mode: ModeId| &values[mode * count..][..count];
        let mut expected = vec![0.0; values.len()];
        for (mode, flow) in self.flows[action].iter().enumerate() {
            let expected = &mut expected[mode * count..][..count];
            let mut arrived: Vec<f64> =
                flow.after.stays.iter().zip(of(mode)).map(product).collect();
            for (becomes, shares) in &flow.after.switched {
                let more = shares.iter().zip(of(*becomes)).map(product);
                arrived.iter_mut().zip(more).for_each(|(sum, x)| *sum += x);
            }
            for (cell, expected) in expected.iter_mut().enumerate() {
                let mut add = |share: f64, values: &[f64]| {
                    if share > 0.0 {
                        *expected += share * flow.rows.expected(cell, values);
                    }
                };
                add(flow.before.stays[cell], &arrived);
                for (becomes, shares) in &flow.before.switched {
                    add(shares[cell], of(*becomes));
                }
            }
        }
        expected
    }

    /// Multiplies masses by how likely something is, by mode and cell; if it could not be, nothing is changed.
    fn weigh(&self, cells: &mut Cells, log_likely: &dyn Fn(ModeId, usize) -> f64) {
        let count = self.cells();
        let met = cells
            .mass
            .iter()
            .enumerate()
            .filter(|(_, mass)| **mass > 0.0);
        let logs: Vec<(usize, f64)> = met
            .map(|(state, mass)| (state, mass.ln() + log_likely(state / count, state % count)))
            .collect();
        let largest = logs
            .iter()
            .fold(f64::NEG_INFINITY, |most, (_, log)| most.max(*log));
        if !largest.is_finite() {
            return;
        }
        cells.mass.fill(0.0);
        for (state, log) in logs {
            let mass = (log - largest).exp();
            cells.mass[state] = if mass > HARDLY { mass } else { 0.0 };
        }
        cells.normalise();
    }
}

fn product((a, b): (&f64, &f64)) -> f64 {
    a * b
}

fn flows(model: &Model, dynamics: &Dynamics, grid: &Grid, mover: &Mover<'_>) -> Vec<Vec<Flow>> {
    let mut known: Vec<Arc<Rows>> = Vec::new();
    let mut flow = |mode, action| {
        let doing = Doing {
            mode,
            action,
            step: 0,
        };
        let stage = |when| Stage::new(model, dynamics, grid, doing, when);
        let rows = mover.rows(doing);
        let same = known.iter().find(|same| ***same == rows).cloned();
        let rows = same.unwrap_or_else(|| {
            known.push(Arc::new(rows));
            known[known.len() - 1].clone()
        });
        Flow {
            before: stage(When::Before),
            rows,
            after: stage(When::After),
        }
    };
    let mut of = |action| {
        (0..model.modes.len())
            .map(|mode| flow(mode, action))
            .collect()
    };
    (0..model.actions.len()).map(&mut of).collect()
}

/// What an action is expected to pay and to do.
fn account(model: &Model, grid: &Grid, flows: &[Flow]) -> Account {
    let states = flows.len() * grid.count();
    let mut account = Account {
        reward: Vec::with_capacity(states),
        ended: Vec::with_capacity(states),
        restarted: Vec::with_capacity(states),
    };
    for flow in flows {
        for cell in 0..grid.count() {
            let (stays, moves) = (flow.before.stays[cell], flow.before.goes_on(cell));
            let fails = if moves > 0.0 {
                1.0 - flow.rows.left(cell)
            } else {
                0.0
            };
            let expected = |values: &[f64]| flow.rows.expected(cell, values);
            let then = |share: f64, values: &[f64]| match share > 0.0 {
                true => share * expected(values),
                false => 0.0,
            };
            account.reward.push(
                flow.before.plain[cell]
                    + flow.before.paid[cell]
                    + moves * fails * model.episode.failure_reward
                    + then(moves, &flow.after.plain)
                    + then(stays, &flow.after.paid),
            );
            let ended = flow.before.ended[cell] + moves * fails;
            account.ended.push(ended + then(stays, &flow.after.ended));
            let restarted = flow.before.restarted[cell] + then(stays, &flow.after.restarted);
            account.restarted.push(restarted);
        }
    }
    account
}

/// Cells in which no state can be.
fn blocked(model: &Model, dynamics: &Dynamics, grid: &Grid) -> Vec<bool> {
    let map = model.map.as_ref().filter(|_| dynamics.walls().is_some());
    let free = |cell| map.is_none_or(|map| map.free(grid.middle(cell)));
    (0..grid.count()).map(|cell| !free(cell)).collect()
}

impl Keeping for CellsKeeping {
    type Full = Cells;

    fn actions(&self) -> usize {
        self.flows.len()
    }

    fn start(&self) -> Cells {
        self.start.clone()
    }

    fn act(&self, full: &mut Cells, action: ActionId, _step: usize) -> Acted {
        let account = &self.accounts[action];
        let expected = |values: &[f64]| full.mass.iter().zip(values).map(product).sum();
        let acted = Acted {
            reward: expected(&account.reward),
            ended: expected(&account.ended),
            restarted: expected(&account.restarted),
        };
        let mut to = vec![0.0; full.mass.len()];
        self.forward(action, &full.mass, &mut to);
        full.mass = to;
        full.normalise();
        acted
    }

    fn readings(
        &self,
        full: &Cells,
        action: ActionId,
        _step: usize,
        most: usize,
    ) -> Vec<(f64, Sensed)> {
        self.possible(full, action, most)
    }

    fn sense(&self, full: &mut Cells, action: ActionId, _step: usize, reading: Reading<'_>) {
        let table = |mode| self.sensor.table(action, mode);
        match reading {
            Reading::Values(values) if !self.discrete => self.weigh(full, &|mode, cell| {
                self.sensor.log_likelihood(action, mode, cell, values)
            }),
            Reading::Symbol(symbol) if self.discrete => self.weigh(full, &|mode, cell| {
                let table = table(mode);
                let signal = table.signals.get(symbol as usize);
                let likely = signal.map_or(0.0, |signal| signal[cell]);
                (likely * table.present[cell]).ln()
            }),
            Reading::Nothing => self.weigh(full, &|mode, cell| {
                (1.0 - table(mode).present[cell]).max(0.0).ln()
            }),
            // What another kind of sensor says means nothing here.
            Reading::Values(_) | Reading::Symbol(_) => {}
        }
    }

    fn moments(&self, full: &Cells, moments: &mut Moments) {
        self.write_moments(full, moments);
    }

    fn with_moments(&self, moments: &Moments) -> Cells {
        self.gaussian(moments)
    }

    fn moved_to(&self, full: &Cells, mean: &[f64]) -> Cells {
        self.shifted(full, mean)
    }
}
