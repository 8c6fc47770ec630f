//! The posterior of a Gaussian along a line, whatever it looks like: panels are halved where what they hold is not yet known.

use smallvec::smallvec;

use super::frame::{Frame, Inner};
use super::sensor::Sensor;

/// Standard deviations of the prior that panels reach.
const REACH: f64 = 6.0;

/// Ends of the first panels, in standard deviations of the prior on one side.
const WIDE: [f64; 3] = [0.7, 1.8, 3.5];

/// The same around where the posterior is guessed to be, in its own.
const NEAR: [f64; 3] = [1.0, 3.0, 8.0];

/// Times that a panel is halved at most.
const HALVINGS: usize = 16;

/// Shares of the whole by which a panel and its halves may differ.
const TOLERANCE: f64 = 3e-4;

/// Lighter panels count as nothing.
const NOTHING: f64 = 1e-7;

/// Gauss-Legendre rule of five points on [-1, 1], its weights summing to 1.
const RULE: [(f64, f64); 5] = [
    (-0.906_179_845_938_664, 0.118_463_442_528_094_5),
    (-0.538_469_310_105_683_1, 0.239_314_335_249_683_2),
    (0.0, 0.284_444_444_444_444_4),
    (0.538_469_310_105_683_1, 0.239_314_335_249_683_2),
    (0.906_179_845_938_664, 0.118_463_442_528_094_5),
];

/// A part of the line with what of the posterior it holds.
#[derive(Clone, Copy)]
struct Panel {
    low: f64,
    high: f64,
    /// Logarithm of its mass.
    log: f64,
    mean: f64,
    variance: f64,
    settled: bool,
}

impl Panel {
    fn new(low: f64, high: f64, log_density: &mut impl FnMut(f64) -> f64) -> Self {
        let (centre, half) = (0.5 * (low + high), 0.5 * (high - low));
        let logs = RULE.map(|(x, _)| log_density(centre + half * x));
        let best = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let (mut total, mut first, mut second) = (0.0, 0.0, 0.0);
        if best.is_finite() {
            for ((x, share), log) in RULE.iter().zip(&logs) {
                let weight = share * (log - best).exp();
                total += weight;
                first += weight * x;
                second += weight * x * x;
            }
            first /= total;
            second = (second / total - first * first).max(0.0);
        }
        Self {
            low,
            high,
            log: best + (2.0 * half * total).ln(),
            mean: centre + half * first,
            variance: half * half * second,
            settled: false,
        }
    }
}

/// Posterior of a standard normal in the one coordinate of a frame, in so many pieces at most, side by side: each with its share and its
/// moments. Besides, the logarithm of the evidence. `guess` says where the posterior may be found.
pub(super) fn pieces(
    sensor: &mut Sensor<'_>,
    frame: &Frame,
    guess: &Inner,
    most: usize,
) -> (f64, Vec<(f64, Inner)>) {
    let mut at = vec![0.0; frame.dim()];
    let mut log_density = |z: f64| {
        frame.place(&[z], &mut at);
        sensor.log_likelihood(&at) - 0.5 * z * z
    };
    let ends = ends(guess);
    let panels = ends.windows(2);
    let mut panels: Vec<Panel> = panels
        .map(|ends| Panel::new(ends[0], ends[1], &mut log_density))
        .collect();
    for _ in 0..HALVINGS {
        let whole = log_of_sum(&panels);
        if !whole.is_finite() || panels.iter().all(|panel| panel.settled) {
            break;
        }
        let mut finer = Vec::with_capacity(2 * panels.len());
        for mut panel in panels {
            if panel.settled || panel.log < whole + NOTHING.ln() {
                panel.settled = true;
                finer.push(panel);
                continue;
            }
            let middle = 0.5 * (panel.low + panel.high);
            let mut halves = [
                Panel::new(panel.low, middle, &mut log_density),
                Panel::new(middle, panel.high, &mut log_density),
            ];
            let mass = |panel: &Panel| (panel.log - whole).exp();
            let change = (mass(&halves[0]) + mass(&halves[1]) - mass(&panel)).abs();
            for half in &mut halves {
                half.settled = change < TOLERANCE;
            }
            finer.extend(halves);
        }
        panels = finer;
    }
    let whole = log_of_sum(&panels);
    (
        whole - 0.5 * super::frame::LOG_TAU,
        gathered(&panels, whole, most),
    )
}

/// Ends of the first panels.
fn ends(guess: &Inner) -> Vec<f64> {
    let (mean, sd) = (guess.mean[0], guess.covariance[0].max(0.0).sqrt());
    let sides = |centre: f64, scale: f64, steps: [f64; 3]| {
        steps
            .into_iter()
            .flat_map(move |step| [centre - scale * step, centre + scale * step])
    };
    let (low, high) = ((mean - 8.0 * sd).min(-REACH), (mean + 8.0 * sd).max(REACH));
    let mut ends = vec![low, high];
    ends.extend(sides(0.0, 1.0, WIDE));
    // A posterior as wide as the prior is seen from there.
    if sd < 0.5 || mean.abs() > REACH {
        ends.push(mean);
        ends.extend(sides(mean, sd, NEAR));
    }
    ends.sort_by(f64::total_cmp);
    ends.dedup_by(|a, b| *a - *b <= 1e-12 * b.abs());
    ends
}

fn log_of_sum(panels: &[Panel]) -> f64 {
    let best = panels
        .iter()
        .fold(f64::NEG_INFINITY, |best, p| best.max(p.log));
    if !best.is_finite() {
        return best;
    }
    let total: f64 = panels.iter().map(|panel| (panel.log - best).exp()).sum();
    best + total.ln()
}

/// Panels put together to at most so many pieces of about the same mass.
fn gathered(panels: &[Panel], whole: f64, most: usize) -> Vec<(f64, Inner)> {
    let mut pieces: Vec<(f64, f64, f64)> = Vec::new();
    let mut passed = 0.0;
    let mut last = usize::MAX;
    for panel in panels {
        let share = (panel.log - whole).exp();
        if share < NOTHING || !share.is_finite() {
            continue;
        }
        let group = (((passed + 0.5 * share) * most as f64) as usize).min(most - 1);
        passed += share;
        match pieces.last_mut() {
            Some((weight, mean, variance)) if group == last => {
                let total = *weight + share;
                let (a, b) = (*weight / total, share / total);
                let apart = panel.mean - *mean;
                *variance = a * *variance + b * panel.variance + a * b * apart * apart;
                *mean += b * apart;
                *weight = total;
            }
            _ => pieces.push((share, panel.mean, panel.variance)),
        }
        last = group;
    }
    let inner = |(weight, mean, variance)| {
        let inner = Inner {
            mean: smallvec![mean],
            covariance: smallvec![variance],
        };
        (weight, inner)
    };
    pieces.into_iter().map(inner).collect()
}
