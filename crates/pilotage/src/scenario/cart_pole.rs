//! The cart and pole near upright: Eq. 3.10 and 3.11, held over a step.

use nalgebra::{DMatrix, Matrix4, Vector4};

use super::CartPole;

/// Variance added to every state variable, so that no direction of the state is without noise.
const STATE_NOISE: f64 = 1e-9;

/// Largest entry of a generator that is held over a step.
const LARGEST: f64 = 1e9;

impl CartPole {
    /// Time derivatives of the linearised plant, `ds/dt = F s + G u` (Eq. 3.11): `F` and `G`.
    pub fn linearised(&self) -> (Matrix4<f64>, Vector4<f64>) {
        let Self {
            cart_mass,
            pole_mass,
            friction,
            length,
            inertia,
            gravity,
            ..
        } = *self;
        let moment = pole_mass * length;
        let about_hinge = inertia + moment * length;
        let total = cart_mass + pole_mass;
        let scale = 1.0 / (inertia * total + cart_mass * moment * length);
        #[rustfmt::skip]
        let f = Matrix4::new(
            0.0, 1.0,                             0.0,                            0.0,
            0.0, -about_hinge * friction * scale, moment * moment * gravity * scale, 0.0,
            0.0, 0.0,                             0.0,                            1.0,
            0.0, -moment * friction * scale,      moment * gravity * total * scale, 0.0,
        );
        let g = Vector4::new(0.0, about_hinge * scale, 0.0, moment * scale);
        (f, g)
    }

    /// `A` (`4 x 4`) and `B` (`4 x 1`) of one step of the linearised plant under a constant force: the exact zero-order
    /// hold, `exp([F G; 0 0] step) = [A B; 0 1]`. Where that is beyond all numbers they are not finite.
    pub fn discretised(&self) -> (DMatrix<f64>, DMatrix<f64>) {
        let (f, g) = self.linearised();
        let mut generator = DMatrix::zeros(5, 5);
        generator.view_mut((0, 0), (4, 4)).copy_from(&f);
        generator.view_mut((0, 4), (4, 1)).copy_from(&g);
        let generator = generator * self.step;
        // Of larger ones the exponential overflows, or never ends.
        let held = if generator.amax() <= LARGEST {
            generator.exp()
        } else {
            generator * f64::NAN
        };
        (
            held.view((0, 0), (4, 4)).into_owned(),
            held.view((0, 4), (4, 1)).into_owned(),
        )
    }

    /// Covariance (`4 x 4`) of the noise of one step: `B q B' + 1e-9 I` with the variance `q` of the force.
    pub(crate) fn motion_noise(&self) -> DMatrix<f64> {
        let (_, b) = self.discretised();
        &b * self.force_noise * b.transpose() + DMatrix::identity(4, 4) * STATE_NOISE
    }
}
