//! Sums of Gaussians against filters that are exact, fine grids and many draws.

mod acting;
mod merging;
mod sensing;
mod walls;

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
