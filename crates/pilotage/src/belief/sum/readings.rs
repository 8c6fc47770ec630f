//! Readings that may come, evenly spread.

use super::component::Component;
use super::frame::{Frame, Inner, place, root, root_into};
use super::line::pieces;
use super::sensor::Sensor;
use super::{Sum, SumKeeping};
use crate::belief::full::Sensed;
use crate::belief::gaussian::{even_steps, normal_quantile};
use crate::belief::reading::Reading;
use crate::model::ActionId;

impl SumKeeping {
    pub(super) fn spread_readings(
        &self,
        full: &Sum,
        action: ActionId,
        step: usize,
        most: usize,
    ) -> Vec<(f64, Sensed)> {
        let mut readings = match self.dynamics.symbols() {
            0 => self.numbers(full, action, step, most),
            symbols => self.signals(full, action, step, symbols),
        };
        // What modes that are not heard, and quadratures, leave out.
        let total: f64 = readings.iter().map(|(likely, _)| likely).sum();
        for (likely, _) in &mut readings {
            *likely /= total;
        }
        readings
    }

    /// About so many readings: those of a mode are equally likely, and as likely together as it is. Were modes heard out of proportion, those
    /// heard too often would seem to become more likely by themselves.
    fn numbers(
        &self,
        full: &Sum,
        action: ActionId,
        step: usize,
        most: usize,
    ) -> Vec<(f64, Sensed)> {
        let mut weights = vec![0.0; self.dynamics.modes()];
        for component in &full.components {
            weights[component.mode] += component.weight;
        }
        let heaviest = weights.iter().copied().fold(0.0, f64::max);
        let count = |&weight: &f64| match weight {
            rare if rare < RARE * heaviest => 0,
            sure if sure > 1.0 - RARE => most.max(1),
            weight => ((most as f64 * weight).round() as usize).max(SEVERAL),
        };
        let counts: Vec<usize> = weights.iter().map(count).collect();
        let total: usize = counts.iter().sum();
        // Single numbers can be put in order, and are the medians of more.
        let finer = match self.dynamics.readings() {
            1 => FINER,
            _ => 1,
        };
        let lattice = Lattice::new(
            finer * total,
            self.dynamics.states() + self.dynamics.readings(),
        );
        let mut draw = Draw {
            sensor: Sensor::new(self, action, step, Reading::Nothing),
            points: lattice.points(),
            wider: 1.0,
        };
        let mut readings = Vec::with_capacity(total + 1);
        let mut missing = 0.0;
        for (mode, (&weight, &count)) in weights.iter().zip(&counts).enumerate() {
            let of_mode = |component: &&Component| component.mode == mode;
            let components: Vec<&Component> = full.components.iter().filter(of_mode).collect();
            if finer > 1 {
                draw.wider = widening(count);
            }
            let (mut drawn, gone) = self.draw(&components, weight, finer * count, &mut draw);
            missing += gone;
            if finer > 1 {
                drawn = evenly(drawn, count);
            }
            let seen = self.model.laws.modes_seen.then_some(mode as f64);
            readings.extend(drawn.into_iter().map(|mut point| {
                point.values.extend(seen);
                (point.likely, Sensed::Values(point.values))
            }));
        }
        if missing > NEVER {
            readings.push((missing, Sensed::Nothing));
        }
        readings
    }

    /// So many points of components of a mode, each with a point of the noise, and how likely it is that there is no reading. Shares of the
    /// components, in their order, are equal; within them and of the noise, numbers follow a [`Lattice`] that all modes have a part in.
    fn draw<'l>(
        &self,
        components: &[&Component],
        weight: f64,
        points: usize,
        draw: &mut Draw<'_, impl Iterator<Item = &'l [f64]>>,
    ) -> (Vec<Drawn>, f64) {
        let (n, m) = (self.dynamics.states(), self.dynamics.readings());
        let Draw {
            sensor,
            points: normals,
            wider,
        } = draw;
        let mut drawn = Vec::with_capacity(points);
        let (mut at, mut z) = (vec![0.0; n], vec![0.0; n + m]);
        let mut spread = vec![0.0; m * m];
        let mut missing = 0.0;
        let share = weight / points as f64;
        let (mut passed, mut k) = (0.0, 0);
        for (i, component) in components.iter().enumerate() {
            let before = passed;
            passed += component.weight;
            // Rounding may leave the last a little short.
            let last = i + 1 == components.len();
            let end = if last { weight } else { passed };
            let mut own = None;
            let in_order = widening((component.weight / share).round() as usize);
            while k < points && (k as f64 + 0.5) * share <= end {
                let Some(normal) = normals.next() else {
                    break;
                };
                z.copy_from_slice(normal);
                if component.weight >= share {
                    let within = ((k as f64 + 0.5) * share - before) / component.weight;
                    let edge = 0.5 / points as f64;
                    let within = within.clamp(edge, 1.0 - edge);
                    z[0] = in_order * normal_quantile(within);
                }
                for z in &mut z {
                    *z *= *wider;
                }
                k += 1;
                let own = own.get_or_insert_with(|| root(&component.covariance, n));
                place(&component.mean, own, &z[..n], &mut at);
                self.confine(&component.mean, &component.covariance, &mut at);
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
        (0..symbols as u32)
            .map(Sensed::Symbol)
            .chain([Sensed::Nothing])
            .map(|sensed| (likely(&sensed), sensed))
            .filter(|(likely, _)| *likely > NEVER)
            .collect()
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

/// What readings are drawn with.
struct Draw<'a, P> {
    sensor: Sensor<'a>,
    /// Points of a lattice that are left.
    points: P,
    /// Times as wide as they are.
    wider: f64,
}

/// A reading that was drawn.
struct Drawn {
    likely: f64,
    values: Vec<f64>,
}

/// Modes that are so many times less likely than the likeliest are not heard.
const RARE: f64 = 5e-3;

/// Readings of a mode at least, where there are others.
const SEVERAL: usize = 2;

/// So many times as many numbers are drawn as are wanted, where they can be put in order.
const FINER: usize = 5;

/// Readings of less probability do not come.
const NEVER: f64 = 1e-12;

/// By how much evenly spread quantiles of a normal distribution, its tails left out, have to be moved apart to be as wide as it is.
fn widening(points: usize) -> f64 {
    let quantile = |k: usize| normal_quantile((k as f64 + 0.5) / points as f64);
    let squares: f64 = (0..points).map(|k| quantile(k).powi(2)).sum();
    match squares > 0.0 {
        true => (points as f64 / squares).sqrt(),
        false => 1.0,
    }
}

/// Of readings of one number, so many that are equally likely: the medians of those in between.
fn evenly(mut drawn: Vec<Drawn>, most: usize) -> Vec<Drawn> {
    drawn.sort_by(|a, b| a.values[0].total_cmp(&b.values[0]));
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

/// Points of a standard normal distribution, as evenly spread as few can be: quantiles in the orders of
/// [`even_steps`], turned and stretched so that each coordinate has variance 1 and none goes with another, nor with the order of the points.
struct Lattice {
    dim: usize,
    /// Point by point.
    normals: Vec<f64>,
}

/// A coordinate of which less is left, as a share of its standard deviation, stays as it is: points are too few for it.
const LEFT: f64 = 0.3;

impl Lattice {
    fn new(points: usize, dim: usize) -> Self {
        let order = (0..points).collect();
        let steps = even_steps(dim);
        let along = steps.iter().map(|step| permutation(points, *step));
        let columns = std::iter::once(order)
            .chain(along)
            .map(|cells: Vec<usize>| {
                let quantile = |cell: usize| normal_quantile((cell as f64 + 0.5) / points as f64);
                cells.into_iter().map(quantile).collect::<Vec<f64>>()
            });
        let mut apart: Vec<Vec<f64>> = Vec::with_capacity(dim + 1);
        for column in columns {
            let mut left = column.clone();
            for other in &apart {
                let along = mean_product(&left, other);
                left.iter_mut()
                    .zip(other)
                    .for_each(|(x, y)| *x -= along * y);
            }
            let enough = mean_product(&left, &left) > LEFT * LEFT * mean_product(&column, &column);
            let mut kept = if enough { left } else { column };
            let sd = mean_product(&kept, &kept).sqrt();
            kept.iter_mut().filter(|_| sd > 0.0).for_each(|x| *x /= sd);
            apart.push(kept);
        }
        let point = |k: usize| apart[1..].iter().map(move |column| column[k]);
        Self {
            dim,
            normals: (0..points).flat_map(point).collect(),
        }
    }

    /// The coordinates of each point.
    fn points(&self) -> impl Iterator<Item = &[f64]> {
        self.normals.chunks_exact(self.dim)
    }
}

/// Every number below `points` once, in the order of multiples of a step, modulo 1.
fn permutation(points: usize, step: f64) -> Vec<usize> {
    let places: Vec<f64> = (0..points)
        .map(|k| ((k + 1) as f64 * step).fract())
        .collect();
    let before = |place: &f64| places.iter().filter(|other| *other < place).count();
    places.iter().map(before).collect()
}

fn mean_product(a: &[f64], b: &[f64]) -> f64 {
    let sum: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
    sum / a.len() as f64
}

#[cfg(test)]
mod tests {
    use super::super::{Sum, SumKeeping};
    use super::{Lattice, mean_product, permutation, widening};
    use crate::belief::Keeping;
    use crate::belief::full::Moments;
    use crate::belief::gaussian::{even_steps, normal_quantile};
    use crate::scenario::find;

    #[test]
    fn permutations_take_every_number_once() {
        for points in [1, 2, 20, 40, 97] {
            for step in even_steps(3) {
                let mut cells = permutation(points, step);
                cells.sort_unstable();
                assert!(cells.into_iter().eq(0..points), "{points} points");
            }
        }
    }

    #[test]
    fn points_of_a_lattice_have_the_moments_of_the_standard_normal() {
        for (points, dim) in [(9, 2), (9, 3), (9, 4), (45, 2), (21, 5)] {
            let lattice = Lattice::new(points, dim);
            let column =
                |i: usize| -> Vec<f64> { lattice.points().map(|point| point[i]).collect() };
            let quantile = |k: usize| normal_quantile((k as f64 + 0.5) / points as f64);
            let order: Vec<f64> = (0..points).map(quantile).collect();
            for i in 0..dim {
                let mean = mean_product(&column(i), &vec![1.0; points]);
                assert!(mean.abs() < 1e-12, "{points} points: mean {mean}");
                let with_order = mean_product(&column(i), &order);
                assert!(with_order.abs() < 1e-12, "{points} points: {with_order}");
                for j in 0..dim {
                    let product = mean_product(&column(i), &column(j));
                    let expected = f64::from(i == j);
                    assert!(
                        (product - expected).abs() < 1e-12,
                        "{points} points: {product} of {i} and {j}"
                    );
                }
            }
        }
    }

    /// Four rooms in which a telephone may ring, one of them more likely, and a reading that hardly tells: the average over readings is what was
    /// believed before.
    #[test]
    fn modes_do_not_become_more_likely_by_themselves() {
        let model = find("rooms").expect("a built-in problem").model;
        let keeping = SumKeeping::new(&model);
        let mut full = keeping.start();
        for (component, weight) in full.components.iter_mut().zip([0.55, 0.3, 0.1, 0.05]) {
            component.weight = weight;
        }
        let before = weights(&keeping, &full);
        let mut after = vec![0.0; 4];
        for (likely, sensed) in keeping.readings(&full, 0, 0, 9) {
            let mut told = full.clone();
            keeping.sense(&mut told, 0, 0, sensed.reading());
            for (sum, weight) in after.iter_mut().zip(weights(&keeping, &told)) {
                *sum += likely * weight;
            }
        }
        for (before, after) in before.iter().zip(&after) {
            assert!((before - after).abs() < 0.01, "{before} became {after}");
        }
    }

    fn weights(keeping: &SumKeeping, full: &Sum) -> Vec<f64> {
        let mut moments = Moments::default();
        keeping.moments(full, &mut moments);
        moments.weights
    }

    #[test]
    fn so_few_medians_are_as_wide_as_a_normal_distribution_once_moved_apart() {
        assert!((widening(2) - 1.0 / 0.6744897501960817).abs() < 1e-9);
        assert!((widening(1001) - 1.0).abs() < 0.01);
        assert_eq!(widening(1), 1.0);
    }
}
