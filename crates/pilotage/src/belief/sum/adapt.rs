//! Posterior moments by a quadrature that is moved to where the posterior is (J. Naylor and A. Smith, 1982).

use smallvec::smallvec;

use super::frame::{self, Few, Frame, Inner, root_into};
use super::quadrature::Rule;
use super::sensor::Sensor;

/// Times that the points are moved at most.
const ROUNDS: usize = 5;

/// Points are spread by so much more variance than was found: a posterior has heavier tails than it seems.
const WIDER: f64 = 1.2;

/// Moments that change by less, in standard deviations, have settled: points this near find them.
const SETTLED: f64 = 0.15;

/// The variance that a round leaves at least, as a share of that before: points that are too far apart see only one of them.
const LEAST: f64 = 0.02;

/// What was found.
pub(super) struct Adapted {
    /// Logarithm of the evidence.
    pub(super) log: f64,
    /// Whether the points have found the posterior where they are.
    pub(super) settled: bool,
}

/// Room for what is found on the way.
#[derive(Default)]
pub(super) struct Room {
    places: Vec<f64>,
    weights: Vec<f64>,
}

/// Finds the posterior of a standard normal in the coordinates of a frame, from a guess that it takes the place of.
pub(super) fn adapt(
    sensor: &mut Sensor<'_>,
    frame: &Frame,
    rule: &Rule,
    found: &mut Inner,
    room: &mut Room,
) -> Adapted {
    let r = frame.rank;
    let mut at: Few = smallvec![0.0; frame.dim()];
    let mut spread: Few = smallvec![0.0; r * r];
    let Room { places, weights } = room;
    places.resize(rule.weights.len() * r, 0.0);
    weights.resize(rule.weights.len(), 0.0);
    let mut log = f64::NEG_INFINITY;
    for _ in 0..ROUNDS {
        let wide = |k: usize| WIDER * found.covariance[k];
        let wide: Few = (0..r * r).map(wide).collect();
        root_into(&wide, r, &mut spread);
        let volume = (0..r).map(|i| spread[i * r + i]).product::<f64>().ln();
        if !volume.is_finite() {
            break;
        }
        let points = places.chunks_exact_mut(r).zip(weights.iter_mut());
        for ((place, weight), (node, share)) in points.zip(rule.over_density()) {
            frame::place(&found.mean, &spread, node, place);
            let squares: f64 = place.iter().map(|z| z * z).sum();
            frame.place(place, &mut at);
            *weight = sensor.log_likelihood(&at) - 0.5 * squares + share;
        }
        let best = weights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if !best.is_finite() {
            break;
        }
        let mut total = 0.0;
        for weight in weights.iter_mut() {
            *weight = (*weight - best).exp();
            total += *weight;
        }
        log = best + total.ln() + volume;
        if gather(places, weights, total, found) < SETTLED {
            return Adapted { log, settled: true };
        }
    }
    Adapted {
        log,
        settled: false,
    }
}

/// Takes in the moments of weighted points; returns how much they have changed.
fn gather(places: &[f64], weights: &[f64], total: f64, found: &mut Inner) -> f64 {
    // Loops whose lengths are known are unrolled.
    match found.mean.len() {
        1 => gather_in(1, places, weights, total, found),
        2 => gather_in(2, places, weights, total, found),
        r => gather_in(r, places, weights, total, found),
    }
}

#[inline(always)]
fn gather_in(r: usize, places: &[f64], weights: &[f64], total: f64, found: &mut Inner) -> f64 {
    let mut change: f64 = 0.0;
    let mut mean: Few = smallvec![0.0; r];
    for (place, weight) in places.chunks_exact(r).zip(weights) {
        for (sum, x) in mean.iter_mut().zip(place) {
            *sum += weight / total * x;
        }
    }
    let mut covariance: Few = smallvec![0.0; r * r];
    for (place, weight) in places.chunks_exact(r).zip(weights) {
        for i in 0..r {
            for j in 0..=i {
                covariance[i * r + j] +=
                    weight / total * (place[i] - mean[i]) * (place[j] - mean[j]);
            }
        }
    }
    for i in 0..r {
        let before = found.covariance[i * r + i];
        let own = &mut covariance[i * r + i];
        *own = own.max(LEAST * before);
        let variance = own.max(f64::MIN_POSITIVE);
        change = change.max((mean[i] - found.mean[i]).abs() / variance.sqrt());
        change = change.max(0.5 * (before / variance).ln().abs());
        for j in 0..i {
            covariance[j * r + i] = covariance[i * r + j];
        }
    }
    found.mean = mean;
    found.covariance = covariance;
    change
}
