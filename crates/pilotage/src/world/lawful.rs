//! Motion and sensing as a model's [`Dynamics`] say, formulas and all.

use nalgebra::DMatrix;

use super::noise::Noise;
use super::{Body, Doing, Observation};
use crate::model::{self, Dynamics, Model};
use crate::random::{Rng, uniform};

/// A state that moves and is sensed by the laws of a model.
pub(super) struct Lawful {
    dynamics: Dynamics,
    modes_seen: bool,
    covariance: Vec<f64>,
}

impl Lawful {
    pub(super) fn new(model: &Model) -> Self {
        let size = model.state_dim().max(model.sensor_dim());
        Self {
            dynamics: Dynamics::new(model),
            modes_seen: model.laws.modes_seen,
            covariance: vec![0.0; size * size],
        }
    }
}

impl From<Doing> for model::Doing {
    fn from(doing: Doing) -> Self {
        Self {
            mode: doing.mode,
            action: doing.action,
            step: doing.step,
        }
    }
}

/// Adds a draw from the Gaussian with that covariance, row by row.
fn add_noise(to: &mut [f64], covariance: &[f64], rng: &mut Rng) {
    if covariance.iter().any(|entry| *entry != 0.0) {
        let n = to.len();
        Noise::new(&DMatrix::from_row_slice(n, n, covariance)).add_to(to, rng);
    }
}

impl Body for Lawful {
    fn put(&mut self, state: &mut [f64]) {
        self.dynamics.round(state);
    }

    fn advance(&mut self, doing: Doing, from: &[f64], to: &mut [f64], rng: &mut Rng) {
        let covariance = &mut self.covariance[..from.len() * from.len()];
        self.dynamics.transition(doing.into(), from, to);
        self.dynamics
            .transition_noise(doing.into(), from, covariance);
        add_noise(to, covariance, rng);
        self.dynamics.round(to);
    }

    fn rest(&self, state: &mut [f64]) {
        self.dynamics.round_within(state);
    }

    fn present(&self, doing: Doing, state: &[f64]) -> Option<f64> {
        Some(self.dynamics.present(doing.into(), state))
    }

    fn sense(&self, doing: Doing, state: &[f64], observation: &mut Observation, rng: &mut Rng) {
        let (m, symbols) = (self.dynamics.readings(), self.dynamics.symbols());
        if symbols > 0 {
            let mut likely = vec![0.0; symbols];
            self.dynamics
                .symbol_probabilities(doing.into(), state, &mut likely);
            let mut chance = uniform(rng);
            let heard = likely.iter().position(|likely| {
                chance -= likely;
                chance < 0.0
            });
            // Rounding may leave a hair beyond the last signal that can be.
            let last = likely.iter().rposition(|likely| *likely > 0.0);
            return observation.signal(heard.or(last).unwrap_or(0) as u32);
        }
        let values = observation.values();
        if self.modes_seen {
            values[m] = doing.mode as f64;
        }
        let values = &mut values[..m];
        let mut covariance = vec![0.0; m * m];
        self.dynamics.observation(doing.into(), state, values);
        self.dynamics
            .observation_noise(doing.into(), state, &mut covariance);
        add_noise(values, &covariance, rng);
        for (value, ends) in values.iter_mut().zip(self.dynamics.saturates()) {
            *value = value.clamp(ends.low, ends.high);
        }
    }
}
