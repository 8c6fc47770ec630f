//! A cart with an inverted pole: the nonlinear equations of motion (Eq. 3.6 and 3.9).

use super::linear::LinearSensor;
use super::{Body, Doing, Observation};
use crate::random::{Rng, normal};
use crate::scenario::{CartPole, Scenario};

/// The plant, pushed by a force for each action and sensed linearly.
#[derive(Debug, Clone)]
pub(super) struct CartAndPole {
    plant: Plant,
    /// By action, N.
    forces: Vec<f64>,
    /// Standard deviation of the force, N.
    force_sd: f64,
    sensor: LinearSensor,
}

impl CartAndPole {
    pub(crate) fn new(scenario: &Scenario, parameters: &CartPole) -> Self {
        let actions = scenario.model.actions.iter();
        Self {
            plant: Plant::new(parameters.clone()),
            forces: actions.map(|action| action.control[0]).collect(),
            force_sd: parameters.force_noise.sqrt(),
            sensor: LinearSensor::new(scenario),
        }
    }
}

impl Body for CartAndPole {
    fn advance(&mut self, doing: Doing, from: &[f64], to: &mut [f64], rng: &mut Rng) {
        to.copy_from_slice(from);
        let force = self.forces[doing.action] + self.force_sd * normal(rng);
        self.plant.advance(to, force);
    }

    fn sense(&self, doing: Doing, state: &[f64], observation: &mut Observation, rng: &mut Rng) {
        self.sensor.sense(doing, state, observation.values(), rng);
    }
}

/// The plant. State: cart position m, velocity m/s, angle of the pole from upright rad, angular velocity rad/s.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Plant {
    parameters: CartPole,
}

impl Plant {
    /// The plant with these parameters.
    pub(crate) fn new(parameters: CartPole) -> Self {
        Self { parameters }
    }

    /// Moves the state on by one time step under a constant force (N), by the classical Runge-Kutta method.
    pub(crate) fn advance(&self, state: &mut [f64], force: f64) {
        let h = self.parameters.step;
        let s = [state[0], state[1], state[2], state[3]];
        let at = |slope: &[f64; 4], time: f64| std::array::from_fn(|i| s[i] + time * slope[i]);
        let k1 = self.slope(&s, force);
        let k2 = self.slope(&at(&k1, 0.5 * h), force);
        let k3 = self.slope(&at(&k2, 0.5 * h), force);
        let k4 = self.slope(&at(&k3, h), force);
        for (i, value) in state.iter_mut().enumerate() {
            *value += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
        }
    }

    /// Time derivative of the state. With the angle measured from upright, `theta = pi + phi`, Eq. 3.6 and 3.9 are linear in the
    /// two accelerations.
    fn slope(&self, state: &[f64; 4], force: f64) -> [f64; 4] {
        let CartPole {
            cart_mass,
            pole_mass,
            friction,
            length,
            inertia,
            gravity,
            ..
        } = self.parameters;
        let [_, velocity, angle, rate] = *state;
        let (sin, cos) = angle.sin_cos();
        let coupling = pole_mass * length * cos;
        let moment = inertia + pole_mass * length * length;
        let mass = cart_mass + pole_mass;
        let push = force - friction * velocity - pole_mass * length * rate * rate * sin;
        let torque = pole_mass * gravity * length * sin;
        let determinant = mass * moment - coupling * coupling;
        [
            velocity,
            (moment * push + coupling * torque) / determinant,
            rate,
            (coupling * push + mass * torque) / determinant,
        ]
    }
}
