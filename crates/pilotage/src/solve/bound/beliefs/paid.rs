//! What is paid to a belief, exactly.

use super::super::frame::{Frame, inside};
use super::super::step::{self, Doing};
use crate::model::{ActionId, ModeId, Then};

/// What is paid, constant in each cell between the cuts of both axes; the second axis runs faster.
#[derive(Debug, Clone)]
pub(super) struct Paid {
    pub values: Vec<f64>,
    pub columns: usize,
}

impl Paid {
    fn rows(&self) -> usize {
        self.values.len() / self.columns
    }

    fn at(&self, row: usize, column: usize) -> f64 {
        self.values[row * self.columns + column]
    }

    pub(super) fn expectation(&self, rows: &[f64], columns: &[f64]) -> f64 {
        let row = |row: usize| {
            let values = &self.values[row * self.columns..(row + 1) * self.columns];
            values.iter().zip(columns).map(|(v, p)| v * p).sum::<f64>()
        };
        rows.iter().enumerate().map(|(i, p)| p * row(i)).sum()
    }

    /// The most that its values along one axis jump, all jumps together.
    pub(super) fn jumps(&self, axis: usize) -> f64 {
        let (along, across) = match axis {
            0 => (self.rows(), self.columns),
            _ => (self.columns, self.rows()),
        };
        let value = |i: usize, j: usize| match axis {
            0 => self.at(i, j),
            _ => self.at(j, i),
        };
        let of_line = |j| -> f64 {
            (1..along)
                .map(|i| (value(i, j) - value(i - 1, j)).abs())
                .sum()
        };
        (0..across).map(of_line).fold(0.0, f64::max)
    }

    /// By cell of the other axis, the most that is expected of beliefs whose mean along an axis is at its edge or farther out.
    pub(super) fn beyond(&self, axis: usize, reach: &Reach) -> Vec<f64> {
        let line = |j: usize| {
            let value = |i: usize| match axis {
                0 => self.at(i, j),
                _ => self.at(j, i),
            };
            reach.most(&(0..reach.masses.len()).map(value).collect::<Vec<_>>())
        };
        let across = [self.columns, self.rows()][axis];
        (0..across).map(line).collect()
    }
}

/// Beliefs from the edge of the grid outwards along an axis.
pub(super) struct Reach {
    /// Probabilities of the cells at the edge.
    pub masses: Vec<f64>,
    /// Whether the probability of a cell only falls from there on.
    pub falls: Vec<bool>,
}

impl Reach {
    /// The most that can be expected of something constant in each cell.
    pub(super) fn most(&self, values: &[f64]) -> f64 {
        let cells = || values.iter().zip(&self.masses).zip(&self.falls);
        let outer = cells().filter(|(_, falls)| !**falls);
        let most = outer.fold(f64::NEG_INFINITY, |most, ((value, _), _)| most.max(*value));
        let inner = cells().filter(|(_, falls)| **falls);
        most + inner
            .map(|((value, mass), _)| (value - most).max(0.0) * mass)
            .sum::<f64>()
    }
}

/// What an action does in a mode, the same wherever the state is.
#[derive(Debug)]
pub(super) struct Effect {
    pub before: Paid,
    /// What is paid after the move; `None` where nothing comes after it.
    pub after: Option<Paid>,
    pub then: Then,
    pub mode: ModeId,
}

/// Why a belief of this model is not exact.
pub(super) fn effects(frame: &Frame) -> Result<Vec<Vec<Effect>>, String> {
    let model = frame.model;
    if frame.walled {
        return Err("walls stop the state".to_owned());
    }
    if !model.episode.alive.sides.is_empty() {
        return Err("it is conditioned on not having failed".to_owned());
    }
    let effect = |mode: ModeId, action: ActionId| effect(frame, mode, action);
    (0..model.modes.len())
        .map(|mode| (0..model.actions.len()).map(|a| effect(mode, a)).collect())
        .collect()
}

fn effect(frame: &Frame, mode: ModeId, action: ActionId) -> Result<Effect, String> {
    let hidden = "it depends on the state whether an event happens";
    let places = [inside(&frame.axes[0].cuts), inside(&frame.axes[1].cuts)];
    let columns = places[1].len();
    let all = || {
        let rows = places[0].iter();
        rows.flat_map(|&x| places[1].iter().map(move |&y| [x, y]))
    };
    let doing = Doing::new(frame.model, mode, action);
    let befores: Vec<step::Before> = all().map(|at| doing.before(frame.state(&at))).collect();
    let paid = |values: Vec<f64>| Paid { values, columns };
    let first = befores[0];
    if befores
        .iter()
        .any(|other| (other.mode, other.then) != (first.mode, first.then))
    {
        return Err(hidden.to_owned());
    }
    let rewards = paid(befores.iter().map(|before| before.reward).collect());
    if first.then != Then::Continue {
        return Ok(Effect {
            before: rewards,
            after: None,
            then: first.then,
            mode: first.mode,
        });
    }
    let afters = |before: &step::Before| -> Vec<step::After> {
        all()
            .map(|at| doing.after(before, frame.state(&at)))
            .collect()
    };
    let after = afters(&first);
    let same = |other: &step::Before| other.happened == first.happened || afters(other) == after;
    let to = after[0];
    if !befores.iter().all(same)
        || after
            .iter()
            .any(|other| (other.mode, other.then) != (to.mode, to.then))
    {
        return Err(hidden.to_owned());
    }
    Ok(Effect {
        before: rewards,
        after: Some(paid(after.iter().map(|after| after.reward).collect())),
        then: to.then,
        mode: to.mode,
    })
}
