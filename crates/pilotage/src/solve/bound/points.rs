//! The bound where the state is one of two points and does not move: the tiger behind one of two doors.
//!
//! What the agent knows is the probability `p` of the second point. Every policy earns something linear in `p`, so the value is
//! convex: interpolated between beliefs at which it is not too low, it is too low nowhere. The expectation of the interpolated value
//! over the next reading has a closed form, since the log-odds move by a Gaussian: `N(d/2, d)` if the second point is true and
//! `N(-d/2, d)` if the first is, with `d` the squared distance of what is sensed, in units of the noise.

use nalgebra::DVector;

use super::step::{After, Doing};
use crate::belief::gaussian::normal_cdf;
use crate::belief::kalman::square_root;
use crate::model::{ActionId, ModeId, Model, Then};

/// Most sweeps; what an episode that is longer can still bring is bounded by the ceiling.
const MOST_SWEEPS: usize = 20_000;
/// Log-odds of the grid: from minus to plus this, in such steps.
const FARTHEST: f64 = 30.0;
const STEP: f64 = 0.05;

/// What an action brings at each of the two points, and what it does, the same at both.
struct Effect {
    rewards: [f64; 2],
    mode: ModeId,
    then: Then,
}

/// The bound, or why the model is not of this kind.
pub(super) fn bound(model: &Model) -> Result<f64, String> {
    let [first, second] = model.start.as_slice() else {
        return Err("its start is not one of two points".to_owned());
    };
    let n = model.state_dim();
    let at_rest = |action: ActionId| {
        model.displacement(action, 0).amax() == 0.0 && model.motion_noise(action, 0).amax() == 0.0
    };
    let still = model.motion.a == nalgebra::DMatrix::identity(n, n)
        && (0..model.actions.len()).all(at_rest);
    if !still
        || model
            .start
            .iter()
            .any(|start| start.covariance.amax() > 0.0)
    {
        return Err("its state is not at rest at one of two points".to_owned());
    }
    if first.mode != second.mode {
        return Err("its mode at the start is hidden".to_owned());
    }
    let places = [&first.mean, &second.mean];
    let effects = effects(model, places)?;
    let apart = &model.sensor.h * (&second.mean - &first.mean);
    let told: Vec<f64> = (0..model.actions.len())
        .map(|action| told(model, action, &apart))
        .collect();
    Ok(value(model, &effects, &told, second.weight, first.mode))
}

fn effects(model: &Model, places: [&DVector<f64>; 2]) -> Result<Vec<Vec<Effect>>, String> {
    let effect = |mode: ModeId, action: ActionId| {
        let doing = Doing::new(model, mode, action);
        let [one, other] = places.map(|at| {
            let before = doing.before(at.as_slice());
            let end = After {
                reward: 0.0,
                mode: before.mode,
                then: before.then,
            };
            let after = match before.then {
                Then::Continue => doing.after(&before, at.as_slice()),
                _ => end,
            };
            (before.reward + after.reward, after.mode, after.then)
        });
        match (one.1, one.2) == (other.1, other.2) {
            true => Ok(Effect {
                rewards: [one.0, other.0],
                mode: one.1,
                then: one.2,
            }),
            false => Err("it depends on the state whether an event happens".to_owned()),
        }
    };
    (0..model.modes.len())
        .map(|mode| (0..model.actions.len()).map(|a| effect(mode, a)).collect())
        .collect()
}

/// Squared distance of what is sensed at the two points, in units of the noise: endless where a reading without noise tells them
/// apart.
fn told(model: &Model, action: ActionId, apart: &DVector<f64>) -> f64 {
    let noise = model.sensor_noise(action, 0);
    let eigen = noise.clone().symmetric_eigen();
    let noisy = square_root(noise).ncols();
    let floor = eigen.eigenvalues.amax() * 1e-14;
    let squares = (0..apart.len()).map(|i| {
        let along = eigen.eigenvectors.column(i).dot(apart).powi(2);
        match eigen.eigenvalues[i] > floor && noisy > 0 {
            true => along / eigen.eigenvalues[i],
            false if along <= 1e-24 * apart.norm_squared() => 0.0,
            false => f64::INFINITY,
        }
    });
    squares.sum()
}

/// Beliefs at which the value is kept, by rising probability of the second point, with their log-odds.
struct Grid {
    odds: Vec<f64>,
    chances: Vec<f64>,
}

impl Grid {
    fn new(start: f64) -> Self {
        let count = (FARTHEST / STEP) as i32;
        let mut odds: Vec<f64> = (-count..=count).map(|k| f64::from(k) * STEP).collect();
        odds.extend([
            f64::NEG_INFINITY,
            f64::INFINITY,
            (start / (1.0 - start)).ln(),
        ]);
        odds.sort_by(f64::total_cmp);
        odds.dedup();
        let chances = odds.iter().map(|&odds| chance(odds)).collect();
        Self { odds, chances }
    }

    /// Weights of the grid in the expectation of the value after a reading, at one of its beliefs.
    fn weights(&self, at: usize, told: f64) -> Vec<f64> {
        let mut weights = vec![0.0; self.odds.len()];
        let (odds, p) = (self.odds[at], self.chances[at]);
        if odds.is_infinite() || told == 0.0 {
            weights[at] = 1.0;
            return weights;
        }
        let last = weights.len() - 1;
        if told == f64::INFINITY {
            (weights[0], weights[last]) = (1.0 - p, p);
            return weights;
        }
        let sd = told.sqrt();
        let below = |to: f64, drift: f64| normal_cdf((to - odds - drift) / sd);
        for k in 0..last {
            let (low, high) = (self.odds[k], self.odds[k + 1]);
            // Both probabilities of ending in between, each together with that of the point.
            let share = |drift: f64| {
                let centre = odds + drift;
                match low > centre {
                    true => below(2.0 * centre - low, drift) - below(2.0 * centre - high, drift),
                    false => below(high, drift) - below(low, drift),
                }
            };
            let second = p * share(0.5 * told);
            let both = second + (1.0 - p) * share(-0.5 * told);
            let (from, to) = (self.chances[k], self.chances[k + 1]);
            // The value there is linear in the next `p`, whose mean times the probability is `second`.
            let upper = if to > from {
                ((second - from * both) / (to - from)).clamp(0.0, both)
            } else {
                0.0
            };
            weights[k + 1] += upper;
            weights[k] += both - upper;
        }
        weights
    }
}

fn chance(odds: f64) -> f64 {
    1.0 / (1.0 + (-odds).exp())
}

fn value(
    model: &Model,
    effects: &[Vec<Effect>],
    told: &[f64],
    start: f64,
    start_mode: ModeId,
) -> f64 {
    let grid = Grid::new(start);
    let size = grid.odds.len();
    let mut classes: Vec<f64> = told.to_vec();
    classes.sort_by(f64::total_cmp);
    classes.dedup();
    let class_of = |action: ActionId| classes.iter().position(|class| *class == told[action]);
    let weights: Vec<Vec<Vec<f64>>> = classes
        .iter()
        .map(|&told| (0..size).map(|at| grid.weights(at, told)).collect())
        .collect();
    let sweeps = model.episode.length.min(MOST_SWEEPS);
    let rest = super::ceiling::Ceiling::new(model).within(model.episode.length - sweeps);
    let mut values = vec![vec![rest; size]; effects.len()];
    let mut start_value = rest;
    let place = grid
        .chances
        .iter()
        .position(|&p| p >= chance((start / (1.0 - start)).ln()));
    let place = place.unwrap_or(size - 1);
    for _ in 0..sweeps {
        let expect = |class: usize, mode: ModeId| -> Vec<f64> {
            let of = |row: &Vec<f64>| row.iter().zip(&values[mode]).map(|(w, v)| w * v).sum();
            weights[class].iter().map(of).collect()
        };
        let expected: Vec<Vec<Vec<f64>>> = (0..classes.len())
            .map(|class| (0..effects.len()).map(|mode| expect(class, mode)).collect())
            .collect();
        let worth = |mode: ModeId, at: usize| {
            let of = |(action, effect): (ActionId, &Effect)| {
                let p = grid.chances[at];
                let future = match effect.then {
                    Then::Continue => {
                        class_of(action).map_or(0.0, |class| expected[class][effect.mode][at])
                    }
                    Then::Restart => start_value,
                    Then::End => 0.0,
                };
                (1.0 - p) * effect.rewards[0] + p * effect.rewards[1] + model.discount * future
            };
            effects[mode]
                .iter()
                .enumerate()
                .map(of)
                .fold(f64::NEG_INFINITY, f64::max)
        };
        let fresh: Vec<Vec<f64>> = (0..effects.len())
            .map(|mode| (0..size).map(|at| worth(mode, at)).collect())
            .collect();
        let difference = |pick: fn(f64) -> f64| {
            let pairs = fresh.iter().flatten().zip(values.iter().flatten());
            pairs.map(|(new, old)| pick(new - old)).fold(0.0, f64::max)
        };
        let (change, rise) = (difference(f64::abs), difference(|step| step));
        values = fresh;
        start_value = values[start_mode][place];
        // What all further steps can add.
        let further = |step: f64| step / (1.0 - model.discount);
        if model.discount < 1.0 && further(change) <= 1e-9 * start_value.abs() {
            return start_value + further(rise);
        }
    }
    start_value
}
