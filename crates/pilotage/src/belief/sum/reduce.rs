//! Fewer Gaussians: the hopeless are dropped, those most alike merged so that moments stay.

use smallvec::smallvec;

use super::component::Component;
use super::frame::{Few, SAFE};
use crate::model::{VariableKind, wrapped};

/// Components of less weight are dropped.
const HOPELESS: f64 = 1e-6;

/// Components are merged where that costs less than this, in nats times weight.
const ALIKE: f64 = 1e-5;

/// What tells components apart.
#[derive(Debug, Clone)]
pub(super) struct Likeness {
    /// Standard deviations that count as none, length `n`.
    floors: Vec<f64>,
    /// Which variables are angles, length `n`.
    angles: Vec<bool>,
}

impl Likeness {
    pub(super) fn new(floors: Vec<f64>, kinds: &[VariableKind]) -> Self {
        let angle = |kind: &VariableKind| *kind == VariableKind::Angle;
        Self {
            floors,
            angles: kinds.iter().map(angle).collect(),
        }
    }

    /// How far a value of a variable is from another: for angles, the short way.
    pub(super) fn apart(&self, variable: usize, from: f64, to: f64) -> f64 {
        match self.angles[variable] {
            true => wrapped(to - from),
            false => to - from,
        }
    }

    /// Makes a sum of at most `most` components, its weights summing to 1.
    ///
    /// What a merger costs is bounded by how much it raises the entropy (A. Runnalls, 2007).
    pub(super) fn reduce(&self, components: &mut Vec<Component>, most: usize) {
        normalise(components);
        let heaviest = components
            .iter()
            .fold(0.0, |most: f64, c| most.max(c.weight));
        components.retain(|component| component.weight >= HOPELESS.min(heaviest));
        components.sort_by(|a, b| {
            let place = a.mean[0].total_cmp(&b.mean[0]);
            a.mode.cmp(&b.mode).then(place)
        });
        let sizes = components
            .iter()
            .map(|c| self.size(&c.covariance))
            .collect();
        let mut pairs = Pairs {
            likeness: self,
            sizes,
            best: Vec::with_capacity(components.len()),
        };
        for i in 0..components.len() {
            pairs.best.push(pairs.nearest(components, i));
        }
        while let Some((cost, one, other)) = pairs.cheapest() {
            if components.len() <= most && cost >= ALIKE {
                break;
            }
            pairs.merge(components, one, other);
        }
        normalise(components);
    }

    /// The same for those from a place on, whose weights keep their sum; few of them stay as they are.
    pub(super) fn reduce_from(&self, components: &mut Vec<Component>, first: usize, most: usize) {
        if components.len() <= first + most {
            return;
        }
        let mut last = components.split_off(first);
        let weight: f64 = last.iter().map(|component| component.weight).sum();
        self.reduce(&mut last, most);
        for component in &mut last {
            component.weight *= weight;
        }
        components.extend(last);
    }

    /// Makes components of one mode one.
    pub(super) fn join(&self, components: &mut Vec<Component>) {
        let Some((first, others)) = components.split_first_mut() else {
            return;
        };
        for other in others {
            self.merge(first, other);
        }
        components.truncate(1);
    }

    /// Takes another component in, so that weight, mean and covariance are those of both.
    pub(super) fn merge(&self, one: &mut Component, other: &Component) {
        let n = one.dim();
        let total = one.weight + other.weight;
        if total <= 0.0 {
            return;
        }
        let (a, b) = (one.weight / total, other.weight / total);
        let apart = |one: &Component, i| self.apart(i, one.mean[i], other.mean[i]);
        for i in 0..n {
            for j in 0..n {
                let k = i * n + j;
                let between = a * b * apart(one, i) * apart(one, j);
                one.covariance[k] = a * one.covariance[k] + b * other.covariance[k] + between;
            }
        }
        for i in 0..n {
            one.mean[i] += b * apart(one, i);
            if self.angles[i] {
                one.mean[i] = wrapped(one.mean[i]);
            }
        }
        one.weight = total;
    }

    /// How much merging raises the entropy at most, if that is less than `below`; `sizes` are those of both.
    fn cost(
        &self,
        one: &Component,
        other: &Component,
        sizes: (f64, f64),
        below: f64,
    ) -> Option<f64> {
        let total = one.weight + other.weight;
        let (a, b) = (one.weight / total, other.weight / total);
        let apart = |i: usize| self.apart(i, one.mean[i], other.mean[i]);
        let entry = |k: usize, between: f64| {
            a * one.covariance[k] + b * other.covariance[k] + a * b * between
        };
        let floor = |i: usize| self.floors[i] * self.floors[i];
        let cost =
            |merged: f64| 0.5 * (total * merged - one.weight * sizes.0 - other.weight * sizes.1);
        let of = |determinant: f64| {
            // Most pairs are far from the best, and a logarithm costs more than all the rest.
            let may = cost(logarithm_at_least(determinant)) < below;
            may.then(|| cost(determinant.ln()))
        };
        let cost = match self.floors.len() {
            1 => of(entry(0, apart(0) * apart(0)) + floor(0)),
            2 => {
                let (x, y) = (apart(0), apart(1));
                let (xx, yy) = (entry(0, x * x) + floor(0), entry(3, y * y) + floor(1));
                let xy = entry(1, x * y);
                of((xx * yy - xy * xy).max(f64::MIN_POSITIVE))
            }
            n => {
                let apart: Few = (0..n).map(apart).collect();
                let pivots = self.pivots(|i, j| entry(i * n + j, apart[i] * apart[j]));
                let determinant: f64 = pivots.iter().product();
                match SAFE.contains(&determinant) {
                    true => of(determinant),
                    false => Some(cost(sum_of_logarithms(&pivots))),
                }
            }
        };
        cost.filter(|cost| *cost < below)
    }

    /// Logarithm of the determinant of a covariance, with the floors added.
    fn size(&self, covariance: &[f64]) -> f64 {
        let n = self.floors.len();
        let floor = |i: usize| self.floors[i] * self.floors[i];
        match n {
            1 => (covariance[0] + floor(0)).ln(),
            2 => {
                let (x, y) = (covariance[0] + floor(0), covariance[3] + floor(1));
                let determinant = x * y - covariance[1] * covariance[1];
                determinant.max(f64::MIN_POSITIVE).ln()
            }
            _ => {
                let pivots = self.pivots(|i, j| covariance[i * n + j]);
                let determinant: f64 = pivots.iter().product();
                match SAFE.contains(&determinant) {
                    true => determinant.ln(),
                    false => sum_of_logarithms(&pivots),
                }
            }
        }
    }

    /// Variances of each variable given those before it, of which the determinant of a covariance is the product, with the floors
    /// added; none is less than its floor.
    fn pivots(&self, covariance: impl Fn(usize, usize) -> f64) -> Few {
        // Loops whose lengths are known are unrolled.
        match self.floors.len() {
            3 => self.pivots_of(3, covariance),
            n => self.pivots_of(n, covariance),
        }
    }

    #[inline(always)]
    fn pivots_of(&self, n: usize, covariance: impl Fn(usize, usize) -> f64) -> Few {
        let mut pivots: Few = smallvec![0.0; n];
        // Row by row: what a variable shares with each before it, a share of that one's pivot.
        let mut shares: Few = smallvec![0.0; n * n];
        for i in 0..n {
            for j in 0..i {
                let before = (0..j).map(|k| shares[i * n + k] * shares[j * n + k] * pivots[k]);
                shares[i * n + j] = (covariance(i, j) - before.sum::<f64>()) / pivots[j];
            }
            let before = (0..i).map(|k| shares[i * n + k] * shares[i * n + k] * pivots[k]);
            let floor = (self.floors[i] * self.floors[i]).max(f64::MIN_POSITIVE);
            pivots[i] = (covariance(i, i) + floor - before.sum::<f64>()).max(floor);
        }
        pivots
    }
}

/// Which component costs least to be merged with which later one, kept up to date from merger to merger.
struct Pairs<'a> {
    likeness: &'a Likeness,
    sizes: Vec<f64>,
    /// For every component, the least cost and with whom; infinite where there is nobody.
    best: Vec<(f64, usize)>,
}

impl Pairs<'_> {
    fn cheapest(&self) -> Option<(f64, usize, usize)> {
        let all = self.best.iter().enumerate();
        let all = all.map(|(i, (cost, other))| (*cost, i, *other));
        all.min_by(|a, b| a.0.total_cmp(&b.0))
            .filter(|(cost, ..)| cost.is_finite())
    }

    /// The partner of a component among those after it. Along a line only the next can be most alike.
    fn nearest(&self, components: &[Component], i: usize) -> (f64, usize) {
        let after = match self.on_a_line() {
            true => (i + 2).min(components.len()),
            false => components.len(),
        };
        let mut best = (f64::INFINITY, i);
        for j in i + 1..after {
            if components[j].mode != components[i].mode {
                break;
            }
            if let Some(cost) = self.cost(components, (i, j), best.0) {
                best = (cost, j);
            }
        }
        best
    }

    fn cost(&self, components: &[Component], (i, j): (usize, usize), below: f64) -> Option<f64> {
        let sizes = (self.sizes[i], self.sizes[j]);
        self.likeness
            .cost(&components[i], &components[j], sizes, below)
    }

    fn on_a_line(&self) -> bool {
        self.likeness.floors.len() == 1
    }

    /// Merges a component with a later one, which is gone afterwards.
    fn merge(&mut self, components: &mut Vec<Component>, one: usize, other: usize) {
        let taken = components.remove(other);
        self.sizes.remove(other);
        self.best.remove(other);
        self.likeness.merge(&mut components[one], &taken);
        self.sizes[one] = self.likeness.size(&components[one].covariance);
        for i in 0..components.len() {
            let (cost, with) = self.best[i];
            let next = self.on_a_line() && i + 1 == other;
            if i == one || next || cost.is_finite() && (with == one || with == other) {
                self.best[i] = self.nearest(components, i);
                continue;
            }
            if with > other {
                self.best[i].1 -= 1;
            }
            // To those before it, what has grown may have come nearer.
            let may = i < one && !self.on_a_line() && components[i].mode == components[one].mode;
            if may && let Some(cost) = self.cost(components, (i, one), self.best[i].0) {
                self.best[i] = (cost, one);
            }
        }
    }
}

/// Logarithm of a product that is too large or too small for a number.
fn sum_of_logarithms(factors: &[f64]) -> f64 {
    factors.iter().map(|factor| factor.ln()).sum()
}

/// A number that the natural logarithm of a positive one exceeds by at most 0.06: between powers of two the logarithm lies above its chord.
fn logarithm_at_least(x: f64) -> f64 {
    const MANTISSA: f64 = (1_u64 << 52) as f64;
    const BIAS: f64 = 1023.0;
    (x.to_bits() as f64 / MANTISSA - BIAS) * std::f64::consts::LN_2
}

/// Makes weights sum to 1.
pub(super) fn normalise(components: &mut [Component]) {
    let total: f64 = components.iter().map(|component| component.weight).sum();
    if total > 0.0 {
        for component in components {
            component.weight /= total;
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::{Likeness, logarithm_at_least};
    use crate::model::VariableKind;

    proptest! {
        #[test]
        fn a_size_is_that_of_the_root(n in 3_usize..6, numbers in prop::collection::vec(-2.0_f64..2.0, 25), scale in -60..60) {
            let scale = 10.0_f64.powi(scale);
            // Lower triangular, with a diagonal that is surely positive.
            let root = |i: usize, j: usize| match i.cmp(&j) {
                std::cmp::Ordering::Less => 0.0,
                std::cmp::Ordering::Equal => scale * (0.1 + numbers[i * n + i].abs()),
                std::cmp::Ordering::Greater => scale * numbers[i * n + j],
            };
            let entry = |k: usize| (0..n).map(|j| root(k / n, j) * root(k % n, j)).sum();
            let covariance: Vec<f64> = (0..n * n).map(entry).collect();
            let likeness = Likeness::new(vec![0.0; n], &vec![VariableKind::Real; n]);
            let expected: f64 = (0..n).map(|i| 2.0 * root(i, i).ln()).sum();
            prop_assert!((likeness.size(&covariance) - expected).abs() < 1e-8);
        }

        #[test]
        fn the_chord_lies_below_the_logarithm(exponent in -600.0_f64..600.0) {
            let x = exponent.exp();
            let gap = x.ln() - logarithm_at_least(x);
            prop_assert!((-1e-12..0.06).contains(&gap), "{gap} at {x}");
        }
    }
}
