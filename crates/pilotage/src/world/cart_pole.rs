//! A cart with an inverted pole: the nonlinear equations of motion (Eq. 3.6 and 3.9).

use crate::scenario::CartPole;

/// The plant. State: cart position m, velocity m/s, angle of the pole from upright rad, angular velocity rad/s.
#[derive(Debug, Clone, PartialEq)]
pub struct Plant {
    parameters: CartPole,
}

impl Plant {
    /// The plant with these parameters.
    pub fn new(parameters: CartPole) -> Self {
        Self { parameters }
    }

    /// Moves the state on by one time step under a constant force (N), by the classical Runge-Kutta method.
    pub fn advance(&self, state: &mut [f64], force: f64) {
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
