//! One Gaussian of a sum: what is cut off it, what moves it, how it is halved.

use nalgebra::DMatrix;

use crate::belief::gaussian::{
    interval_probability, normal_cdf, normal_density, region_probability,
};
use crate::model::{Interval, ModeId, Region};

/// A weighted Gaussian in a mode. Covariances may be singular: a point has none.
#[derive(Debug, Clone, PartialEq)]
pub struct Component {
    /// Probability; those of a sum add up to 1.
    pub weight: f64,
    /// Mode.
    pub mode: ModeId,
    /// Mean, length `n`.
    pub mean: Vec<f64>,
    /// Covariance, row by row, `n x n`.
    pub covariance: Vec<f64>,
}

/// A bound is run against by at least this share, or by nobody.
const RARE: f64 = 1e-3;

/// An end of an interval so many standard deviations away cuts a Gaussian in the middle.
const NEAR: f64 = 2.0;

/// Less likely parts are left out.
const NOTHING: f64 = 1e-9;

impl Component {
    /// Number of state variables.
    pub(super) fn dim(&self) -> usize {
        self.mean.len()
    }

    pub(super) fn variance(&self, variable: usize) -> f64 {
        self.covariance[variable * self.dim() + variable]
    }

    /// Probability that it lies in a region.
    pub(super) fn probability(&self, region: &Region) -> f64 {
        if let [(variable, side)] = region.sides[..] {
            return interval_probability(self.mean[variable], self.variance(variable), side);
        }
        match region.sides.is_empty() {
            true => 1.0,
            false => {
                let n = self.dim();
                let covariance = DMatrix::from_row_slice(n, n, &self.covariance);
                region_probability(&self.mean, &covariance, region)
            }
        }
    }

    /// The parts of it inside and outside a region, each with the moments of what is cut off there. One side of the region is cut after the
    /// other, what is left of other variables by regression.
    pub(super) fn cut(self, region: &Region) -> (Option<Self>, Vec<Self>) {
        let mut outside = Vec::new();
        let whole = (region.sides.len() > 1).then(|| self.clone());
        let mut inside = self;
        for &(variable, side) in &region.sides {
            let (within, beyond) = inside.cut_side(variable, side);
            outside.extend(beyond);
            match within {
                Some(within) => inside = within,
                None => return (None, outside),
            }
        }
        if let Some(whole) = whole {
            // What is left of a Gaussian is none, and the next side cuts off a little too much or too little of it.
            let exact = whole.weight * whole.probability(region);
            let beyond: f64 = outside.iter().map(|part| part.weight).sum();
            inside.weight = exact;
            for part in &mut outside {
                part.weight *= (whole.weight - exact) / beyond;
            }
        }
        (Some(inside), outside)
    }

    /// The parts inside and outside an interval of one variable.
    pub(super) fn cut_side(self, variable: usize, side: Interval) -> (Option<Self>, Vec<Self>) {
        if self.variance(variable) <= 0.0 {
            return match side.contains(self.mean[variable]) {
                true => (Some(self), Vec::new()),
                false => (None, vec![self]),
            };
        }
        let below = Interval::new(f64::NEG_INFINITY, side.low);
        let above = Interval::new(side.high, f64::INFINITY);
        let inside = self.within(variable, side);
        let outside = [below, above].into_iter();
        let outside = outside
            .filter_map(|part| self.within(variable, part))
            .collect();
        (inside, outside)
    }

    /// What of it lies in an interval of a variable; `None` if hardly any does.
    fn within(&self, variable: usize, side: Interval) -> Option<Self> {
        if side.low >= side.high {
            return None;
        }
        let variance = self.variance(variable);
        let sd = variance.sqrt();
        let low = (side.low - self.mean[variable]) / sd;
        let high = (side.high - self.mean[variable]) / sd;
        let mass = match low > 0.0 {
            true => normal_cdf(-low) - normal_cdf(-high),
            false => normal_cdf(high) - normal_cdf(low),
        };
        if mass <= NOTHING {
            return None;
        }
        if mass >= 1.0 - NOTHING {
            return Some(self.clone());
        }
        let density = |x: f64| {
            if x.is_finite() {
                normal_density(x)
            } else {
                0.0
            }
        };
        let moment = |x: f64| {
            if x.is_finite() {
                x * normal_density(x)
            } else {
                0.0
            }
        };
        let shift = (density(low) - density(high)) / mass;
        let left = (1.0 + (moment(low) - moment(high)) / mass - shift * shift).clamp(0.0, 1.0);
        let mut part = self.clone();
        part.weight *= mass;
        part.condition(variable, self.mean[variable] + sd * shift, left * variance);
        part.mean[variable] = part.mean[variable].clamp(side.low, side.high);
        Some(part)
    }

    /// Gives a variable another mean and variance, and the others what follows from that by regression.
    pub(super) fn condition(&mut self, variable: usize, mean: f64, variance: f64) {
        let n = self.dim();
        let before = self.variance(variable);
        if before <= 0.0 {
            self.mean[variable] = mean;
            return;
        }
        let gains: Vec<f64> = (0..n)
            .map(|i| self.covariance[i * n + variable] / before)
            .collect();
        let (moved, more) = (mean - self.mean[variable], variance - before);
        for i in 0..n {
            self.mean[i] += gains[i] * moved;
            for j in 0..n {
                self.covariance[i * n + j] += gains[i] * gains[j] * more;
            }
        }
        for i in 0..n {
            self.covariance[i * n + i] = self.covariance[i * n + i].max(0.0);
        }
    }

    /// What of it stays inside the bounds of a variable, and what has run against them: that sits at the bound.
    pub(super) fn stopped(self, variable: usize, side: Interval) -> Vec<Self> {
        if side.low == f64::NEG_INFINITY && side.high == f64::INFINITY {
            return vec![self];
        }
        let mut parts = Vec::new();
        for part in self.finer_at(variable, side) {
            let whole = part.weight;
            let (mut inside, mut beyond) = part.cut_side(variable, side);
            // What hardly ever happens is left out, and its weight kept.
            beyond.retain(|part| part.weight > RARE * whole || inside.is_none());
            if let Some(inside) = &mut inside {
                inside.weight = whole - beyond.iter().map(|part| part.weight).sum::<f64>();
            }
            parts.extend(inside);
            for mut part in beyond {
                let at = side.clamp(part.mean[variable]);
                part.sit(variable, at);
                parts.push(part);
            }
        }
        parts
    }

    /// The same in three parts where an interval cuts it in the middle: what is left of a Gaussian there is none, and narrower ones keep
    /// more of its shape.
    fn finer_at(self, variable: usize, side: Interval) -> Vec<Self> {
        let sd = self.variance(variable).sqrt();
        let near = |end: f64| (end - self.mean[variable]).abs() < NEAR * sd;
        match sd > 0.0 && (near(side.low) || near(side.high)) {
            true => self.split(variable).into(),
            false => vec![self],
        }
    }

    /// Puts a variable to a value, whatever the others are.
    fn sit(&mut self, variable: usize, at: f64) {
        let n = self.dim();
        self.mean[variable] = at;
        for i in 0..n {
            self.covariance[variable * n + i] = 0.0;
            self.covariance[i * n + variable] = 0.0;
        }
    }

    /// Three narrower ones with the same moments together, side by side along a variable and what goes with it.
    pub(super) fn split(self, variable: usize) -> [Self; 3] {
        // Of the standard normal: outer weights, distance of the outer means, and variance that is left.
        const OUTER: f64 = 0.2252;
        const APART: f64 = 1.0575;
        let left = 1.0 - 2.0 * OUTER * APART * APART;
        let variance = self.variance(variable);
        let sd = variance.sqrt();
        let at = |steps: f64, share: f64| {
            let mut part = self.clone();
            part.weight *= share;
            part.condition(
                variable,
                self.mean[variable] + steps * APART * sd,
                left * variance,
            );
            part
        };
        [at(-1.0, OUTER), at(0.0, 1.0 - 2.0 * OUTER), at(1.0, OUTER)]
    }
}
