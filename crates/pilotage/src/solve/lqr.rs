//! The linear-quadratic regulator: the control law that is best for a linear system with quadratic cost.

use nalgebra::DMatrix;

use crate::belief::riccati::predicted_steady_state;
use crate::error::{Error, Result};

/// The gain `K` (`p x n`) for which `u = -K s` costs least: it minimises the sum of `s' Q s + u' R u` over all steps of
/// `s' = A s + B u`. `a` is `n x n`, `b` is `n x p`, `q` is `n x n` and positive semi-definite, `r` is `p x p` and positive
/// definite. The cost from `s` on is `s' P s` with `P = Q + A' P (A - B K)`, `K = (R + B' P B)^-1 B' P A`.
///
/// Regulating is the dual of filtering (R. E. Kalman, 1960): `P` is the predicted covariance that a filter with motion `A'` and
/// sensor `B'` settles at.
///
/// # Errors
/// [`Error::NotPositiveDefinite`] where `R` cannot be inverted, [`Error::NoSteadyState`] where `(A, B)` is not stabilisable or
/// `(A, Q^1/2)` not detectable.
pub fn lqr_gain(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    q: &DMatrix<f64>,
    r: &DMatrix<f64>,
) -> Result<DMatrix<f64>> {
    let cost =
        predicted_steady_state(&a.transpose(), q, &b.transpose(), r).map_err(
            |error| match error {
                Error::NotPositiveDefinite { eigenvalue, .. } => Error::NotPositiveDefinite {
                    what: "the control weight",
                    eigenvalue,
                },
                Error::NoSteadyState {
                    steps,
                    change,
                    direction,
                    ..
                } => Error::NoSteadyState {
                    what: "regulator",
                    steps,
                    change,
                    direction,
                    remedy: "give [actions] a control that moves it, and a cost along it unless it dies out by itself",
                },
                other => other,
            },
        )?;
    let weight = r + b.transpose() * &cost * b;
    let aim = b.transpose() * &cost * a;
    match weight.clone().cholesky() {
        Some(cholesky) => Ok(cholesky.solve(&aim)),
        None => Err(Error::NotPositiveDefinite {
            what: "the control weight",
            eigenvalue: weight.symmetric_eigenvalues().min(),
        }),
    }
}
