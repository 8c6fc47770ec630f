//! Cells as other things: evenly spread readings, moments, Gaussians, and beliefs moved elsewhere.

use super::grid::{Part, Ramp};
use super::sensing::Heard;
use super::{Cells, CellsKeeping};
use crate::belief::full::{Moments, Sensed};
use crate::belief::gaussian::normal_quantile;
use crate::model::{ActionId, Interval, VariableKind, wrapped};

impl CellsKeeping {
    /// Readings that may come, with probabilities that sum to 1.
    pub(super) fn possible(
        &self,
        full: &Cells,
        action: ActionId,
        most: usize,
    ) -> Vec<(f64, Sensed)> {
        let count = self.cells();
        let table = |state: usize| self.sensor.table(action, state / count);
        let met: Vec<(usize, f64)> = full
            .mass
            .iter()
            .enumerate()
            .filter(|(_, mass)| **mass > 0.0)
            .map(|(state, mass)| (state, mass * table(state).present[state % count]))
            .collect();
        let comes: f64 = met.iter().map(|(_, mass)| mass).sum();
        let mut possible = if self.discrete {
            let signals = 0..table(0).signals.len();
            let likely = |signal: usize| {
                let of = |&(state, mass): &(usize, f64)| {
                    mass * table(state).signals[signal][state % count]
                };
                met.iter().map(of).sum::<f64>()
            };
            let signals = signals.map(|signal| (likely(signal), Sensed::Symbol(signal as u32)));
            signals.collect()
        } else {
            self.spread_readings(&met, comes, action, most.max(1))
        };
        if comes < 1.0 - 1e-12 {
            possible.push((1.0 - comes, Sensed::Nothing));
        }
        possible.retain(|(likely, _)| *likely > 0.0);
        let sum: f64 = possible.iter().map(|(likely, _)| likely).sum();
        possible.iter_mut().for_each(|(likely, _)| *likely /= sum);
        possible
    }

    /// Numbers, evenly spread and alike likely: along the first axis of the lattice one goes through the cells in order, so that each has
    /// its share; along the others through the noise.
    fn spread_readings(
        &self,
        met: &[(usize, f64)],
        comes: f64,
        action: ActionId,
        most: usize,
    ) -> Vec<(f64, Sensed)> {
        let mut readings = Vec::with_capacity(most);
        let (mut next, mut passed) = (0, 0.0);
        for k in 0..most {
            let place = (k as f64 + 0.5) / most as f64 * comes;
            while next + 1 < met.len() && passed + met[next].1 <= place {
                passed += met[next].1;
                next += 1;
            }
            let Some(&(state, mass)) = met.get(next) else {
                break;
            };
            let share = ((place - passed) / mass).clamp(0.0, 1.0 - f64::EPSILON);
            let values = self.reading_in(action, state, share, k);
            readings.push((comes / most as f64, Sensed::Values(values)));
        }
        readings
    }

    /// The `k`-th of some readings, in a state and as far through it as `share` says.
    fn reading_in(&self, action: ActionId, state: usize, share: f64, k: usize) -> Vec<f64> {
        let (mode, cell) = (state / self.cells(), state % self.cells());
        let parts = &self.sensor.table(action, mode).heard[cell];
        let heard = &parts[(share * parts.len() as f64) as usize];
        let mut values = heard.drawn(k, self.sensor.steps());
        for (value, ends) in values.iter_mut().zip(self.sensor.ends()) {
            *value = value.clamp(ends.low, ends.high);
        }
        if self.sensor.sees_mode() {
            values.push(mode as f64);
        }
        values
    }

    pub(super) fn write_moments(&self, full: &Cells, moments: &mut Moments) {
        let (n, count) = (self.grid.dim(), self.cells());
        let of_modes = full.mass.chunks_exact(count);
        moments.weights.clear();
        moments
            .weights
            .extend(of_modes.map(|mass| mass.iter().sum::<f64>()));
        let met = || {
            let states = full.mass.iter().enumerate();
            let met = states.filter(|(_, mass)| **mass > 0.0);
            met.map(|(state, mass)| (self.grid.whole(state % count), *mass))
        };
        let mut mean = [0.0; 2];
        for (i, axis) in self.grid.axes.iter().enumerate() {
            mean[i] = match axis.kind {
                VariableKind::Angle => {
                    let along = |part: fn(f64) -> f64| -> f64 {
                        met().map(|(at, mass)| mass * part(at.middle[i])).sum()
                    };
                    along(f64::sin).atan2(along(f64::cos))
                }
                _ => met().map(|(at, mass)| mass * at.middle[i]).sum(),
            };
        }
        let apart = |at: f64, i: usize| match self.grid.axes[i].kind {
            VariableKind::Angle => wrapped(at - mean[i]),
            _ => at - mean[i],
        };
        let shared = |i: usize, j: usize| -> f64 {
            let of = |(at, mass): (Part, f64)| {
                // Of a state only the cell is known.
                let within = match i == j {
                    true => at.half[i] * at.half[i] / 3.0,
                    false => 0.0,
                };
                mass * (apart(at.middle[i], i) * apart(at.middle[j], j) + within)
            };
            met().map(of).sum()
        };
        let entries = (0..n).flat_map(|i| (0..n).map(move |j| (i, j)));
        let covariance: Vec<f64> = entries.map(|(i, j)| shared(i, j)).collect();
        moments.mean.clear();
        moments.mean.extend_from_slice(&mean[..n]);
        moments.covariance = covariance;
    }

    /// One Gaussian a mode, over the cells in which a state can be.
    pub(super) fn gaussian(&self, moments: &Moments) -> Cells {
        let n = self.grid.dim();
        let variance = |i: usize| moments.covariance[i * (n + 1)];
        let ramp = |i: usize| Ramp::gaussian(moments.mean[i], variance(i));
        let ramps: Vec<Ramp> = (0..n).map(ramp).collect();
        let everywhere = vec![Interval::ALL; n];
        let mut masses = vec![0.0; self.cells()];
        let mut put = |indices, mass| masses[self.grid.at(indices)] += mass;
        self.grid.spread(
            &ramps,
            &moments.covariance,
            &everywhere,
            &self.grid.own_ranges(),
            &mut put,
        );
        self.keep_off(&mut masses, &moments.mean);
        let weights = moments.weights.iter();
        let mass = weights.flat_map(|weight| masses.iter().map(move |mass| weight * mass));
        self.belief(mass.collect())
    }

    /// Takes masses away from where no state can be; if nothing is left, the free cell that is nearest to the mean has it all.
    fn keep_off(&self, masses: &mut [f64], mean: &[f64]) {
        for (mass, blocked) in masses.iter_mut().zip(&self.blocked) {
            if *blocked {
                *mass = 0.0;
            }
        }
        if masses.iter().any(|mass| *mass > 0.0) {
            return;
        }
        let apart = |cell: &usize| -> f64 {
            let at = self.grid.middle(*cell);
            mean.iter().zip(at).map(|(a, b)| (a - b).powi(2)).sum()
        };
        let free = (0..masses.len()).filter(|cell| !self.blocked[*cell]);
        if let Some(nearest) = free.min_by(|a, b| apart(a).total_cmp(&apart(b))) {
            masses[nearest] = 1.0;
        }
    }

    /// The same belief with its mean elsewhere. What would lie beyond the cells is at the border, and nothing is where no state can be.
    pub(super) fn shifted(&self, full: &Cells, mean: &[f64]) -> Cells {
        let (n, count) = (self.grid.dim(), self.cells());
        let mut now = Moments::default();
        self.write_moments(full, &mut now);
        let everywhere = [Interval::ALL; 2];
        let ranges = self.grid.own_ranges();
        let mut moved = vec![0.0; full.mass.len()];
        let met = full.mass.iter().enumerate();
        for (state, mass) in met.filter(|(_, mass)| **mass > 0.0) {
            let part = self.grid.whole(state % count);
            let of_mode = &mut moved[state / count * count..][..count];
            let ramp = |i: usize| {
                let by = mean[i] - now.mean[i];
                let by = if self.grid.axes[i].is_integer() {
                    by.round()
                } else {
                    by
                };
                let middle = part.middle[i] + by;
                Ramp::new(middle - part.half[i], middle + part.half[i], 0.0)
            };
            let ramps: Vec<Ramp> = (0..n).map(ramp).collect();
            let mut put = |indices, share| of_mode[self.grid.at(indices)] += mass * share;
            self.grid
                .spread(&ramps, &[0.0; 4], &everywhere[..n], &ranges, &mut put);
        }
        for of_mode in moved.chunks_exact_mut(count) {
            let weight: f64 = of_mode.iter().sum();
            if weight > 0.0 {
                self.keep_off(of_mode, mean);
                // Modes stay as likely as they were.
                let kept: f64 = of_mode.iter().sum();
                of_mode.iter_mut().for_each(|mass| *mass *= weight / kept);
            }
        }
        self.belief(moved)
    }
}

impl Heard {
    /// The `k`-th of readings that are spread as this Gaussian is, by the steps of an even lattice.
    fn drawn(&self, k: usize, steps: &[f64]) -> Vec<f64> {
        let m = self.mean.len();
        let normal = |step: &f64| normal_quantile((0.5 + (k as f64 + 1.0) * step).fract());
        let normals: Vec<f64> = steps[..m].iter().map(normal).collect();
        let value = |i: usize| {
            let row = &self.factor[i * m..][..=i];
            let noise: f64 = row.iter().zip(&normals).map(|(l, z)| l * z).sum();
            self.mean[i] + noise
        };
        (0..m).map(value).collect()
    }
}
