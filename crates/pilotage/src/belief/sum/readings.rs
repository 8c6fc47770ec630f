//! Readings that may come, evenly spread.

use super::component::Component;
use super::frame::{Frame, Inner, place, root, root_into};
use super::line::pieces;
use super::sensor::Sensor;
use super::{Sum, SumKeeping};
use crate::belief::full::Sensed;
use crate::belief::gaussian::{even_steps, normal_quantile};
use crate::belief::reading::Reading;
use crate::model::{ActionId, ModeId};

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

    /// Readings that are equally likely, of so many at most.
    fn numbers(
        &self,
        full: &Sum,
        action: ActionId,
        step: usize,
        most: usize,
    ) -> Vec<(f64, Sensed)> {
        let points = match self.dynamics.readings() {
            1 => FINER * most,
            _ => most,
        };
        let (mut drawn, missing) = self.draw(full, action, step, points.max(1));
        if self.dynamics.readings() == 1 {
            drawn = evenly(drawn, most);
        }
        let mode = |point: &Drawn| self.model.laws.modes_seen.then_some(point.mode as f64);
        let sensed = drawn.into_iter().map(|mut point| {
            let mode = mode(&point);
            point.values.extend(mode);
            (point.likely, Sensed::Values(point.values))
        });
        let mut readings: Vec<(f64, Sensed)> = sensed.collect();
        if missing > NEVER {
            readings.push((missing, Sensed::Nothing));
        }
        readings
    }

    /// Points of the sum, each with a point of the noise, and how likely it is that there is no reading. Shares of the sum, in the order of
    /// its components, are equal; within them and of the noise, numbers follow a lattice on which each of them is evenly spread.
    fn draw(&self, full: &Sum, action: ActionId, step: usize, points: usize) -> (Vec<Drawn>, f64) {
        let (n, m) = (self.dynamics.states(), self.dynamics.readings());
        let lattice = Lattice::new(points, n + m);
        let mut drawn = Vec::with_capacity(points);
        let (mut at, mut z) = (vec![0.0; n], vec![0.0; n + m]);
        let mut sensor = Sensor::new(self, action, step, Reading::Nothing);
        let mut spread = vec![0.0; m * m];
        let mut missing = 0.0;
        let share = 1.0 / points as f64;
        let (mut passed, mut k) = (0.0, 0);
        for (i, component) in full.components.iter().enumerate() {
            let before = passed;
            passed += component.weight;
            // Rounding may leave the last a little short.
            let last = i + 1 == full.components.len();
            let end = if last { 1.0 } else { passed };
            let mut own = None;
            while k < points && (k as f64 + 0.5) * share <= end {
                lattice.normals(k, &mut z);
                if component.weight >= share {
                    let within = ((k as f64 + 0.5) * share - before) / component.weight;
                    z[0] = normal_quantile(within.clamp(0.5 * share, 1.0 - 0.5 * share));
                }
                k += 1;
                let own = own.get_or_insert_with(|| root(&component.covariance, n));
                place(&component.mean, own, &z[..n], &mut at);
                if let Some(walls) = self.dynamics.walls() {
                    walls.confine(&mut at);
                }
                self.dynamics.round_within(&mut at);
                sensor.set_mode(component.mode);
                let present = self.dynamics.present(sensor.doing, &at);
                missing += share * (1.0 - present);
                if present <= 0.0 {
                    continue;
                }
                sensor.ask(&at);
                root_into(&sensor.noise, m, &mut spread);
                let mut values = vec![0.0; m];
                place(&sensor.values, &spread, &z[n..], &mut values);
                for (value, ends) in values.iter_mut().zip(self.dynamics.saturates()) {
                    // What is beyond an end is read as the end itself.
                    *value = value.max(ends.low).min(ends.high);
                }
                drawn.push(Drawn {
                    likely: share * present,
                    mode: component.mode,
                    values,
                });
            }
        }
        (drawn, missing)
    }

    /// Signals with their probabilities.
    fn signals(
        &self,
        full: &Sum,
        action: ActionId,
        step: usize,
        symbols: usize,
    ) -> Vec<(f64, Sensed)> {
        let likely = |sensed: &Sensed| -> f64 {
            let mut sensor = Sensor::new(self, action, step, sensed.reading());
            let each = full.components.iter().map(|component| {
                sensor.set_mode(component.mode);
                component.weight * self.evidence(component, &mut sensor)
            });
            each.sum()
        };
        let mut readings: Vec<(f64, Sensed)> = (0..symbols as u32)
            .map(Sensed::Symbol)
            .chain([Sensed::Nothing])
            .map(|sensed| (likely(&sensed), sensed))
            .filter(|(likely, _)| *likely > NEVER)
            .collect();
        // What quadratures leave out.
        let total: f64 = readings.iter().map(|(likely, _)| likely).sum();
        for (likely, _) in &mut readings {
            *likely /= total;
        }
        readings
    }

    /// How likely what was sensed is under a component.
    fn evidence(&self, component: &Component, sensor: &mut Sensor<'_>) -> f64 {
        if let (Reading::Nothing, Some(present)) = (sensor.reading, sensor.present()) {
            return 1.0 - present;
        }
        let frame = Frame::new(component);
        match frame.rank {
            0 => sensor.log_likelihood(&component.mean).exp(),
            1 => pieces(sensor, &frame, &Inner::standard(1), 1).0.exp(),
            _ => {
                let (mut at, mut sum) = (component.mean.clone(), 0.0);
                for (z, weight) in self.posterior[frame.rank - 1].iter() {
                    frame.place(z, &mut at);
                    sum += weight * sensor.log_likelihood(&at).exp();
                }
                sum
            }
        }
    }
}

/// A reading that was drawn.
struct Drawn {
    likely: f64,
    mode: ModeId,
    values: Vec<f64>,
}

/// So many times as many numbers are drawn as are wanted, where they can be put in order.
const FINER: usize = 5;

/// Readings of less probability do not come.
const NEVER: f64 = 1e-12;

/// Of readings of one number, so many that are equally likely: the medians of those in between.
fn evenly(mut drawn: Vec<Drawn>, most: usize) -> Vec<Drawn> {
    drawn.sort_by(|a, b| {
        a.mode
            .cmp(&b.mode)
            .then(a.values[0].total_cmp(&b.values[0]))
    });
    let total: f64 = drawn.iter().map(|point| point.likely).sum();
    let share = total / most as f64;
    let (mut kept, mut passed) = (Vec::with_capacity(most), 0.0);
    for point in drawn {
        passed += point.likely;
        if kept.len() < most && passed >= (kept.len() as f64 + 0.5) * share {
            kept.push(Drawn {
                likely: share,
                ..point
            });
        }
    }
    // Where points are few and unlike, one may stand for several.
    let found = kept.len() as f64;
    for point in &mut kept {
        point.likely = total / found;
    }
    kept
}

/// Points in a cube, each coordinate of which takes every `(k + 1/2) / points` once: a lattice near that of [`even_steps`].
struct Lattice {
    points: usize,
    strides: Vec<usize>,
}

impl Lattice {
    fn new(points: usize, dim: usize) -> Self {
        let stride = |step: &f64| {
            let ideal = (points as f64 * step).round() as usize;
            let near = (0..=points).flat_map(|off| [ideal + off, ideal.saturating_sub(off)]);
            let mut coprime = near.filter(|stride| *stride > 0 && gcd(*stride, points) == 1);
            coprime.next().unwrap_or(1)
        };
        Self {
            points,
            strides: even_steps(dim).iter().map(stride).collect(),
        }
    }

    /// Writes the normal quantiles of a point.
    fn normals(&self, k: usize, z: &mut [f64]) {
        for (value, stride) in z.iter_mut().zip(&self.strides) {
            // Off the first point, at which all coordinates are alike.
            let cell = ((k + self.points / 3) * stride) % self.points;
            *value = normal_quantile((cell as f64 + 0.5) / self.points as f64);
        }
    }
}

fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::Lattice;

    #[test]
    fn a_lattice_takes_every_value_of_every_coordinate_once() {
        for points in [1, 2, 20, 40, 97] {
            let lattice = Lattice::new(points, 3);
            for i in 0..3 {
                let mut seen: Vec<f64> = (0..points)
                    .map(|k| {
                        let mut z = [0.0; 3];
                        lattice.normals(k, &mut z);
                        z[i]
                    })
                    .collect();
                seen.sort_by(f64::total_cmp);
                seen.dedup();
                assert_eq!(seen.len(), points);
            }
        }
    }
}
