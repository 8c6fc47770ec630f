//! Linear motion and sensing, `s' = A s + B u + v`, `o = H s + n`, with the true noise and controls where a scenario states them.

use super::Body;
use super::noise::Noise;
use crate::model::{ActionId, ModeId};
use crate::random::Rng;
use crate::scenario::Scenario;

/// The linear sensor of a model.
#[derive(Debug, Clone)]
pub(super) struct LinearSensor {
    /// `H`, row by row.
    h: Vec<f64>,
    /// By action.
    noise: Vec<Noise>,
}

impl LinearSensor {
    pub fn new(scenario: &Scenario) -> Self {
        let model = &scenario.model;
        let actions = 0..model.actions.len();
        Self {
            h: model.sensor.h.transpose().as_slice().to_vec(),
            noise: actions
                .map(|action| Noise::new(model.sensor_noise(action)))
                .collect(),
        }
    }

    pub fn sense(&self, action: ActionId, state: &[f64], observation: &mut [f64], rng: &mut Rng) {
        let rows = self.h.chunks_exact(state.len());
        for (reading, row) in observation.iter_mut().zip(rows) {
            *reading = row.iter().zip(state).map(|(h, s)| h * s).sum();
        }
        self.noise[action].add_to(observation, rng);
    }
}

/// A state that moves and is sensed linearly.
#[derive(Debug, Clone)]
pub(super) struct Linear {
    /// `A`, row by row.
    a: Vec<f64>,
    /// `B u`, by mode and action.
    displacements: Vec<Vec<Vec<f64>>>,
    /// By action.
    noise: Vec<Noise>,
    sensor: LinearSensor,
}

impl Linear {
    pub fn new(scenario: &Scenario) -> Self {
        let model = &scenario.model;
        let actions = 0..model.actions.len();
        let truly = |action| {
            let stated = scenario.truth.motion.noise.as_ref();
            Noise::new(stated.unwrap_or_else(|| model.motion_noise(action)))
        };
        Self {
            a: model.motion.a.transpose().as_slice().to_vec(),
            displacements: (0..model.modes.len())
                .map(|mode| {
                    let displacement = |action| displacement(scenario, mode, action);
                    actions.clone().map(displacement).collect()
                })
                .collect(),
            noise: actions.map(truly).collect(),
            sensor: LinearSensor::new(scenario),
        }
    }
}

/// True `B u` of an action in a mode.
fn displacement(scenario: &Scenario, mode: ModeId, action: ActionId) -> Vec<f64> {
    let model = &scenario.model;
    let mut controls = scenario.truth.motion.controls.iter();
    let truly = controls.find(|control| control.applies(mode, action));
    let control = truly.map_or(&model.actions[action].control, |truly| &truly.control);
    (&model.motion.b * control).as_slice().to_vec()
}

impl Body for Linear {
    fn advance(
        &mut self,
        (mode, action): (ModeId, ActionId),
        from: &[f64],
        to: &mut [f64],
        rng: &mut Rng,
    ) {
        let rows = self.a.chunks_exact(from.len());
        let shifts = &self.displacements[mode][action];
        for ((value, row), shift) in to.iter_mut().zip(rows).zip(shifts) {
            *value = row.iter().zip(from).map(|(a, s)| a * s).sum::<f64>() + shift;
        }
        self.noise[action].add_to(to, rng);
    }

    fn sense(&self, action: ActionId, state: &[f64], observation: &mut [f64], rng: &mut Rng) {
        self.sensor.sense(action, state, observation, rng);
    }
}
