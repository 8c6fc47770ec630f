//! What may be sensed in every cell.
//!
//! A cell is cut into parts where its points read differently, and the readings of a part are a Gaussian: that of its middle, with the
//! variance that the reading has over the part beside the noise. So the law is smooth where the noise is narrower than a cell, and its
//! probabilities sum to one.

use std::sync::Arc;

use super::grid::{Grid, Part, Spot};
use crate::belief::gaussian::{even_steps, interval_probability};
use crate::model::{Doing, Dynamics, Interval, ModeId};
use crate::parallel;

/// Parts of a cell along its variable, for one and for two of them.
const PARTS: [usize; 2] = [5, 3];

/// A cell whose readings spread by less than this share of their noise's variance is one part.
const BLURRED: f64 = 0.05;

/// Readings have at least this standard deviation, so that they have a density.
const LEAST: f64 = 1e-9;

/// What is read in a part of a cell.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Heard {
    /// Length `m`.
    pub(crate) mean: Vec<f64>,
    /// Row by row, `m x m`.
    pub(crate) covariance: Vec<f64>,
    /// Its Cholesky factor.
    pub(super) factor: Vec<f64>,
}

impl Heard {
    fn new(mean: Vec<f64>, mut covariance: Vec<f64>) -> Self {
        let m = mean.len();
        for i in 0..m {
            let least = LEAST * mean[i].abs().max(1.0);
            covariance[i * m + i] = covariance[i * m + i].max(least * least);
        }
        let factor = cholesky(&covariance, m);
        Self {
            mean,
            covariance,
            factor,
        }
    }

    /// Logarithm of the density of a reading.
    fn log_density(&self, reading: &[f64]) -> f64 {
        let m = self.mean.len();
        let mut log = -0.5 * m as f64 * std::f64::consts::TAU.ln();
        let mut solved: Vec<f64> = Vec::with_capacity(m);
        for i in 0..m {
            let row = &self.factor[i * m..][..=i];
            let known: f64 = row.iter().zip(&solved).map(|(l, z)| l * z).sum();
            let z = (reading[i] - self.mean[i] - known) / row[i];
            log -= 0.5 * z * z + row[i].ln();
            solved.push(z);
        }
        log
    }

    /// The same where readings saturate: an end has everything beyond it. Readings count one by one, apart from their correlations.
    fn log_saturated(&self, reading: &[f64], ends: &[Interval]) -> f64 {
        let m = self.mean.len();
        let of = |i: usize| {
            let (mean, variance) = (self.mean[i], self.covariance[i * m + i]);
            let beyond = |side| interval_probability(mean, variance, side).ln();
            if reading[i] <= ends[i].low {
                return beyond(Interval::new(f64::NEG_INFINITY, ends[i].low));
            }
            if reading[i] >= ends[i].high.next_down() {
                return beyond(Interval::new(ends[i].high, f64::INFINITY));
            }
            let z2 = (reading[i] - mean).powi(2) / variance;
            -0.5 * (z2 + (std::f64::consts::TAU * variance).ln())
        };
        (0..m).map(of).sum()
    }
}

/// The lower Cholesky factor of a covariance, row by row; directions without variance are left with the least there is.
fn cholesky(covariance: &[f64], m: usize) -> Vec<f64> {
    let mut factor = vec![0.0; m * m];
    for i in 0..m {
        for j in 0..=i {
            let known: f64 = (0..j).map(|k| factor[i * m + k] * factor[j * m + k]).sum();
            let rest = covariance[i * m + j] - known;
            factor[i * m + j] = match i == j {
                true => rest.max(LEAST * LEAST).sqrt(),
                false => rest / factor[j * m + j],
            };
        }
    }
    factor
}

/// What may be sensed in the cells of a mode after an action.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Table {
    /// Probability that there is a reading, by cell.
    pub(crate) present: Vec<f64>,
    /// Of a sensor that is read in numbers: the parts of each cell, which weigh the same.
    pub(crate) heard: Vec<Vec<Heard>>,
    /// Of a discrete sensor: probability of each signal, by cell.
    pub(crate) signals: Vec<Vec<f64>>,
}

impl Table {
    fn new(dynamics: &Dynamics, grid: &Grid, doing: Doing) -> Self {
        let n = grid.dim();
        let parts = |cell| grid.parts(cell, PARTS[n - 1]);
        let averaged = |cell: usize, of: &dyn Fn(&[f64]) -> f64| {
            let parts = parts(cell);
            let sum: f64 = parts.iter().map(|part| of(&part.middle[..n])).sum();
            sum / parts.len() as f64
        };
        let present = match dynamics.constant_present(doing) {
            Some(present) => vec![present; grid.count()],
            None => (0..grid.count())
                .map(|cell| averaged(cell, &|state| dynamics.present(doing, state)))
                .collect(),
        };
        let signal = |signal: usize, cell: usize| {
            let of = |state: &[f64]| {
                let mut likely = vec![0.0; dynamics.symbols()];
                dynamics.symbol_probabilities(doing, state, &mut likely);
                likely[signal]
            };
            averaged(cell, &of)
        };
        let discrete = dynamics.symbols() > 0;
        Self {
            present,
            signals: (0..dynamics.symbols())
                .map(|number| (0..grid.count()).map(|cell| signal(number, cell)).collect())
                .collect(),
            heard: match discrete {
                true => Vec::new(),
                false => parallel::map(grid.count(), |cell| heard_in(dynamics, grid, doing, cell)),
            },
        }
    }

    /// Logarithm of how likely numbers are in a cell.
    fn log_likelihood(&self, cell: usize, reading: &[f64], ends: &[Interval]) -> f64 {
        let parts = &self.heard[cell];
        let log = |heard: &Heard| match ends.is_empty() {
            true => heard.log_density(reading),
            false => heard.log_saturated(reading, ends),
        };
        if let [only] = &parts[..] {
            return log(only) + self.present[cell].ln();
        }
        let logs: Vec<f64> = parts.iter().map(log).collect();
        let largest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if largest == f64::NEG_INFINITY {
            return largest;
        }
        let sum: f64 = logs.iter().map(|log| (log - largest).exp()).sum();
        largest + (sum / parts.len() as f64).ln() + self.present[cell].ln()
    }
}

/// What is read in each part of a cell.
fn heard_in(dynamics: &Dynamics, grid: &Grid, doing: Doing, cell: usize) -> Vec<Heard> {
    let whole = grid.whole(cell);
    let (heard, spread) = heard(dynamics, grid, doing, &whole);
    let m = heard.mean.len();
    let blurred = (0..m).all(|i| spread[i] <= BLURRED * heard.covariance[i * m + i]);
    if blurred {
        return vec![heard];
    }
    let parts = grid.cut(&whole, PARTS[grid.dim() - 1]);
    let of = |part: &Part| self::heard(dynamics, grid, doing, part).0;
    parts.iter().map(of).collect()
}

/// What is read in a part of a cell, and how much of the variance of each reading is due to its width.
fn heard(dynamics: &Dynamics, grid: &Grid, doing: Doing, part: &Part) -> (Heard, Vec<f64>) {
    let (n, m) = (grid.dim(), dynamics.readings());
    let read = |state: Spot| {
        let mut reading = vec![0.0; m];
        dynamics.observation(doing, &state[..n], &mut reading);
        reading
    };
    let mut covariance = vec![0.0; m * m];
    dynamics.observation_noise(doing, &part.middle[..n], &mut covariance);
    let mut spread = vec![0.0; m];
    for i in (0..n).filter(|i| part.half[*i] > 0.0) {
        let at = |sign: f64| {
            let mut state = part.middle;
            state[i] += sign * part.half[i];
            read(state)
        };
        let (low, high) = (at(-1.0), at(1.0));
        let apart = |j: usize| high[j] - low[j];
        for j in 0..m {
            for k in 0..m {
                covariance[j * m + k] += apart(j) * apart(k) / 12.0;
            }
            spread[j] += apart(j).powi(2) / 12.0;
        }
    }
    (Heard::new(read(part.middle), covariance), spread)
}

/// The sensor of a model on its cells.
#[derive(Debug, Clone)]
pub(crate) struct Sensor {
    /// By action and mode; equal ones are kept once.
    tables: Vec<Vec<Arc<Table>>>,
    ends: Vec<Interval>,
    /// Whether the agent sees the mode beside the numbers that it reads.
    sees_mode: bool,
    /// Steps of the lattice along which readings are spread.
    steps: Vec<f64>,
}

impl Sensor {
    pub(super) fn new(dynamics: &Dynamics, grid: &Grid, sees_mode: bool) -> Self {
        let mut known: Vec<Arc<Table>> = Vec::new();
        let mut table = |mode, action| {
            let doing = Doing {
                mode,
                action,
                step: 0,
            };
            let table = Table::new(dynamics, grid, doing);
            if let Some(same) = known.iter().find(|same| ***same == table) {
                return same.clone();
            }
            known.push(Arc::new(table));
            known[known.len() - 1].clone()
        };
        let mut of_action = |action| (0..dynamics.modes()).map(|m| table(m, action)).collect();
        Self {
            tables: (0..dynamics.actions()).map(&mut of_action).collect(),
            ends: dynamics.saturates().to_vec(),
            sees_mode,
            steps: even_steps(dynamics.readings()),
        }
    }

    pub(crate) fn table(&self, action: usize, mode: ModeId) -> &Table {
        &self.tables[action][mode]
    }

    /// Ends at which readings saturate; empty where none does.
    pub(crate) fn ends(&self) -> &[Interval] {
        &self.ends
    }

    /// Whether the agent sees the mode beside the numbers that it reads.
    pub(crate) fn sees_mode(&self) -> bool {
        self.sees_mode
    }

    /// Steps of the lattice along which readings are spread, one for each of them.
    pub(super) fn steps(&self) -> &[f64] {
        &self.steps
    }

    /// Logarithm of how likely numbers are in a cell of a mode.
    pub(super) fn log_likelihood(
        &self,
        action: usize,
        mode: ModeId,
        cell: usize,
        values: &[f64],
    ) -> f64 {
        let m = values.len() - usize::from(self.sees_mode);
        if self.sees_mode && values[m] != mode as f64 {
            return f64::NEG_INFINITY;
        }
        self.table(action, mode)
            .log_likelihood(cell, &values[..m], &self.ends)
    }
}
