//! Linear motion and sensing, `s' = A s + B u + v`, `o = H s + n`, with the true noise and controls where a scenario states them.

use super::noise::Noise;
use super::{Body, Doing, Observation};
use crate::model::{ActionId, ModeId};
use crate::random::Rng;
use crate::scenario::Scenario;

/// The linear sensor of a model.
#[derive(Debug, Clone)]
pub(super) struct LinearSensor {
    /// By phase: `H`, row by row.
    h: Vec<Vec<f64>>,
    /// By phase and action.
    noise: Vec<Vec<Noise>>,
}

impl LinearSensor {
    pub(super) fn new(scenario: &Scenario) -> Self {
        let model = &scenario.model;
        let actions = 0..model.actions.len();
        let h = |step| model.sensor_at(step).h.transpose().as_slice().to_vec();
        let noise = |step| {
            let noise = |action| Noise::new(model.sensor_noise(action, step));
            actions.clone().map(noise).collect()
        };
        Self {
            h: model.phases().map(h).collect(),
            noise: model.phases().map(noise).collect(),
        }
    }

    pub(super) fn sense(
        &self,
        doing: Doing,
        state: &[f64],
        observation: &mut [f64],
        rng: &mut Rng,
    ) {
        let rows = self.h[doing.phase].chunks_exact(state.len());
        for (reading, row) in observation.iter_mut().zip(rows) {
            *reading = row.iter().zip(state).map(|(h, s)| h * s).sum();
        }
        self.noise[doing.phase][doing.action].add_to(observation, rng);
    }
}

/// A state that moves and is sensed linearly.
#[derive(Debug, Clone)]
pub(super) struct Linear {
    /// By phase.
    motions: Vec<LinearMotion>,
    sensor: LinearSensor,
}

#[derive(Debug, Clone)]
struct LinearMotion {
    /// `A`, row by row.
    a: Vec<f64>,
    /// `B u`, by mode and action.
    displacements: Vec<Vec<Vec<f64>>>,
    /// By action.
    noise: Vec<Noise>,
}

impl Linear {
    pub(super) fn new(scenario: &Scenario) -> Self {
        let phases = scenario.model.phases();
        Self {
            motions: phases
                .map(|step| LinearMotion::new(scenario, step))
                .collect(),
            sensor: LinearSensor::new(scenario),
        }
    }
}

impl LinearMotion {
    /// True motion of the phase that begins at a step.
    fn new(scenario: &Scenario, step: usize) -> Self {
        let model = &scenario.model;
        let actions = 0..model.actions.len();
        let truly = |action| {
            let stated = scenario.truth.motion.noise.as_ref();
            Noise::new(stated.unwrap_or_else(|| model.motion_noise(action, step)))
        };
        Self {
            a: model.motion_at(step).a.transpose().as_slice().to_vec(),
            displacements: (0..model.modes.len())
                .map(|mode| {
                    let displacement = |action| displacement(scenario, mode, action, step);
                    actions.clone().map(displacement).collect()
                })
                .collect(),
            noise: actions.map(truly).collect(),
        }
    }
}

/// True `B u` of an action in a mode at a step.
fn displacement(scenario: &Scenario, mode: ModeId, action: ActionId, step: usize) -> Vec<f64> {
    let model = &scenario.model;
    let mut controls = scenario.truth.motion.controls.iter();
    let truly = controls.find(|control| control.applies(mode, action));
    let control = truly.map_or(&model.actions[action].control, |truly| &truly.control);
    let motion = model.motion_at(step);
    (&motion.b * control + &motion.drift).as_slice().to_vec()
}

impl Body for Linear {
    fn advance(&mut self, doing: Doing, from: &[f64], to: &mut [f64], rng: &mut Rng) {
        let motion = &self.motions[doing.phase];
        let rows = motion.a.chunks_exact(from.len());
        let shifts = &motion.displacements[doing.mode][doing.action];
        for ((value, row), shift) in to.iter_mut().zip(rows).zip(shifts) {
            *value = row.iter().zip(from).map(|(a, s)| a * s).sum::<f64>() + shift;
        }
        motion.noise[doing.action].add_to(to, rng);
    }

    fn sense(&self, doing: Doing, state: &[f64], observation: &mut Observation, rng: &mut Rng) {
        self.sensor.sense(doing, state, observation.values(), rng);
    }
}
