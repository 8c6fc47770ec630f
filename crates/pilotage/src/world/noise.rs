//! Gaussian noise, drawn without allocating.

use nalgebra::DMatrix;

use crate::belief::kalman::square_root;
use crate::random::{Rng, normal};

/// N(0, covariance).
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Noise {
    dim: usize,
    /// Columns of a square root of the covariance, one after the other.
    columns: Vec<f64>,
}

impl Noise {
    /// Noise of the given covariance, positive semi-definite.
    pub(crate) fn new(covariance: &DMatrix<f64>) -> Self {
        Self {
            dim: covariance.nrows(),
            columns: square_root(covariance).as_slice().to_vec(),
        }
    }

    /// Adds one draw to `target`, which has the covariance's size.
    pub(crate) fn add_to(&self, target: &mut [f64], rng: &mut Rng) {
        for column in self.columns.chunks_exact(self.dim) {
            let draw = normal(rng);
            for (value, factor) in target.iter_mut().zip(column) {
                *value += factor * draw;
            }
        }
    }
}
