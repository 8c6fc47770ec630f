//! Sums of Gaussians against filters that are exact, fine grids and many draws.

use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;

use super::component::Component;
use super::reduce::Likeness;
use super::{Sum, SumKeeping};
use crate::belief::gaussian::{interval_probability, normal_cdf, region_probability};
use crate::belief::{KalmanFilter, Keeping, Moments, Reading, Sensed};
use crate::model::map::draw;
use crate::model::{
    BeliefSettings, Case, Clause, Formula, Interval, Laws, ModelBuilder, MotionLaw, Region,
    SensorLaw, Then, TrackerKind, VariableKind, WallBelief,
};
use crate::random::{Role, normal, stream, uniform};

/// Beliefs kept as sums, of so many Gaussians if it is said.
fn sums(components: Option<usize>) -> BeliefSettings {
    BeliefSettings {
        tracker: TrackerKind::Sum,
        components,
        ..BeliefSettings::default()
    }
}

/// Standard deviation of a reading of LD(5).
fn light(y: f64) -> f64 {
    (y - 5.0).abs() / 2.0_f64.sqrt() + 0.01
}

fn light_noise() -> Formula {
    Formula::coded("light", |point| light(point.state[0]).powi(2))
}

fn noisy(noise: Formula) -> SensorLaw {
    SensorLaw {
        noise: Some(DMatrix::from_element(1, 1, noise)),
        ..SensorLaw::default()
    }
}

/// LD(5) without its start: a light at 5, moves of one step, and a guess at 0 that ends the episode.
fn light_dark_from_nowhere(components: usize) -> ModelBuilder {
    ModelBuilder::new("light-dark", 0.9)
        .variable("y", f64::NEG_INFINITY, f64::INFINITY)
        .motion(&[1.0], &[1.0], &[0.0])
        .sensor(&[1.0], &[1.0])
        .case(Case {
            sensor: noisy(light_noise()),
            ..Case::default()
        })
        .action("LEFT", &[-1.0])
        .action("RIGHT", &[1.0])
        .action("GUESS", &[0.0])
        .event(
            10.0,
            None,
            Then::End,
            Clause::new().on("GUESS").within("y", -1.0, 1.0),
        )
        .event(-10.0, None, Then::End, Clause::new().on("GUESS"))
        .belief(sums(Some(components)))
}

fn light_dark(components: usize) -> SumKeeping {
    let model = light_dark_from_nowhere(components).start(&[2.0], &[9.0]);
    SumKeeping::new(&model.build().unwrap())
}

const RIGHT: usize = 1;
const GUESS: usize = 2;

fn moments(keeping: &SumKeeping, sum: &Sum) -> Moments {
    let mut moments = Moments::default();
    keeping.moments(sum, &mut moments);
    moments
}

/// Mean, standard deviation and total of a density on a line, by a fine grid.
fn on_a_grid(low: f64, high: f64, log_density: impl Fn(f64) -> f64) -> (f64, f64, f64) {
    const POINTS: usize = 2_000_001;
    let width = (high - low) / (POINTS - 1) as f64;
    let places = || (0..POINTS).map(|k| low + width * k as f64);
    let logs: Vec<f64> = places().map(log_density).collect();
    let best = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let (mut total, mut first, mut second) = (0.0, 0.0, 0.0);
    for (x, log) in places().zip(&logs) {
        let weight = (log - best).exp();
        total += weight;
        first += weight * x;
        second += weight * x * x;
    }
    let mean = first / total;
    let sd = (second / total - mean * mean).sqrt();
    (mean, sd, best + (total * width).ln())
}

fn log_normal(apart: f64, variance: f64) -> f64 {
    -0.5 * (apart * apart / variance + variance.ln() + std::f64::consts::TAU.ln())
}

#[test]
fn one_gaussian_is_the_kalman_filter() {
    let (a, b) = ([1.0, 0.3, -0.1, 0.9], [0.0, 1.0]);
    let (q, r) = ([0.2, 0.05, 0.05, 0.1], [0.5, 0.1, 0.1, 0.3]);
    let (h, p) = ([1.0, 0.0, 0.5, 1.0], [2.0, 0.4, 0.4, 1.0]);
    let model = ModelBuilder::new("linear", 0.9)
        .variable("x", -50.0, 50.0)
        .variable("v", -50.0, 50.0)
        .start(&[1.0, -1.0], &p)
        .motion(&a, &b, &q)
        .sensor(&h, &r)
        .action("PUSH", &[0.7])
        .reward(1.0, Clause::new().within("x", 0.0, 1.0))
        .belief(sums(None))
        .build()
        .unwrap();
    let matrix = |numbers: &[f64]| DMatrix::from_row_slice(2, 2, numbers);
    let mut exact = KalmanFilter {
        a: matrix(&a),
        b: DMatrix::from_column_slice(2, 1, &b),
        q: matrix(&q),
        h: matrix(&h),
        r: matrix(&r),
        mean: DVector::from_column_slice(&[1.0, -1.0]),
        covariance: matrix(&p),
    };
    let keeping = SumKeeping::new(&model);
    let mut sum = keeping.start();
    for (step, reading) in [[0.2, 0.1], [3.0, -4.0], [9.0, 2.0]]
        .into_iter()
        .enumerate()
    {
        keeping.act(&mut sum, 0, step);
        keeping.sense(&mut sum, 0, step, Reading::Values(&reading));
        exact.step(
            &DVector::from_column_slice(&[0.7]),
            &DVector::from_column_slice(&reading),
        );
        let found = moments(&keeping, &sum);
        for i in 0..2 {
            assert!(
                (found.mean[i] - exact.mean[i]).abs() < 1e-9,
                "{found:?} {exact:?}"
            );
            for j in 0..2 {
                assert!((found.covariance[2 * i + j] - exact.covariance[(i, j)]).abs() < 1e-9);
            }
        }
    }
}

/// Posterior of LD(5) after some moves, each with its reading: mean, standard deviation, logarithm of the evidence.
fn light_dark_exactly(readings: &[(f64, f64)]) -> (f64, f64, f64) {
    on_a_grid(-22.0, 26.0, |y| {
        let mut at = y;
        let mut log = log_normal(y - 2.0, 9.0);
        for (control, reading) in readings {
            at += control;
            log += log_normal(reading - at, light(at).powi(2));
        }
        log
    })
}

#[test]
fn noise_that_depends_on_the_place_is_taken_as_it_is() {
    let cases: [&[f64]; 8] = [
        &[3.0],
        &[5.0],
        &[-4.0],
        &[5.02],
        &[11.0],
        &[4.0, 6.0, 5.5],
        &[0.0, 1.0, 2.0],
        &[5.2, 6.1, 7.0],
    ];
    for (components, tolerance) in [(20, 0.03), (40, 0.02)] {
        let keeping = light_dark(components);
        for readings in cases {
            let mut sum = keeping.start();
            for (step, reading) in readings.iter().enumerate() {
                keeping.act(&mut sum, RIGHT, step);
                keeping.sense(&mut sum, RIGHT, step, Reading::Values(&[*reading]));
            }
            let moves: Vec<(f64, f64)> = readings.iter().map(|reading| (1.0, *reading)).collect();
            let (mean, sd, _) = light_dark_exactly(&moves);
            let found = moments(&keeping, &sum);
            let (own, own_sd) = (
                found.mean[0] - readings.len() as f64,
                found.covariance[0].sqrt(),
            );
            assert!((own - mean).abs() < tolerance * sd.max(0.2), "{readings:?}");
            assert!((own_sd / sd - 1.0).abs() < 2.0 * tolerance, "{readings:?}");
        }
    }
}

/// Two modes that drift apart: who has heard where the state is knows how likely each is.
#[test]
fn modes_are_weighed_by_what_they_foretold() {
    let drifting = |mode, drift: f64| Case {
        modes: Some(vec![mode]),
        motion: MotionLaw {
            drift: Some(DVector::from_element(1, drift)),
            ..MotionLaw::default()
        },
        ..Case::default()
    };
    let model = light_dark_from_nowhere(60)
        .mode("calm")
        .mode("windy")
        .start_of(0.7, Some("calm"), &[2.0], &[9.0])
        .start_of(0.3, Some("windy"), &[2.0], &[9.0])
        .case(drifting(0, 0.0))
        .case(drifting(1, -0.8));
    let keeping = SumKeeping::new(&model.build().unwrap());
    let mut sum = keeping.start();
    let readings = [4.0, 4.9, 5.3];
    for (step, reading) in readings.iter().enumerate() {
        keeping.act(&mut sum, RIGHT, step);
        keeping.sense(&mut sum, RIGHT, step, Reading::Values(&[*reading]));
    }
    let moves = |by: f64| readings.map(|reading| (by, reading));
    let calm = light_dark_exactly(&moves(1.0)).2 + 0.7_f64.ln();
    let windy = light_dark_exactly(&moves(0.2)).2 + 0.3_f64.ln();
    let exact = 1.0 / (1.0 + (windy - calm).exp());
    let found = moments(&keeping, &sum).weights[0];
    assert!((found - exact).abs() < 0.01, "{found} {exact}");
}

#[test]
fn a_guess_pays_what_it_is_expected_to() {
    let keeping = light_dark(20);
    let mut sum = keeping.start();
    let acted = keeping.act(&mut sum, GUESS, 0);
    let inside = interval_probability(2.0, 9.0, Interval::new(-1.0, 1.0));
    assert!(
        (acted.reward - (20.0 * inside - 10.0)).abs() < 1e-6,
        "{acted:?}"
    );
    assert!((acted.ended - 1.0).abs() < 1e-7, "{acted:?}");
}

/// A plane with two modes: what happens in a region, by chance, changes the mode.
#[test]
fn an_event_takes_its_part_of_what_is_believed() {
    let p = [1.0, 0.6, 0.6, 2.0];
    let model = ModelBuilder::new("event", 0.9)
        .variable("x", -50.0, 50.0)
        .variable("y", -50.0, 50.0)
        .mode("before")
        .mode("afterwards")
        .start(&[0.3, 1.0], &p)
        .motion(&[1.0, 0.0, 0.0, 1.0], &[0.0, 0.0], &[0.0; 4])
        .sensor(&[1.0, 0.0], &[1.0])
        .action("WAIT", &[0.0])
        .event(
            5.0,
            Some("afterwards"),
            Then::Continue,
            Clause::new().within("x", 0.0, 1.5).with_probability(0.6),
        )
        .belief(sums(None))
        .build()
        .unwrap();
    let keeping = SumKeeping::new(&model);
    let mut sum = keeping.start();
    let acted = keeping.act(&mut sum, 0, 0);
    let inside = 0.6 * interval_probability(0.3, 1.0, Interval::new(0.0, 1.5));
    let found = moments(&keeping, &sum);
    assert!((found.weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    assert!(
        (found.weights[1] - inside).abs() < 1e-6,
        "{found:?} {inside}"
    );
    assert!((acted.reward - 5.0 * inside).abs() < 1e-5);
    // What has happened to the mode moves nothing.
    let all: Vec<f64> = [0.3, 1.0].into_iter().chain(p).collect();
    let own: Vec<f64> = found
        .mean
        .iter()
        .chain(&found.covariance)
        .copied()
        .collect();
    for (own, exact) in own.iter().zip(&all) {
        assert!((own - exact).abs() < 1e-6, "{own} {exact}");
    }
    // Of what it has happened to, many draws.
    let mut rng = stream(7, 0, Role::World);
    let drawn = (0..400_000).filter_map(|_| {
        let (a, b) = (normal(&mut rng), normal(&mut rng));
        let x = 0.3 + a;
        let y = 1.0 + 0.6 * a + (2.0 - 0.36_f64).sqrt() * b;
        ((0.0..1.5).contains(&x) && uniform(&mut rng) < 0.6).then_some([x, y])
    });
    let (mean, covariance) = drawn_moments(drawn);
    let happened = only(&sum, 1);
    let found = moments(&keeping, &happened);
    assert_near(&found.mean, &mean, 0.02);
    assert_near(&found.covariance, &covariance, 0.02);
}

/// The part of a sum in a mode.
fn only(sum: &Sum, mode: usize) -> Sum {
    let mut part = sum.clone();
    part.components.retain(|component| component.mode == mode);
    super::normalise(&mut part.components);
    part
}

fn drawn_moments<const N: usize>(drawn: impl Iterator<Item = [f64; N]>) -> (Vec<f64>, Vec<f64>) {
    let drawn: Vec<[f64; N]> = drawn.collect();
    let count = drawn.len() as f64;
    let mean: Vec<f64> = (0..N)
        .map(|i| drawn.iter().map(|x| x[i]).sum::<f64>() / count)
        .collect();
    let entry = |k: usize| {
        let (i, j) = (k / N, k % N);
        drawn
            .iter()
            .map(|x| (x[i] - mean[i]) * (x[j] - mean[j]))
            .sum::<f64>()
            / count
    };
    let covariance = (0..N * N).map(entry).collect();
    (mean, covariance)
}

fn assert_near(found: &[f64], exact: &[f64], tolerance: f64) {
    for (own, other) in found.iter().zip(exact) {
        assert!(
            (own - other).abs() < tolerance,
            "{found:?} instead of {exact:?}"
        );
    }
}

#[test]
fn what_runs_against_walls_stays_there() {
    let model = |components| {
        let belief = BeliefSettings {
            walls: WallBelief::Clip,
            ..sums(components)
        };
        ModelBuilder::new("walled", 0.9)
            .variable("x", 0.0, 10.0)
            .variable("y", 0.0, 10.0)
            .start(&[2.0, 5.0], &[1.0, 0.5, 0.5, 1.0])
            .motion(&[1.0, 0.0, 0.0, 1.0], &[1.0, 0.0], &[0.3, 0.0, 0.0, 0.2])
            .sensor(&[1.0, 0.0], &[1.0])
            .action("BACK", &[-1.5])
            .reward(1.0, Clause::new().within("x", 0.0, 0.1))
            .belief(belief)
            .build()
            .unwrap()
    };
    let mut rng = stream(8, 0, Role::World);
    let drawn = (0..400_000).map(|_| {
        let z = [(); 4].map(|()| normal(&mut rng));
        // Starts beyond the wall were stopped by it, too.
        let x = (2.0 + z[0]).max(0.0) - 1.5 + 0.3_f64.sqrt() * z[1];
        let y = 5.0 + 0.5 * z[0] + 0.75_f64.sqrt() * z[2] + 0.2_f64.sqrt() * z[3];
        [x.max(0.0), y]
    });
    let (mean, covariance) = drawn_moments(drawn);
    for components in [None, Some(1)] {
        let keeping = SumKeeping::new(&model(components));
        let mut sum = keeping.start();
        keeping.act(&mut sum, 0, 0);
        let found = moments(&keeping, &sum);
        assert_near(&found.mean, &mean, 0.01);
        assert_near(&found.covariance, &covariance, 0.03);
    }
}

/// A Gaussian at a wall reaches beyond it, and what it has there is at the wall.
#[test]
fn a_place_at_a_wall_holds_what_is_believed_beyond_it() {
    let model = |components| {
        let belief = BeliefSettings {
            walls: WallBelief::Clip,
            ..sums(Some(components))
        };
        ModelBuilder::new("walled", 0.9)
            .variable("x", 0.0, 4.0)
            .start(&[2.5], &[0.25])
            .motion(&[1.0], &[1.0], &[0.25])
            .sensor(&[1.0], &[1.0])
            .action("EAST", &[1.0])
            .reward(1.0, Clause::new().within("x", 3.0, 4.0))
            .belief(belief)
            .build()
            .unwrap()
    };
    // Moved by 1 with a variance of 0.5 in all, then stopped at 4.
    let there = 1.0 - normal_cdf((3.0 - 3.5) / 0.5_f64.sqrt());
    for (components, tolerance) in [(1, 0.03), (8, 0.005)] {
        let keeping = SumKeeping::new(&model(components));
        let mut sum = keeping.start();
        keeping.act(&mut sum, 0, 0);
        let paid = keeping.act(&mut sum, 0, 1).reward;
        assert!((paid - there).abs() < tolerance, "{paid}, not {there}");
    }
}

/// In `rooms`, a wall runs from north to south at x = 3, but for the doors in the middle.
#[test]
fn who_leans_on_a_wall_stays_on_its_side() {
    let model = crate::scenario::find("rooms").unwrap().model;
    let east = model.actions.iter().position(|a| a.name == "EAST").unwrap();
    let keeping = SumKeeping::new(&model);
    let mut full = keeping.with_moments(&Moments {
        mean: vec![2.9, 1.0],
        covariance: vec![0.04, 0.0, 0.0, 0.04],
        weights: vec![1.0, 0.0, 0.0, 0.0],
        step: 0,
    });
    let mut moments = Moments::default();
    for _ in 0..5 {
        keeping.act(&mut full, east, 0);
        keeping.sense(&mut full, east, 0, Reading::Values(&[3.4, 1.0, 0.5]));
        keeping.moments(&full, &mut moments);
        assert!(moments.mean[0] < 3.0, "{moments:?}");
        for component in &full.components {
            assert!(component.mean[0] < 3.0, "{component:?}");
        }
    }
    // A little of it on the other side does not draw the mean through the wall.
    let mut beyond = full.components[0].clone();
    beyond.mean[0] = 4.0;
    for component in &mut full.components {
        component.weight *= 0.9;
    }
    beyond.weight = 0.1;
    full.components.push(beyond);
    keeping.moments(&full, &mut moments);
    assert!(moments.mean[0] < 3.0, "{moments:?}");
}

proptest! {
    /// Merging the last of some Gaussians changes neither the others nor the moments.
    #[test]
    fn merging_some_keeps_the_moments_of_all(
        means in proptest::collection::vec((-5.0..5.0, -5.0..5.0, 0.1..2.0), 6..20),
        first in 0_usize..4,
        most in 1_usize..4,
    ) {
        let likeness = Likeness::new(vec![1e-6; 2], &[VariableKind::Real; 2]);
        let component = |&(x, y, variance): &(f64, f64, f64)| Component {
            weight: variance / 40.0,
            mode: 0,
            mean: vec![x, y],
            covariance: vec![variance, 0.3 * variance, 0.3 * variance, 1.0],
        };
        let before: Vec<Component> = means.iter().map(component).collect();
        let whole = |components: &[Component]| {
            let mut all = components.to_vec();
            likeness.join(&mut all);
            all.remove(0)
        };
        let mut after = before.clone();
        likeness.reduce_from(&mut after, first, most);
        prop_assert!(after.len() <= first + most);
        prop_assert_eq!(&after[..first], &before[..first]);
        let (found, exact) = (whole(&after), whole(&before));
        prop_assert!((found.weight - exact.weight).abs() < 1e-12);
        assert_near(&found.mean, &exact.mean, 1e-9);
        assert_near(&found.covariance, &exact.covariance, 1e-9);
    }
}

#[test]
fn readings_that_may_come_agree_with_what_is_believed() {
    let keeping = light_dark(20);
    let mut sum = keeping.start();
    keeping.act(&mut sum, RIGHT, 0);
    for most in [20, 100, 400] {
        let readings = keeping.readings(&sum, RIGHT, 0, most);
        let total: f64 = readings.iter().map(|(likely, _)| likely).sum();
        assert!((total - 1.0).abs() < 1e-12);
        let (mut mean, mut square) = (0.0, 0.0);
        for (likely, sensed) in &readings {
            let mut after = sum.clone();
            keeping.sense(&mut after, RIGHT, 0, sensed.reading());
            let found = moments(&keeping, &after);
            mean += likely * found.mean[0];
            square += likely * (found.covariance[0] + found.mean[0] * found.mean[0]);
        }
        let tolerance = 2.0 / (most as f64).sqrt();
        assert!((mean - 3.0).abs() < 0.3 * tolerance, "{most}: {mean}");
        assert!((square / 18.0 - 1.0).abs() < tolerance, "{most}: {square}");
    }
}

/// Ranges to two beacons: sd .05 + .25 of the range.
fn beacons(
    read: bool,
    noise: impl Fn(f64) -> f64 + Send + Sync + Copy + 'static,
    p: &[f64],
) -> SumKeeping {
    const PLACES: [[f64; 2]; 2] = [[5.0, 5.0], [5.0, -5.0]];
    let range = |state: &[f64], k: usize| (state[0] - PLACES[k][0]).hypot(state[1] - PLACES[k][1]);
    let variance = move |k: usize| {
        Formula::coded(&format!("noise {k}"), move |point| {
            noise(range(point.state, k)).powi(2)
        })
    };
    let none = || Formula::Number(0.0);
    let ranges = vec![
        Formula::coded("range 0", move |point| range(point.state, 0)),
        Formula::coded("range 1", move |point| range(point.state, 1)),
    ];
    let model = ModelBuilder::new("beacons", 0.95)
        .variable("x", -20.0, 20.0)
        .variable("y", -20.0, 20.0)
        .start(&[2.0, 2.0], p)
        .motion(
            &[1.0, 0.0, 0.0, 1.0],
            &[1.0, 0.0, 0.0, 1.0],
            &[0.01, 0.0, 0.0, 0.01],
        )
        .sensor(&[1.0, 0.0, 0.0, 1.0], &[1.0, 0.0, 0.0, 1.0])
        .case(Case {
            sensor: SensorLaw {
                read: if read { ranges } else { Vec::new() },
                noise: Some(DMatrix::from_row_slice(
                    2,
                    2,
                    &[variance(0), none(), none(), variance(1)],
                )),
                ..SensorLaw::default()
            },
            ..Case::default()
        })
        .action("STAY", &[0.0, 0.0])
        .action("EAST", &[1.0, 0.0])
        .reward(1.0, Clause::new().within("x", -1.0, 1.0))
        .belief(sums(None))
        .build()
        .unwrap();
    SumKeeping::new(&model)
}

/// Mean and covariance of a density in the plane, by a grid.
fn in_the_plane(
    centre: [f64; 2],
    half: f64,
    log_density: impl Fn(&[f64; 2]) -> f64,
) -> (Vec<f64>, Vec<f64>) {
    const SIDE: usize = 1501;
    let at = |k: usize, i: usize| centre[i] + half * (2.0 * k as f64 / (SIDE - 1) as f64 - 1.0);
    let points = (0..SIDE * SIDE).map(|k| [at(k / SIDE, 0), at(k % SIDE, 1)]);
    let weighed: Vec<([f64; 2], f64)> = points.map(|x| (x, log_density(&x))).collect();
    let best = weighed
        .iter()
        .fold(f64::NEG_INFINITY, |best, (_, log)| best.max(*log));
    let total: f64 = weighed.iter().map(|(_, log)| (log - best).exp()).sum();
    let expect = |of: &dyn Fn(&[f64; 2]) -> f64| {
        let weighed = weighed.iter().map(|(x, log)| (log - best).exp() * of(x));
        weighed.sum::<f64>() / total
    };
    let mean: Vec<f64> = (0..2).map(|i| expect(&|x| x[i])).collect();
    let entry = |k: usize| expect(&|x| (x[k / 2] - mean[k / 2]) * (x[k % 2] - mean[k % 2]));
    let covariance = (0..4).map(entry).collect();
    (mean, covariance)
}

/// Posterior in the plane after ranges were read in the same place, some motion noise apart.
fn ranged(
    noise: impl Fn(f64) -> f64,
    p: &[f64],
    reading: [f64; 2],
    around: ([f64; 2], f64),
) -> (Vec<f64>, Vec<f64>) {
    let (a, b, c) = (p[0] + 0.01, p[1], p[3] + 0.01);
    let det = a * c - b * b;
    in_the_plane(around.0, around.1, |x| {
        let (u, v) = (x[0] - 2.0, x[1] - 2.0);
        let prior = -0.5 * (c * u * u - 2.0 * b * u * v + a * v * v) / det;
        let likely = |k: usize| {
            let place = [5.0, -5.0][k];
            let range = (x[0] - 5.0).hypot(x[1] - place);
            log_normal(reading[k] - range, noise(range).powi(2))
        };
        prior + likely(0) + likely(1)
    })
}

#[test]
fn ranges_are_taken_by_their_moments() {
    let wide = [5.0, 0.0, 0.0, 5.0];
    let narrow = [0.4, 0.2, 0.2, 0.6];
    let rough = |range: f64| 0.05 + 0.25 * range;
    let fine = |_: f64| 0.02;
    for p in [&wide, &narrow] {
        for reading in [[4.2, 7.6], [2.0, 6.0], [6.0, 9.0]] {
            let keeping = beacons(true, rough, p);
            let mut sum = keeping.start();
            keeping.act(&mut sum, 0, 0);
            keeping.sense(&mut sum, 0, 0, Reading::Values(&reading));
            let found = moments(&keeping, &sum);
            let (mean, covariance) = ranged(rough, p, reading, ([2.0, 2.0], 12.0));
            for i in 0..2 {
                let sd = covariance[3 * i].sqrt();
                assert!((found.mean[i] - mean[i]).abs() < 0.05 * sd);
                assert!((found.covariance[3 * i].sqrt() / sd - 1.0).abs() < 0.05);
            }
        }
        // Far sharper than what was known.
        let (x, y): (f64, f64) = (2.5, 1.5);
        let reading = [(x - 5.0).hypot(y - 5.0), (x - 5.0).hypot(y + 5.0)];
        let keeping = beacons(true, fine, p);
        let mut sum = keeping.start();
        keeping.act(&mut sum, 0, 0);
        keeping.sense(&mut sum, 0, 0, Reading::Values(&reading));
        let found = moments(&keeping, &sum);
        let (mean, covariance) = ranged(fine, p, reading, ([5.0, y], 4.0));
        for i in 0..2 {
            let sd = covariance[3 * i].sqrt();
            assert!((found.mean[i] - mean[i]).abs() < 0.1 * sd);
            assert!((found.covariance[3 * i].sqrt() / sd - 1.0).abs() < 0.1);
        }
    }
}

/// Noise next to none, and a covariance that has only one direction.
#[test]
fn what_is_known_exactly_is_no_obstacle() {
    for p in [[1.0, 0.0, 0.0, 0.0], [1.0, 1.0, 1.0, 1.0], [0.0; 4]] {
        let model = ModelBuilder::new("singular", 0.9)
            .variable("x", -50.0, 50.0)
            .variable("y", -50.0, 50.0)
            .start(&[0.0, 0.0], &p)
            .motion(&[1.0, 0.0, 0.0, 1.0], &[0.0, 0.0], &[0.0; 4])
            .sensor(&[1.0, 0.0], &[1.0])
            .case(Case {
                sensor: noisy(Formula::coded("steep", |point| {
                    (0.01 + (point.state[0] - 1.0).powi(2)) * 0.3
                })),
                ..Case::default()
            })
            .action("WAIT", &[0.0])
            .reward(1.0, Clause::new().within("x", 0.0, 1.5))
            .belief(sums(None))
            .build()
            .unwrap();
        let keeping = SumKeeping::new(&model);
        let mut sum = keeping.start();
        keeping.act(&mut sum, 0, 0);
        keeping.sense(&mut sum, 0, 0, Reading::Values(&[0.9]));
        let found = moments(&keeping, &sum);
        let (mean, sd, _) = match p[0] > 0.0 {
            false => (0.0, 0.0, 0.0),
            true => on_a_grid(-8.0, 8.0, |x| {
                log_normal(x, 1.0) + log_normal(0.9 - x, (0.01 + (x - 1.0).powi(2)) * 0.3)
            }),
        };
        assert!(
            (found.mean[0] - mean).abs() <= 0.03 * sd,
            "{p:?}: {found:?} {mean} {sd}"
        );
        assert!(
            (found.covariance[0].sqrt() - sd).abs() <= 0.03 * sd,
            "{p:?}: {found:?} {sd}"
        );
        let slope = p[1];
        assert!(
            (found.mean[1] - slope * mean).abs() <= 0.03 * sd,
            "{p:?}: {found:?}"
        );
        assert!((found.covariance[3] - slope * sd * sd).abs() <= 0.06 * sd * sd);
    }
}

/// A binary light: signals and silence have the probabilities that an integral gives them.
#[test]
fn signals_and_silence_are_heard() {
    let bright = |y: f64| 0.05 + 0.9 / (1.0 + (-6.0 * (1.5 - (y - 5.0).abs())).exp());
    let present = |y: f64| 0.3 + 0.6 / (1.0 + y * y);
    let sensor = SensorLaw {
        symbols: vec![
            Formula::coded("bright", move |point| bright(point.state[0])),
            Formula::coded("dark", move |point| 1.0 - bright(point.state[0])),
        ],
        present: Some(Formula::coded("heard", move |point| {
            present(point.state[0])
        })),
        ..SensorLaw::default()
    };
    let model = light_dark_from_nowhere(40).start(&[2.0], &[9.0]);
    let mut model = model.build().unwrap();
    model.sensor.h = DMatrix::zeros(0, 1);
    model.sensor.noise = DMatrix::zeros(0, 0);
    model.laws = Laws {
        symbols: vec!["bright".to_owned(), "dark".to_owned()],
        cases: vec![Case {
            sensor,
            ..Case::default()
        }],
        ..Laws::default()
    };
    model.validate().unwrap();
    let keeping = SumKeeping::new(&model);
    let mut moved = keeping.start();
    keeping.act(&mut moved, RIGHT, 0);
    let likely = |sensed: &Sensed, y: f64| match sensed {
        Sensed::Symbol(0) => present(y) * bright(y),
        Sensed::Symbol(_) => present(y) * (1.0 - bright(y)),
        _ => 1.0 - present(y),
    };
    let readings = keeping.readings(&moved, RIGHT, 0, 10);
    assert_eq!(readings.len(), 3);
    for (probability, sensed) in readings {
        let (mean, sd, evidence) = on_a_grid(-22.0, 28.0, |y| {
            log_normal(y - 3.0, 9.0) + likely(&sensed, y).ln()
        });
        let mut after = moved.clone();
        keeping.sense(&mut after, RIGHT, 0, sensed.reading());
        let found = moments(&keeping, &after);
        let own = (found.mean[0], found.covariance[0].sqrt());
        assert!((probability - evidence.exp()).abs() < 0.005, "{sensed:?}");
        assert!(
            (own.0 - mean).abs() < 0.03 * sd && (own.1 / sd - 1.0).abs() < 0.03,
            "{sensed:?}"
        );
    }
}

/// Whole numbers: a start on every one of them, a light at 10.
#[test]
fn whole_numbers_are_points() {
    let noise = |s: f64| ((s - 10.0).abs() + 1e-4).powi(2);
    let belief = BeliefSettings {
        walls: WallBelief::Clip,
        ..sums(None)
    };
    let mut model = ModelBuilder::new("whole", 0.95)
        .variable("s", -60.0, 60.0)
        .kind(VariableKind::Integer)
        .start(&[0.0], &[310.0])
        .motion(&[1.0], &[1.0], &[0.0])
        .sensor(&[1.0], &[1.0])
        .case(Case {
            sensor: noisy(Formula::coded("whole light", move |point| {
                noise(point.state[0])
            })),
            ..Case::default()
        })
        .action("RIGHT", &[1.0])
        .reward(1.0, Clause::new().within("s", 0.0, 1.0))
        .belief(belief)
        .build()
        .unwrap();
    model.start[0].shape = crate::model::StartShape::Uniform;
    let keeping = SumKeeping::new(&model);
    let mut sum = keeping.start();
    assert_eq!(sum.components().len(), 61);
    keeping.act(&mut sum, 0, 0);
    keeping.sense(&mut sum, 0, 0, Reading::Values(&[4.0]));
    let weights: Vec<(f64, f64)> = (-29..=31)
        .map(|s| {
            (
                f64::from(s),
                log_normal(4.0 - f64::from(s), noise(f64::from(s))).exp(),
            )
        })
        .collect();
    let total: f64 = weights.iter().map(|(_, weight)| weight).sum();
    let mean = weights.iter().map(|(s, weight)| s * weight).sum::<f64>() / total;
    let square = weights
        .iter()
        .map(|(s, weight)| s * s * weight)
        .sum::<f64>()
        / total;
    let found = moments(&keeping, &sum);
    assert!((found.mean[0] - mean).abs() < 0.02, "{found:?} {mean}");
    assert!((found.covariance[0] - (square - mean * mean)).abs() < 0.5);
}

/// A line without a sensor to speak of, on which one action is taken once.
fn one_step(builder: ModelBuilder, covariance: f64) -> (SumKeeping, Sum, crate::belief::Acted) {
    let model = builder
        .variable("y", f64::NEG_INFINITY, f64::INFINITY)
        .start(&[2.0], &[covariance])
        .sensor(&[1.0], &[1.0])
        .action("GO", &[1.0])
        .belief(sums(Some(40)));
    let keeping = SumKeeping::new(&model.build().unwrap());
    let mut sum = keeping.start();
    let acted = keeping.act(&mut sum, 0, 0);
    (keeping, sum, acted)
}

#[test]
fn formulas_are_paid_where_they_hold() {
    let builder = ModelBuilder::new("paid", 0.9)
        .motion(&[1.0], &[1.0], &[0.1])
        .reward_of(
            Formula::coded("square", |point| point.state[0].powi(2)),
            Clause::new().within("y", 0.5, 3.0),
        );
    let (.., acted) = one_step(builder, 9.0);
    let (_, _, all) = on_a_grid(0.5, 3.0 - 1e-9, |y| log_normal(y - 2.0, 9.0) + 2.0 * y.ln());
    assert!(
        (acted.reward / all.exp() - 1.0).abs() < 1e-3,
        "{acted:?} {}",
        all.exp()
    );
}

#[test]
fn a_motion_that_bends_splits_what_is_moved() {
    let step = |y: f64| y + 2.0 * y.sin();
    let noise = |y: f64| 0.01 + 0.1 * y.abs();
    let law = MotionLaw {
        step: vec![Some(Formula::coded("bent", move |point| {
            step(point.state[0])
        }))],
        noise: Some(DMatrix::from_element(
            1,
            1,
            Formula::coded("gusts", move |point| noise(point.state[0])),
        )),
        ..MotionLaw::default()
    };
    let builder = ModelBuilder::new("bent", 0.9)
        .motion(&[1.0], &[1.0], &[0.1])
        .reward(1.0, Clause::new())
        .case(Case {
            motion: law,
            ..Case::default()
        });
    let (keeping, sum, _) = one_step(builder, 4.0);
    assert!(sum.components().len() > 1);
    let mut rng = stream(9, 0, Role::World);
    let drawn = (0..400_000).map(|_| {
        let y = 2.0 + 2.0 * normal(&mut rng);
        [step(y) + noise(y).sqrt() * normal(&mut rng)]
    });
    let (mean, covariance) = drawn_moments(drawn);
    let found = moments(&keeping, &sum);
    assert_near(&found.mean, &mean, 0.05);
    assert_near(&found.covariance, &covariance, 0.02 * covariance[0]);
}

#[test]
fn a_reading_at_its_end_says_that_there_is_more() {
    let mut model = light_dark_from_nowhere(40)
        .start(&[2.0], &[9.0])
        .build()
        .unwrap();
    model.laws.saturates = vec![Interval::new(0.0, 4.0)];
    let keeping = SumKeeping::new(&model);
    for reading in [4.0, 0.0, 2.0] {
        let mut sum = keeping.start();
        keeping.act(&mut sum, RIGHT, 0);
        keeping.sense(&mut sum, RIGHT, 0, Reading::Values(&[reading]));
        let found = moments(&keeping, &sum);
        let (mean, sd, _) = on_a_grid(-21.0, 27.0, |y| {
            let apart = reading - y;
            log_normal(y - 3.0, 9.0)
                + match reading {
                    4.0 => normal_cdf(-apart / light(y)).ln(),
                    0.0 => normal_cdf(apart / light(y)).ln(),
                    _ => log_normal(apart, light(y).powi(2)),
                }
        });
        assert!(
            (found.mean[0] - mean).abs() < 0.02 * sd,
            "{reading}: {found:?} {mean} {sd}"
        );
        assert!(
            (found.covariance[0].sqrt() / sd - 1.0).abs() < 0.02,
            "{reading}: {found:?} {sd}"
        );
    }
    let mut sum = keeping.start();
    keeping.act(&mut sum, RIGHT, 0);
    let readings = keeping.readings(&sum, RIGHT, 0, 50);
    let beyond = readings
        .iter()
        .filter(|(_, sensed)| *sensed == Sensed::Values(vec![4.0]));
    assert!(beyond.count() > 5);
}

#[test]
fn modes_that_are_seen_are_known() {
    let builder = light_dark_from_nowhere(20)
        .mode("calm")
        .mode("windy")
        .start_of(0.7, Some("calm"), &[2.0], &[9.0])
        .start_of(0.3, Some("windy"), &[2.0], &[9.0]);
    let mut model = builder.build().unwrap();
    model.laws.modes_seen = true;
    let keeping = SumKeeping::new(&model);
    let mut sum = keeping.start();
    keeping.act(&mut sum, RIGHT, 0);
    let readings = keeping.readings(&sum, RIGHT, 0, 50);
    let windy = readings.iter().filter(|(_, sensed)| match sensed {
        Sensed::Values(values) => values.len() == 2 && values[1] == 1.0,
        _ => false,
    });
    let windy: f64 = windy.map(|(likely, _)| likely).sum();
    assert!((windy - 0.3).abs() < 0.03, "{windy}");
    keeping.sense(&mut sum, RIGHT, 0, Reading::Values(&[3.0, 1.0]));
    assert_eq!(moments(&keeping, &sum).weights, [0.0, 1.0]);
}

#[test]
fn a_box_that_is_not_aligned_has_its_probability() {
    let component = Component {
        weight: 0.5,
        mode: 0,
        mean: vec![0.3, -0.2],
        covariance: vec![1.0, 0.8, 0.8, 1.0],
    };
    let region = Region::new(vec![
        (0, Interval::new(0.0, 1.0)),
        (1, Interval::new(0.0, 1.0)),
    ]);
    let covariance = DMatrix::from_row_slice(2, 2, &component.covariance);
    let exact = 0.5 * region_probability(&component.mean, &covariance, &region);
    let (inside, outside) = component.cut(&region);
    let inside = inside.map_or(0.0, |inside| inside.weight);
    let outside: f64 = outside.iter().map(|part| part.weight).sum();
    assert!((inside - exact).abs() < 1e-12, "{inside} {exact}");
    assert!((inside + outside - 0.5).abs() < 1e-12);
}

/// A blocked cell in the way, of which some of the noise leads past.
#[test]
fn walls_of_a_map_stop_what_runs_into_them() {
    let belief = BeliefSettings {
        walls: WallBelief::Clip,
        ..sums(None)
    };
    let mut model = ModelBuilder::new("cell", 0.9)
        .variable("x", 0.0, 3.0)
        .variable("y", 0.0, 3.0)
        .start(&[0.5, 1.7], &[0.03, 0.0, 0.0, 0.05])
        .motion(&[1.0, 0.0, 0.0, 1.0], &[1.0, 0.0], &[0.02, 0.0, 0.0, 0.02])
        .sensor(&[1.0, 0.0], &[1.0])
        .action("EAST", &[1.0])
        .reward(1.0, Clause::new())
        .belief(belief)
        .build()
        .unwrap();
    let map = draw("...\n.#.\n...", 1.0).unwrap();
    model.map = Some(map.clone());
    let keeping = SumKeeping::new(&model);
    let mut sum = keeping.start();
    keeping.act(&mut sum, 0, 0);
    let mut rng = stream(10, 0, Role::World);
    let drawn = (0..200_000).map(|_| {
        let mut noise = |variance: f64| variance.sqrt() * normal(&mut rng);
        let from = map.nearest_free([0.5 + noise(0.03), 1.7 + noise(0.05)]);
        let to = [from[0] + 1.0 + noise(0.02), from[1] + noise(0.02)];
        map.travel(from, to)
    });
    let (mean, covariance) = drawn_moments(drawn);
    let found = moments(&keeping, &sum);
    assert_near(&found.mean, &mean, 0.05);
    assert_near(&found.covariance, &covariance, 0.03);
}

/// Two angles on either side of the cut are near each other.
#[test]
fn angles_are_averaged_the_short_way() {
    let likeness = Likeness::new(vec![1e-6], &[VariableKind::Angle]);
    let at = |mean: f64| Component {
        weight: 0.5,
        mode: 0,
        mean: vec![mean],
        covariance: vec![0.01],
    };
    let mut one = at(3.1);
    likeness.merge(&mut one, &at(-3.1));
    assert!(
        (one.mean[0].abs() - std::f64::consts::PI).abs() < 1e-9,
        "{one:?}"
    );
    assert!(one.covariance[0] < 0.012, "{one:?}");
}

proptest! {
    /// Merging and reducing leave mean, covariance and weights of modes as they are.
    #[test]
    fn merging_keeps_moments(
        parts in prop::collection::vec((0.05..1.0_f64, 0..2_usize, prop::array::uniform6(-3.0..3.0_f64)), 2..12),
        most in 1..6_usize,
    ) {
        let total: f64 = parts.iter().map(|part| part.0).sum();
        let mut components: Vec<Component> = parts.iter().map(|(weight, mode, x)| Component {
            weight: weight / total,
            mode: *mode,
            mean: vec![x[0], x[1]],
            // Some of them singular.
            covariance: vec![x[2] * x[2], x[2] * x[3], x[2] * x[3], x[3] * x[3] + x[4].max(0.0)],
        }).collect();
        let of = |components: &[Component]| -> Vec<f64> {
            let total = |of: &dyn Fn(&Component) -> f64| components.iter().map(|c| c.weight * of(c)).sum::<f64>();
            let mean = [total(&|c| c.mean[0]), total(&|c| c.mean[1])];
            let entry = |k: usize| {
                let (i, j) = (k / 2, k % 2);
                total(&|c| c.covariance[k] + (c.mean[i] - mean[i]) * (c.mean[j] - mean[j]))
            };
            let modes = total(&|c| c.mode as f64);
            [mean[0], mean[1], modes].into_iter().chain((0..4).map(entry)).collect()
        };
        let likeness = Likeness::new(vec![1e-6; 2], &[VariableKind::Real; 2]);
        let before = of(&components);
        if components[0].mode == components[1].mode {
            let mut two = components[..2].to_vec();
            let one = two.remove(1);
            let both = of(&[two[0].clone(), one.clone()]);
            likeness.merge(&mut two[0], &one);
            let share = of(&two);
            prop_assert!((share[0] - both[0]).abs() < 1e-12);
        }
        likeness.reduce(&mut components, most);
        let after = of(&components);
        for (a, b) in before.iter().zip(&after) {
            prop_assert!((a - b).abs() < 1e-9, "{before:?} {after:?}");
        }
    }
}
