//! Expectations of piecewise linear functions, in closed form: quadrature would be an error to account for.

use crate::belief::gaussian::{normal_cdf, normal_density};
use crate::solve::grid::Axis;

/// A random number: uniform between `low` and `high`, which may be the same, plus N(0, sd^2).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Law {
    pub low: f64,
    pub high: f64,
    pub sd: f64,
}

impl Law {
    pub(super) fn normal(mean: f64, sd: f64) -> Self {
        Self {
            low: mean,
            high: mean,
            sd,
        }
    }

    /// Its law after `x -> a x + shift` and more noise.
    pub(super) fn moved(self, a: f64, shift: f64, variance: f64) -> Self {
        let (low, high) = (a * self.low + shift, a * self.high + shift);
        Self {
            low: low.min(high),
            high: low.max(high),
            sd: (a * a * self.sd * self.sd + variance).sqrt(),
        }
    }

    /// `P(X < at)`.
    pub(super) fn below(&self, at: f64) -> f64 {
        if at == f64::INFINITY {
            return 1.0;
        }
        if at == f64::NEG_INFINITY {
            return 0.0;
        }
        let width = self.high - self.low;
        let share = if width > 0.0 {
            (plus(at - self.low, self.sd) - plus(at - self.high, self.sd)) / width
        } else if self.sd > 0.0 {
            cdf((at - self.low) / self.sd)
        } else {
            f64::from(self.low < at)
        };
        share.clamp(0.0, 1.0)
    }

    /// `E max(X - at, 0)`.
    pub(super) fn beyond(&self, at: f64) -> f64 {
        let width = self.high - self.low;
        if width > 0.0 {
            (half_square(self.high - at, self.sd) - half_square(self.low - at, self.sd)) / width
        } else {
            plus(self.low - at, self.sd)
        }
    }

    /// Probabilities of the cells between rising `cuts`, one more than those.
    pub(super) fn masses(&self, cuts: &[f64]) -> Vec<f64> {
        let mut masses = Vec::with_capacity(cuts.len() + 1);
        let mut before = 0.0;
        for &cut in cuts {
            let below = self.below(cut).max(before);
            masses.push(below - before);
            before = below;
        }
        masses.push(1.0 - before);
        masses
    }

    /// Weights of the points of an axis in the expectation of a function that is linear between them and constant beyond them.
    pub(super) fn hats(&self, axis: &Axis) -> Vec<f64> {
        if axis.count == 1 {
            return vec![1.0];
        }
        let beyond: Vec<f64> = (0..axis.count).map(|i| self.beyond(axis.at(i))).collect();
        let rise = |i: usize| ((beyond[i] - beyond[i + 1]) / axis.step).clamp(0.0, 1.0);
        let mut weights = Vec::with_capacity(axis.count);
        let mut above = 1.0;
        for i in 0..axis.count - 1 {
            let next = rise(i).min(above);
            weights.push(above - next);
            above = next;
        }
        weights.push(above);
        weights
    }
}

/// Farther out, in standard deviations, probabilities are lost in the rounding of 1.
const NEVER: f64 = 9.0;

fn cdf(u: f64) -> f64 {
    match u.abs() > NEVER {
        true => f64::from(u > 0.0),
        false => normal_cdf(u),
    }
}

/// `E max(x + e, 0)`, `e ~ N(0, sd^2)`.
fn plus(x: f64, sd: f64) -> f64 {
    if sd <= 0.0 {
        return x.max(0.0);
    }
    let u = x / sd;
    match u.abs() > NEVER {
        true => x.max(0.0),
        false => sd * (normal_density(u) + u * normal_cdf(u)),
    }
}

/// The integral of [`plus`] up to `x`: `E max(x + e, 0)^2 / 2`.
fn half_square(x: f64, sd: f64) -> f64 {
    if sd <= 0.0 {
        return 0.5 * x.max(0.0).powi(2);
    }
    let u = x / sd;
    0.5 * sd * sd * ((u * u + 1.0) * normal_cdf(u) + u * normal_density(u))
}

/// Weights of the points at `-k..=k` steps in the average over N(0, sd^2) of a function that is linear between points a `step`
/// apart.
pub(super) fn kernel(sd: f64, step: f64) -> Vec<f64> {
    let reach = (9.0 * sd / step).ceil() as usize + 1;
    let axis = Axis::stepped(-(reach as f64) * step, step, 2 * reach + 1);
    Law::normal(0.0, sd).hats(&axis)
}

/// The most that points a `step` apart weigh under the density of N(x, sd^2) times the step: 1 and a little.
pub(super) fn crowding(sd: f64, step: f64) -> f64 {
    let density = |k: i32| normal_density(f64::from(k) * step / sd) * step / sd;
    let reach = (9.0 * sd / step).ceil().min(1e6) as i32;
    density(0) + 2.0 * (1..=reach).map(density).sum::<f64>()
}
