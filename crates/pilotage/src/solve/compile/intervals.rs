//! Placing nodes on a line.

use super::Band;
use crate::belief::Belief;
use crate::model::ActionId;
use crate::policy::{Automaton, Matching, Node, Place, Policy};

/// Points asked between the least and the greatest mean that were met.
const SCAN: usize = 2000;
const BISECTIONS: usize = 50;

/// An interval of means with one action.
struct Run {
    low: f64,
    high: f64,
    action: ActionId,
}

/// Adds the nodes of a band.
pub(super) fn place(automaton: &mut Automaton, policy: &dyn Policy, band: &Band) {
    let decided = band.decisions.iter().map(|(mean, _)| mean[0]);
    let means = decided.chain(band.beside.iter().map(|mean| mean[0]));
    let (low, high) = means.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
        (low.min(x), high.max(x))
    });
    let at = |x: f64| Belief {
        stratum: band.levels.1,
        mode: band.mode,
        mean: vec![x],
    };
    let mut runs = runs(&|x| policy.action(&at(x)), low, high);
    clear_borders(&mut runs, band);
    let add = |automaton: &mut Automaton, place: Place, action: ActionId, value: Option<f64>| {
        automaton.nodes.push(Node::new(
            band.levels.0..=band.levels.1,
            band.mode,
            place,
            action,
            value,
        ));
    };
    match automaton.matching {
        Matching::Segments => {
            for run in &runs {
                let (minimum, value) = least(policy, &at, run);
                let place = Place::Segment {
                    lower: vec![run.low],
                    minimum: vec![minimum],
                    upper: vec![run.high],
                };
                add(automaton, place, run.action, value);
            }
        }
        Matching::Nearest | Matching::Tree => {
            for (x, action) in points(&runs) {
                add(
                    automaton,
                    Place::Point(vec![x]),
                    action,
                    policy.value(&at(x)),
                );
            }
        }
    }
}

/// The intervals on which the action stays the same, their borders found by bisection.
fn runs(action: &dyn Fn(f64) -> ActionId, low: f64, high: f64) -> Vec<Run> {
    let mut runs = vec![Run {
        low,
        high,
        action: action(low),
    }];
    for k in 1..=SCAN {
        let x = low + (high - low) * k as f64 / SCAN as f64;
        let here = action(x);
        let last = runs.len() - 1;
        if here == runs[last].action {
            continue;
        }
        let (mut left, mut right) = (low + (high - low) * (k - 1) as f64 / SCAN as f64, x);
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (left + right);
            if action(middle) == runs[last].action {
                left = middle
            } else {
                right = middle
            }
        }
        runs[last].high = right;
        runs.push(Run {
            low: right,
            high,
            action: here,
        });
    }
    runs
}

/// A border that falls on a belief that is met, as happens without noise, is moved a hair to its other side: rounding would decide
/// otherwise.
fn clear_borders(runs: &mut [Run], band: &Band) {
    const HAIR: f64 = 1e-10;
    for k in 1..runs.len() {
        let border = runs[k].low;
        let hair = HAIR * border.abs().max(1.0);
        let mut met = band.decisions.iter();
        if let Some((_, owner)) = met.find(|(mean, _)| (mean[0] - border).abs() <= hair) {
            let clear = if *owner == runs[k].action {
                border - hair
            } else {
                border + hair
            };
            (runs[k - 1].high, runs[k].low) = (clear, clear);
        }
    }
}

fn least(policy: &dyn Policy, at: &dyn Fn(f64) -> Belief, run: &Run) -> (f64, Option<f64>) {
    const STEPS: usize = 40;
    let points = (0..=STEPS).map(|k| {
        let x = run.low + (run.high - run.low) * k as f64 / STEPS as f64;
        x.min(run.high)
    });
    points
        .map(|x| (x, policy.value(&at(x))))
        .min_by(|a, b| a.1.partial_cmp(&b.1).unwrap_or(std::cmp::Ordering::Equal))
        .unwrap_or((run.low, None))
}

/// Points whose midpoints are the borders: one in each interval where that is possible, otherwise one on either side of every
/// border.
fn points(runs: &[Run]) -> Vec<(f64, ActionId)> {
    if let [only] = runs {
        return vec![(0.5 * (only.low + only.high), only.action)];
    }
    // With the first point at `x`, every other is `offset + sign * x`: the point before it mirrored at the border.
    let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
    let (mut offset, mut sign) = (0.0, 1.0);
    let mut placed = Vec::new();
    for (k, run) in runs.iter().enumerate() {
        if k > 0 {
            offset = 2.0 * run.low - offset;
            sign = -sign;
        }
        placed.push((offset, sign, run.action));
        // The outer intervals go on for ever.
        let from = if k == 0 { f64::NEG_INFINITY } else { run.low };
        let to = if k + 1 == runs.len() {
            f64::INFINITY
        } else {
            run.high
        };
        let (a, b) = (sign * (from - offset), sign * (to - offset));
        low = low.max(a.min(b));
        high = high.min(a.max(b));
    }
    // Points crammed against the borders would be borders only to the last digit.
    let widths = runs.iter().map(|run| run.high - run.low);
    let room = 0.1 * widths.fold(f64::INFINITY, f64::min);
    if low + room < high {
        let natural = 0.5 * (runs[0].low + runs[0].high);
        let x = match (low.is_finite(), high.is_finite()) {
            (true, true) => 0.5 * (low + high),
            _ => natural.clamp(low + 0.05, high - 0.05),
        };
        return placed
            .into_iter()
            .map(|(offset, sign, action)| (offset + sign * x, action))
            .collect();
    }
    runs.windows(2)
        .flat_map(|pair| {
            let border = pair[0].high;
            let reach = 0.5 * (pair[0].high - pair[0].low).min(pair[1].high - pair[1].low);
            [
                (border - reach, pair[0].action),
                (border + reach, pair[1].action),
            ]
        })
        .collect()
}
