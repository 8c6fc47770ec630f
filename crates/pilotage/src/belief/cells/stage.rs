//! What a step pays and does besides moving the state, cell by cell.

use super::grid::{Grid, Part, cut_at};
use crate::model::{Doing, Dynamics, Effect, ModeId, Model, Then, When};

/// Parts of a piece along a variable over which formulas are averaged.
const PARTS: usize = 3;

/// One of the two times of a step at which effects are asked, for an action in a mode. All by cell: shares of a cell count, as the
/// state is anywhere in it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Stage {
    /// Paid by rewards.
    pub(super) plain: Vec<f64>,
    /// Paid by events, where none has happened before.
    pub(super) paid: Vec<f64>,
    /// Probability that no event happens and the episode goes on.
    pub(super) stays: Vec<f64>,
    /// Probability that the episode ends.
    pub(super) ended: Vec<f64>,
    /// Probability that it starts afresh.
    pub(super) restarted: Vec<f64>,
    /// Probability that an event happens after which the episode goes on in this mode.
    pub(super) switched: Vec<(ModeId, Vec<f64>)>,
}

impl Stage {
    pub(super) fn new(
        model: &Model,
        dynamics: &Dynamics,
        grid: &Grid,
        doing: Doing,
        when: When,
    ) -> Self {
        let effects = model.effects(doing.mode, doing.action, doing.step);
        let effects: Vec<Effect> = effects.into_iter().filter(|e| e.when == when).collect();
        let zeros = || vec![0.0; grid.count()];
        let mut stage = Self {
            plain: zeros(),
            paid: zeros(),
            stays: zeros(),
            ended: zeros(),
            restarted: zeros(),
            switched: Vec::new(),
        };
        for cell in 0..grid.count() {
            for (share, piece) in pieces(grid, cell, &effects) {
                stage.add(
                    cell,
                    share,
                    &piece,
                    (model, dynamics, grid, doing),
                    &effects,
                );
            }
        }
        stage
    }

    /// Adds a piece of a cell on which each region holds everywhere or nowhere.
    fn add(
        &mut self,
        cell: usize,
        share: f64,
        piece: &Part,
        (model, dynamics, grid, doing): (&Model, &Dynamics, &Grid, Doing),
        effects: &[Effect],
    ) {
        let n = grid.dim();
        let mut tally = model.tally(doing.mode, doing.action);
        let here = effects
            .iter()
            .filter(|effect| effect.region.contains(&piece.middle[..n]));
        let mut left = 1.0;
        for effect in here {
            if effect.change.is_none() {
                let value = formula(dynamics, grid, doing, piece, effect);
                self.plain[cell] += share * (effect.reward + value);
                continue;
            }
            let probability = left * effect.chance;
            left -= probability;
            if let Some(outcome) = tally.take(effect, probability) {
                let probability = share * outcome.probability;
                match outcome.then {
                    Then::End => self.ended[cell] += probability,
                    Then::Restart => self.restarted[cell] += probability,
                    Then::Continue => self.switch(outcome.mode)[cell] += probability,
                }
            }
        }
        self.paid[cell] += share * tally.reward;
        let rest = tally.rest();
        match rest.then {
            Then::End => self.ended[cell] += share * rest.probability,
            Then::Restart => self.restarted[cell] += share * rest.probability,
            Then::Continue => self.stays[cell] += share * rest.probability,
        }
    }

    fn switch(&mut self, mode: ModeId) -> &mut Vec<f64> {
        let known = self.switched.iter().position(|(known, _)| *known == mode);
        let index = known.unwrap_or_else(|| {
            self.switched.push((mode, vec![0.0; self.stays.len()]));
            self.switched.len() - 1
        });
        &mut self.switched[index].1
    }

    /// Probability that the episode goes on from a cell.
    pub(super) fn goes_on(&self, cell: usize) -> f64 {
        let switched = self.switched.iter().map(|(_, shares)| shares[cell]);
        self.stays[cell] + switched.sum::<f64>()
    }
}

/// A cell cut where regions end in it, with the share of each piece.
fn pieces(grid: &Grid, cell: usize, effects: &[Effect]) -> Vec<(f64, Part)> {
    let mut cuts = [Vec::new(), Vec::new()];
    for effect in effects {
        for (variable, side) in &effect.region.sides {
            cuts[*variable].extend([side.low, side.high]);
        }
    }
    cut_at(&grid.whole(cell), &cuts)
}

/// What an effect's formula pays on average.
fn formula(dynamics: &Dynamics, grid: &Grid, doing: Doing, piece: &Part, effect: &Effect) -> f64 {
    let Some(formula) = &effect.formula else {
        return 0.0;
    };
    let parts = grid.cut(piece, PARTS);
    let value = |part: &Part| {
        let point = dynamics.point(doing, &part.middle[..grid.dim()]);
        formula.value(&point)
    };
    parts.iter().map(value).sum::<f64>() / parts.len() as f64
}
