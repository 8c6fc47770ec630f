//! One step of the Riccati recursion of a regulator, backwards in time.

use nalgebra::DMatrix;

use crate::belief::kalman::symmetric;
use crate::error::{Error, Result};

/// What a step costs and commands.
#[derive(Debug, Clone)]
pub(super) struct Stage {
    /// `L = M^-1 g B' S_next A`, the gain, `p x n`.
    pub(super) gain: DMatrix<f64>,
    /// `M = R + g B' S_next B`, what a deviation from the command costs, `p x p`.
    pub(super) deviation: DMatrix<f64>,
    /// `S = Q + g A' S_next A - L' M L`, what the state costs from here on, `n x n`.
    pub(super) cost: DMatrix<f64>,
}

impl Stage {
    pub(super) fn new(
        a: &DMatrix<f64>,
        b: &DMatrix<f64>,
        (state, control): (&DMatrix<f64>, &DMatrix<f64>),
        discount: f64,
        next: &DMatrix<f64>,
    ) -> Result<Self> {
        let pushed = b.transpose() * next * discount;
        let deviation = symmetric(control + &pushed * b);
        let Some(cholesky) = deviation.clone().cholesky() else {
            return Err(Error::NotPositiveDefinite {
                what: "the cost of control, R + B' S B,",
                eigenvalue: deviation.symmetric_eigenvalues().min(),
            });
        };
        let gain = cholesky.solve(&(pushed * a));
        let cost = symmetric(
            state + a.transpose() * next * a * discount - gain.transpose() * &deviation * &gain,
        );
        Ok(Self {
            gain,
            deviation,
            cost,
        })
    }
}
