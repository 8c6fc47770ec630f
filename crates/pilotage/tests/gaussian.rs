//! Probabilities and expectations under a Gaussian, against formulas that are known and sums that are dumb.
#![allow(clippy::unwrap_used)]

mod common;

use common::Numbers;
use nalgebra::{DMatrix, DVector};
use pilotage::belief::gaussian::{interval_probability, region_probability};
use pilotage::model::{Interval, Region};
use pilotage::solve::kbvi::formulas::{IntegralFormula, Line, ramp_lines};
use proptest::prelude::*;

const INF: f64 = f64::INFINITY;

/// Simpson's rule over `panels` (even) stretches: points with their weights.
fn simpson(low: f64, high: f64, panels: usize) -> Vec<(f64, f64)> {
    let step = (high - low) / panels as f64;
    (0..=panels)
        .map(|k| {
            let factor = match k {
                0 => 1.0,
                k if k == panels => 1.0,
                k if k % 2 == 1 => 4.0,
                _ => 2.0,
            };
            (low + step * k as f64, factor * step / 3.0)
        })
        .collect()
}

/// The density summed over the box, point by point. Sides without end are cut at eight standard deviations.
fn brute_force(
    mean: &[f64],
    covariance: &DMatrix<f64>,
    sides: &[(f64, f64)],
    panels: usize,
) -> f64 {
    let n = mean.len();
    let inverse = covariance.clone().try_inverse().unwrap();
    let scale = (std::f64::consts::TAU.powi(n as i32) * covariance.determinant()).sqrt();
    let rules: Vec<Vec<(f64, f64)>> = (0..n)
        .map(|i| {
            let reach = 8.0 * covariance[(i, i)].sqrt();
            let low = sides[i].0.max(mean[i] - reach);
            let high = sides[i].1.min(mean[i] + reach);
            simpson(low, high.max(low), panels)
        })
        .collect();
    let mut sum = 0.0;
    let mut digits = vec![0; n];
    loop {
        let apart = DVector::from_fn(n, |i, _| rules[i][digits[i]].0 - mean[i]);
        let weight: f64 = (0..n).map(|i| rules[i][digits[i]].1).product();
        sum += weight * (-0.5 * apart.dot(&(&inverse * &apart))).exp();
        let Some(place) = (0..n).rev().find(|&i| digits[i] < panels) else {
            return sum / scale;
        };
        digits[place] += 1;
        digits[place + 1..].fill(0);
    }
}

fn region(sides: &[(f64, f64)]) -> Region {
    let sides = sides.iter().enumerate();
    Region::new(
        sides
            .map(|(i, &(low, high))| (i, Interval::new(low, high)))
            .collect(),
    )
}

/// The standard normal cdf.
fn normal_cdf(x: f64) -> f64 {
    interval_probability(0.0, 1.0, Interval::new(-INF, x))
}

#[test]
fn the_normal_cdf_keeps_its_digits() {
    // Abramowitz and Stegun, table 26.1 and 26.2.
    for (x, expected) in [
        (0.0, 0.5),
        (1.0, 0.841_344_746_068_542_9),
        (-2.5, 0.006_209_665_325_776_132),
        (-10.0, 7.619_853_024_160_527e-24),
    ] {
        let value = normal_cdf(x);
        assert!((value / expected - 1.0).abs() < 1e-13, "{x}: {value:e}");
    }
}

#[test]
fn an_interval_far_out_keeps_its_digits() {
    let upper = interval_probability(0.0, 1.0, Interval::new(9.0, 10.0));
    let lower = interval_probability(0.0, 1.0, Interval::new(-10.0, -9.0));
    assert_eq!(upper, lower);
    // Phi(-9) - Phi(-10)
    assert!(
        (upper / (1.128_588_405_953_840_6e-19 - 7.619_853_024_160_527e-24) - 1.0).abs() < 1e-12
    );
}

#[test]
fn without_variance_a_point_is_inside_or_not() {
    let goal = Interval::new(3.0, 4.0);
    let at = |mean| interval_probability(mean, 0.0, goal);
    assert_eq!([2.9, 3.0, 3.9, 4.0].map(at), [0.0, 1.0, 1.0, 0.0]);
}

/// Orthants of correlated Gaussians have closed forms (W. F. Sheppard, 1899).
#[test]
fn orthants() {
    for rho in [-0.99_f64, -0.9, -0.5, 0.1, 0.6, 0.9, 0.99, 0.999] {
        let covariance = DMatrix::from_row_slice(2, 2, &[4.0, 2.0 * rho, 2.0 * rho, 1.0]);
        let exact = 0.25 + rho.asin() / std::f64::consts::TAU;
        let found = region_probability(
            &[1.0, -2.0],
            &covariance,
            &region(&[(1.0, INF), (-2.0, INF)]),
        );
        assert!((found - exact).abs() < 1e-9, "{rho}: {found} and {exact}");
    }
    for (r12, r13, r23) in [
        (0.5_f64, 0.5_f64, 0.5_f64),
        (-0.4, 0.3, 0.2),
        (0.9, 0.8, 0.85),
    ] {
        #[rustfmt::skip]
        let covariance = DMatrix::from_row_slice(3, 3, &[
            1.0, r12, r13,
            r12, 1.0, r23,
            r13, r23, 1.0,
        ]);
        let sum = r12.asin() + r13.asin() + r23.asin();
        let exact = 0.125 + sum / (2.0 * std::f64::consts::TAU);
        let found = region_probability(&[0.0; 3], &covariance, &region(&[(-INF, 0.0); 3]));
        assert!((found - exact).abs() < 1e-9, "{found} and {exact}");
    }
}

/// Two variables that are the same one: a corner of the box is an interval.
#[test]
fn perfectly_correlated_variables() {
    let covariance = DMatrix::from_element(2, 2, 1.0);
    let found = region_probability(
        &[0.0, 0.0],
        &covariance,
        &region(&[(-1.0, 2.0), (0.5, 3.0)]),
    );
    let exact = normal_cdf(2.0) - normal_cdf(0.5);
    assert!((found - exact).abs() < 1e-9, "{found} and {exact}");
}

/// Brute force is exact to 1e-9 here: Simpson's error at a twentieth of a standard deviation a panel.
#[test]
fn boxes_in_three_dimensions() {
    #[rustfmt::skip]
    let covariances = [
        [1.0, 0.5, 0.2, 0.5, 1.0, -0.3, 0.2, -0.3, 1.0],
        [2.0, -1.0, 0.0, -1.0, 1.5, 0.4, 0.0, 0.4, 0.7],
    ];
    let boxes = [
        [(-1.0, 1.0), (-0.5, 2.0), (0.0, 1.5)],
        [(0.5, 2.5), (-2.0, 0.0), (-1.0, 0.3)],
    ];
    for covariance in covariances {
        let covariance = DMatrix::from_row_slice(3, 3, &covariance);
        for sides in boxes {
            let mean = [0.2, -0.1, 0.4];
            let found = region_probability(&mean, &covariance, &region(&sides));
            let expected = brute_force(&mean, &covariance, &sides, 60);
            assert!((found - expected).abs() < 1e-6, "{found} and {expected}");
        }
    }
}

/// Which variables a region leaves open, and in which order it names the others, does not matter.
#[test]
fn free_variables_do_not_count() {
    let covariance = DMatrix::from_row_slice(3, 3, &[1.0, 0.5, 0.6, 0.5, 1.0, 0.2, 0.6, 0.2, 1.0]);
    let side = Interval::new(-0.3, 0.9);
    let only = Region::new(vec![(2, side)]);
    let found = region_probability(&[0.1, 0.2, 0.3], &covariance, &only);
    assert_eq!(found, interval_probability(0.3, 1.0, side));
    let stated = Region::new(vec![(0, Interval::ALL), (2, side), (1, Interval::ALL)]);
    assert_eq!(
        found,
        region_probability(&[0.1, 0.2, 0.3], &covariance, &stated)
    );
    let everywhere = region_probability(&[0.1, 0.2, 0.3], &covariance, &Region::everywhere());
    assert_eq!(everywhere, 1.0);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    /// Brute force is exact to about 1e-8 here: panels are at most 0.16 of the smallest standard deviation across.
    #[test]
    fn boxes_in_two_dimensions(
        numbers in proptest::collection::vec(-1.0..1.0_f64, 16),
        corners in proptest::array::uniform4(-2.0..2.0_f64),
        open in 0..3_usize,
    ) {
        let mut numbers = Numbers::new(&numbers);
        let covariance = numbers.covariance(2, 2, 0.1);
        let mean = numbers.vector(2);
        let [a, b, c, d] = corners;
        let mut sides = [(a.min(b), a.max(b)), (c.min(d), c.max(d))];
        match open {
            1 => sides[0].0 = -INF,
            2 => sides[1].1 = INF,
            _ => {}
        }
        let found = region_probability(mean.as_slice(), &covariance, &region(&sides));
        let expected = brute_force(mean.as_slice(), &covariance, &sides, 300);
        prop_assert!((found - expected).abs() < 1e-6, "{} and {}", found, expected);
    }

    /// Boxes side by side add up.
    #[test]
    fn probabilities_add(
        numbers in proptest::collection::vec(-1.0..1.0_f64, 16),
        cut in -1.0..1.0_f64,
    ) {
        let mut numbers = Numbers::new(&numbers);
        let covariance = numbers.covariance(2, 2, 0.05);
        let of = |x: (f64, f64)| region_probability(&[0.1, 0.2], &covariance, &region(&[x, (-0.5, 0.7)]));
        prop_assert!((of((-1.0, cut)) + of((cut, 1.0)) - of((-1.0, 1.0))).abs() < 1e-9);
    }
}

/// Eq. 5.14 for `2 s - 1` on [0.2, 1.5] under N(0.7, 0.3): as printed it is wrong by a factor of three.
#[test]
fn the_integral_of_a_line() {
    let line = Line {
        range: Interval::new(0.2, 1.5),
        slope: 2.0,
        intercept: -1.0,
    };
    let numeric: f64 = simpson(0.2, 1.5, 2000)
        .iter()
        .map(|(s, weight)| {
            let density =
                (-(s - 0.7) * (s - 0.7) / 0.6).exp() / (0.3 * std::f64::consts::TAU).sqrt();
            weight * density * (2.0 * s - 1.0)
        })
        .sum();
    assert!((numeric - 0.436612).abs() < 5e-7);
    let exact = line.expectation(0.7, 0.3, IntegralFormula::Exact);
    assert!((exact - numeric).abs() < 1e-12);
    let printed = line.expectation(0.7, 0.3, IntegralFormula::Printed);
    assert!((printed - 0.152429).abs() < 5e-7);
}

fn ramp(side: Interval, sd: f64, mean: f64) -> f64 {
    let lines = ramp_lines(side, sd);
    lines
        .iter()
        .map(|line| line.expectation(mean, 0.0, IntegralFormula::Exact))
        .sum()
}

/// At one edge the ramp is wrong by at most 0.145, 1.18 standard deviations away from it, whatever the uncertainty.
#[test]
fn the_ramp_is_off_by_0_145() {
    for variance in [0.01, 0.233, 0.3, 5.0] {
        let sd = f64::sqrt(variance);
        for side in [
            Interval::new(3.0, INF),
            Interval::new(-INF, 3.0),
            Interval::new(3.0, 3.0 + 20.0 * sd),
        ] {
            let (error, at) = (-4000..=4000)
                .map(|k| {
                    let from_edge = f64::from(k) / 1000.0;
                    let mean = 3.0 + from_edge * sd;
                    let error = ramp(side, sd, mean) - interval_probability(mean, variance, side);
                    (error.abs(), from_edge.abs())
                })
                .fold(
                    (0.0, 0.0),
                    |worst, now| if now.0 > worst.0 { now } else { worst },
                );
            assert!((error - 0.145).abs() < 5e-4, "{error}");
            assert!((at - 1.18).abs() < 5e-3, "{at}");
        }
    }
}

/// Where the ramps of two edges meet, the lower counts: the peak in the middle of the goal.
#[test]
fn ramps_that_meet() {
    let goal = Interval::new(3.0, 4.0);
    for (variance, ramped, exact) in [
        (0.233, 0.7072, 0.6997),
        (0.1, 0.8162, 0.8862),
        (0.3, 0.6826, 0.6387),
    ] {
        assert!((ramp(goal, f64::sqrt(variance), 3.5) - ramped).abs() < 5e-5);
        assert!((interval_probability(3.5, variance, goal) - exact).abs() < 5e-5);
    }
    assert_eq!(ramp(goal, 0.0, 3.5), 1.0);
    assert_eq!(ramp(goal, 0.0, 4.5), 0.0);
}

/// The lines of a ramp against a Gaussian mean: the sum is the integral of what they draw.
#[test]
fn the_ramp_over_a_gaussian_mean() {
    let goal = Interval::new(3.0, 4.0);
    let (sd, mean, variance) = (0.5, 2.6, 0.4_f64);
    let closed: f64 = ramp_lines(goal, sd)
        .iter()
        .map(|line| line.expectation(mean, variance, IntegralFormula::Exact))
        .sum();
    let numeric: f64 = simpson(mean - 6.0, mean + 6.0, 40_000)
        .iter()
        .map(|(m, weight)| {
            let z = (m - mean) / variance.sqrt();
            weight * ramp(goal, sd, *m) * (-0.5 * z * z).exp()
                / (variance * std::f64::consts::TAU).sqrt()
        })
        .sum();
    assert!((closed - numeric).abs() < 1e-6, "{closed} and {numeric}");
}
