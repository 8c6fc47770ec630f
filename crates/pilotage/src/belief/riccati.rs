//! The steady state of the filter, by solving the discrete algebraic Riccati equation (Eq. 4.2).
//!
//! # References
//! B. D. O. Anderson, J. B. Moore, *Optimal Filtering*, 1979, section 6.7 (the doubling algorithm).

use nalgebra::DMatrix;

use super::kalman::{Correction, distance, symmetric};
use crate::error::{Error, Result};

const DOUBLINGS: u32 = 60;

/// The *predicted* covariance `P-` that the filter repeats for ever: `P- = A (P- - P- H' S^-1 H P-) A' + Q`.
///
/// Eq. 4.2 calls it `P`, but Table 4.1 and `P_converge` are of the covariance *after* the observation: see [`steady_state`].
///
/// # Errors
/// [`Error::NotPositiveDefinite`] where `R` cannot be inverted, [`Error::NoSteadyState`] where `(A, H)` is not detectable or
/// `(A, Q^1/2)` not stabilisable.
pub fn predicted_steady_state(
    a: &DMatrix<f64>,
    q: &DMatrix<f64>,
    h: &DMatrix<f64>,
    r: &DMatrix<f64>,
) -> Result<DMatrix<f64>> {
    let n = a.nrows();
    let identity = DMatrix::identity(n, n);
    let information = match r.clone().cholesky() {
        Some(cholesky) => h.transpose() * cholesky.solve(h),
        None => {
            let eigenvalue = r.clone().symmetric_eigenvalues().min();
            return Err(Error::NotPositiveDefinite {
                what: "the sensor noise covariance",
                eigenvalue,
            });
        }
    };
    // After k doublings `p` is the covariance that 2^k steps of the filter reach from certainty.
    let (mut f, mut g, mut p) = (a.transpose(), information, q.clone());
    let (mut steps, mut change) = (1, f64::INFINITY);
    let mut last = p.clone();
    for doubling in 1..=DOUBLINGS {
        let Some(w) = (&identity + &g * &p).try_inverse() else {
            break;
        };
        let fw = &f * &w;
        let next = symmetric(&p + f.transpose() * &p * &w * &f);
        g = symmetric(&g + &fw * &g * f.transpose());
        f = fw * f;
        let now = distance(&next, &p);
        if !now.is_finite() {
            break;
        }
        (steps, change) = (1 << doubling, now);
        last = std::mem::replace(&mut p, next);
        if change <= 1e-15 * p.amax().max(1e-300) {
            return check_stability(a, q, h, r, p);
        }
    }
    Err(no_steady_state(&p, &last, steps, change))
}

/// The covariance *after* the observation that the filter repeats for ever: `P_converge` of the thesis.
///
/// # Errors
/// As [`predicted_steady_state`].
pub fn steady_state(
    a: &DMatrix<f64>,
    q: &DMatrix<f64>,
    h: &DMatrix<f64>,
    r: &DMatrix<f64>,
) -> Result<DMatrix<f64>> {
    let predicted = predicted_steady_state(a, q, h, r)?;
    let zero = DMatrix::zeros(a.nrows(), a.nrows());
    Ok(Correction::new(
        &DMatrix::identity(a.nrows(), a.nrows()),
        &zero,
        h,
        r,
        &predicted,
    )
    .covariance)
}

/// A fixed point that other starts do not run into (a marginal direction without process noise) is no steady state.
fn check_stability(
    a: &DMatrix<f64>,
    q: &DMatrix<f64>,
    h: &DMatrix<f64>,
    r: &DMatrix<f64>,
    p: DMatrix<f64>,
) -> Result<DMatrix<f64>> {
    let n = a.nrows();
    let correction = Correction::new(&DMatrix::identity(n, n), &DMatrix::zeros(n, n), h, r, &p);
    let closed = a * (DMatrix::identity(n, n) - &correction.gain * h);
    let radius = closed
        .complex_eigenvalues()
        .iter()
        .map(|value| value.norm())
        .fold(0.0, f64::max);
    if radius < 1.0 - 1e-9 {
        return Ok(p);
    }
    let disturbed = &p + DMatrix::identity(n, n);
    let next = symmetric(
        a * Correction::new(
            &DMatrix::identity(n, n),
            &DMatrix::zeros(n, n),
            h,
            r,
            &disturbed,
        )
        .covariance
            * a.transpose()
            + q,
    );
    Err(no_steady_state(
        &next,
        &p,
        1 << DOUBLINGS,
        distance(&next, &p),
    ))
}

fn no_steady_state(now: &DMatrix<f64>, before: &DMatrix<f64>, steps: u64, change: f64) -> Error {
    let difference = symmetric(now - before);
    let size = difference.amax();
    let direction = if size > 0.0 && size.is_finite() {
        // Scaled, since the squares of what grows for ever overflow.
        let eigen = (difference / size).symmetric_eigen();
        let main = eigen
            .eigenvalues
            .iter()
            .enumerate()
            .fold(0, |best, (i, value)| {
                if value.abs() > eigen.eigenvalues[best].abs() {
                    i
                } else {
                    best
                }
            });
        eigen
            .eigenvectors
            .column(main)
            .iter()
            .map(|value| format!("{value:.3}"))
            .collect::<Vec<_>>()
            .join(", ")
    } else {
        "every variable".to_owned()
    };
    Error::NoSteadyState {
        what: "filter",
        steps,
        change,
        direction,
        remedy: "give [sensor] a reading of it, and [motion] noise along it unless it dies out by itself",
    }
}
