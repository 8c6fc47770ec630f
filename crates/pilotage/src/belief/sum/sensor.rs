//! What was sensed, and how likely it is in a state.

use super::SumKeeping;
use super::frame::{LOG_TAU, root_into, whiten};
use crate::belief::gaussian::normal_cdf;
use crate::belief::reading::Reading;
use crate::model::{ActionId, Doing, Dynamics, ModeId};

/// Noise of no variance is taken for one of this variance.
const LEAST: f64 = 1e-24;

/// Two numbers are told apart by a root where less of one, as a share of its variance, is unknown once the other is known.
const APART: f64 = 1e-9;

/// A reading on its way into a sum, with room for what is asked at a state.
pub(super) struct Sensor<'a> {
    dynamics: &'a Dynamics,
    pub(super) reading: Reading<'a>,
    pub(super) doing: Doing,
    /// Number of numbers that are read, `m`.
    pub(super) m: usize,
    /// What is read where it was last asked, length `m`, and the covariance of its noise, `m x m`.
    pub(super) values: Vec<f64>,
    pub(super) noise: Vec<f64>,
    root: Vec<f64>,
    likely: Vec<f64>,
}

impl<'a> Sensor<'a> {
    pub(super) fn new(
        keeping: &'a SumKeeping,
        action: ActionId,
        step: usize,
        reading: Reading<'a>,
    ) -> Self {
        let dynamics = &keeping.dynamics;
        let m = dynamics.readings();
        Self {
            dynamics,
            reading,
            doing: keeping.doing(0, action, step),
            m,
            values: vec![0.0; m],
            noise: vec![0.0; m * m],
            root: vec![0.0; m * m],
            likely: vec![0.0; dynamics.symbols()],
        }
    }

    /// Asked in this mode from now on.
    pub(super) fn set_mode(&mut self, mode: ModeId) {
        self.doing.mode = mode;
    }

    /// The numbers that were read, where none of them is cut off at an end.
    pub(super) fn numbers(&self) -> Option<&'a [f64]> {
        match self.reading {
            Reading::Values(values) if !self.is_cut_off(values) => Some(values),
            _ => None,
        }
    }

    fn is_cut_off(&self, read: &[f64]) -> bool {
        let mut ends = self.dynamics.saturates().iter().zip(read);
        ends.any(|(ends, read)| *read <= ends.low || *read >= ends.high)
    }

    /// Probability that there is a reading, where that is the same everywhere.
    pub(super) fn present(&self) -> Option<f64> {
        self.dynamics.constant_present(self.doing)
    }

    /// `H`, `m x n` row by row, and the covariance of the noise, where readings are linear and their noise the same everywhere.
    pub(super) fn linear(&self) -> Option<(&'a [f64], &'a [f64])> {
        let h = self.dynamics.linear_observation(self.doing)?;
        let noise = self.dynamics.constant_observation_noise(self.doing)?;
        Some((h, noise))
    }

    /// Asks what is read in a state, and with which noise.
    pub(super) fn ask(&mut self, state: &[f64]) {
        self.dynamics
            .observation(self.doing, state, &mut self.values);
        self.dynamics
            .observation_noise(self.doing, state, &mut self.noise);
    }

    /// Logarithm of how likely what was sensed is in a state.
    pub(super) fn log_likelihood(&mut self, state: &[f64]) -> f64 {
        let present = self.dynamics.present(self.doing, state);
        match self.reading {
            Reading::Nothing => (1.0 - present).ln(),
            Reading::Symbol(symbol) => {
                self.dynamics
                    .symbol_probabilities(self.doing, state, &mut self.likely);
                let likely = self.likely.get(symbol as usize).copied();
                (present * likely.unwrap_or(0.0)).ln()
            }
            Reading::Values(read) => {
                self.ask(state);
                let log = self.log_density(read);
                if present < 1.0 {
                    log + present.ln()
                } else {
                    log
                }
            }
        }
    }

    fn log_density(&mut self, read: &[f64]) -> f64 {
        if self.is_cut_off(read) {
            let saturates = self.dynamics.saturates();
            let each = (0..self.m).map(|r| {
                let (apart, variance) = (read[r] - self.values[r], self.noise[r * self.m + r]);
                let sd = variance.max(LEAST).sqrt();
                match read[r] {
                    low if low <= saturates[r].low => normal_cdf(apart / sd).ln(),
                    high if high >= saturates[r].high => normal_cdf(-apart / sd).ln(),
                    _ => log_normal(apart, variance),
                }
            });
            return each.sum();
        }
        if self.m == 1 {
            return log_normal(read[0] - self.values[0], self.noise[0]);
        }
        for (r, (value, read)) in self.values.iter_mut().zip(read).enumerate() {
            *value = read - *value;
            let variance = &mut self.noise[r * self.m + r];
            *variance = variance.max(LEAST);
        }
        if let (&[x, y], &[xx, xy, _, yy]) = (self.values.as_slice(), self.noise.as_slice())
            && let Some(log) = log_normal_of_two((x, y), (xx, xy, yy))
        {
            return log;
        }
        root_into(&self.noise, self.m, &mut self.root);
        whiten(&self.root, &mut self.values)
    }
}

/// Logarithm of the density of two numbers of mean 0; none where one is all but known from the other.
fn log_normal_of_two((x, y): (f64, f64), (xx, xy, yy): (f64, f64, f64)) -> Option<f64> {
    let determinant = xx * yy - xy * xy;
    if determinant <= APART * xx * yy {
        return None;
    }
    let apart = (x * x * yy - 2.0 * x * y * xy + y * y * xx) / determinant;
    Some(-0.5 * (apart + determinant.ln()) - LOG_TAU)
}

fn log_normal(apart: f64, variance: f64) -> f64 {
    let variance = variance.max(LEAST);
    -0.5 * (apart * apart / variance + variance.ln() + LOG_TAU)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_numbers_are_as_likely_as_one_and_the_other_once_it_is_known() {
        let cases = [
            ((0.3, -0.7), (2.0, 0.9, 0.5)),
            ((-4.0, 1.5), (0.01, -0.02, 0.3)),
            ((1.0, 2.0), (3.0, 0.0, 1e-6)),
        ];
        for ((x, y), (xx, xy, yy)) in cases {
            let then = log_normal(y - xy / xx * x, yy - xy * xy / xx);
            let expected = log_normal(x, xx) + then;
            let log = log_normal_of_two((x, y), (xx, xy, yy)).expect("far from known");
            assert!(
                (log - expected).abs() < 1e-9 * expected.abs(),
                "{log} {expected}"
            );
        }
        assert_eq!(log_normal_of_two((1.0, 1.0), (1.0, 1.0, 1.0)), None);
    }
}
