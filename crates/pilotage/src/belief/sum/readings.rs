//! Readings that may come, evenly spread.

use super::component::{place, root};
use super::{Sum, SumKeeping};
use crate::belief::full::Sensed;
use crate::belief::gaussian::normal_quantile;
use crate::model::ActionId;

/// Bases of the Halton sequence, one for each number that is drawn.
const PRIMES: [u64; 12] = [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37];

impl SumKeeping {
    pub(super) fn spread_readings(
        &self,
        full: &Sum,
        action: ActionId,
        step: usize,
        most: usize,
    ) -> Vec<(f64, Sensed)> {
        match self.dynamics.symbols() {
            0 => self.numbers(full, action, step, most),
            symbols => self.signals(full, action, step, symbols),
        }
    }

    /// Points of the sum one after the other, each with a point of the noise: states and noises follow a Halton sequence.
    fn numbers(
        &self,
        full: &Sum,
        action: ActionId,
        step: usize,
        most: usize,
    ) -> Vec<(f64, Sensed)> {
        let (n, m) = (self.dynamics.states(), self.dynamics.readings());
        let mut readings = Vec::with_capacity(most + 1);
        let (mut at, mut z) = (vec![0.0; n], vec![0.0; n + m]);
        let mut covariance = vec![0.0; m * m];
        let mut missing = 0.0;
        let mut components = full.components.iter();
        let mut current = components.next();
        let mut passed = current.map_or(0.0, |component| component.weight);
        let mut roots = current.map(|component| root(&component.covariance, n));
        let share = 1.0 / most as f64;
        for k in 0..most {
            let quantile = (k as f64 + 0.5) * share;
            while quantile > passed {
                let Some(next) = components.next() else { break };
                passed += next.weight;
                current = Some(next);
                roots = Some(root(&next.covariance, n));
            }
            let (Some(component), Some(root_)) = (current, &roots) else {
                break;
            };
            for (i, value) in z.iter_mut().enumerate() {
                *value = normal_quantile(halton(k as u64 + 1, PRIMES[i % PRIMES.len()]));
            }
            place(&component.mean, root_, &z[..n], &mut at);
            if let Some(walls) = self.dynamics.walls() {
                walls.confine(&mut at);
            }
            self.dynamics.round_within(&mut at);
            let doing = self.doing(component.mode, action, step);
            let present = self.dynamics.present(doing, &at);
            missing += share * (1.0 - present);
            if present <= 0.0 {
                continue;
            }
            let mut values = vec![0.0; m];
            self.dynamics.observation(doing, &at, &mut values);
            self.dynamics.observation_noise(doing, &at, &mut covariance);
            let spread = root(&covariance, m);
            let centre = values.clone();
            place(&centre, &spread, &z[n..], &mut values);
            for (value, ends) in values.iter_mut().zip(self.dynamics.saturates()) {
                *value = value.clamp(ends.low, ends.high);
            }
            if self.model.laws.modes_seen {
                values.push(component.mode as f64);
            }
            readings.push((share * present, Sensed::Values(values)));
        }
        if missing > 1e-12 {
            readings.push((missing, Sensed::Nothing));
        }
        readings
    }

    fn signals(
        &self,
        full: &Sum,
        action: ActionId,
        step: usize,
        symbols: usize,
    ) -> Vec<(f64, Sensed)> {
        let n = self.dynamics.states();
        let mut sums = vec![0.0; symbols];
        let mut likely = vec![0.0; symbols];
        let mut at = vec![0.0; n];
        let mut missing = 0.0;
        for component in &full.components {
            let doing = self.doing(component.mode, action, step);
            let root = root(&component.covariance, n);
            for (z, weight) in self.fine.iter() {
                place(&component.mean, &root, z, &mut at);
                let present = self.dynamics.present(doing, &at);
                self.dynamics.symbol_probabilities(doing, &at, &mut likely);
                let share = component.weight * weight;
                missing += share * (1.0 - present);
                for (sum, likely) in sums.iter_mut().zip(&likely) {
                    *sum += share * present * likely;
                }
            }
        }
        let heard = sums.into_iter().enumerate();
        let mut readings: Vec<(f64, Sensed)> = heard
            .filter(|(_, likely)| *likely > 0.0)
            .map(|(symbol, likely)| (likely, Sensed::Symbol(symbol as u32)))
            .collect();
        if missing > 1e-12 {
            readings.push((missing, Sensed::Nothing));
        }
        readings
    }
}

/// The `index`-th number of the van der Corput sequence of a base, in `(0, 1)`.
fn halton(mut index: u64, base: u64) -> f64 {
    let (mut value, mut digit) = (0.0, 1.0);
    while index > 0 {
        digit /= base as f64;
        value += digit * (index % base) as f64;
        index /= base;
    }
    value
}
