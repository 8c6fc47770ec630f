//! The Kalman filter (thesis 2.3), with Eq. 2.31 and 2.32 corrected.
//!
//! # References
//! P. S. Maybeck, *Stochastic Models, Estimation, and Control*, vol. 1, 1979.

use nalgebra::{DMatrix, DVector};

/// The part of one filter step that does not depend on what is observed.
#[derive(Debug, Clone, PartialEq)]
pub struct Correction {
    /// Predicted covariance `P- = A P A' + Q` (Eq. 2.30).
    pub predicted: DMatrix<f64>,
    /// Innovation covariance `S = H P- H' + R` (Eq. 2.31, corrected).
    pub innovation: DMatrix<f64>,
    /// Gain `K = P- H' S^-1` (Eq. 2.32, corrected).
    pub gain: DMatrix<f64>,
    /// Covariance after the observation (Eq. 2.34 in Joseph form, which keeps it symmetric and positive).
    pub covariance: DMatrix<f64>,
}

impl Correction {
    /// One step of the covariance from `p`. `a` and `q` are `n x n`, `h` is `m x n`, `r` is `m x m`.
    ///
    /// A direction without any innovation (`S` singular, as when neither state nor sensor is noisy) gets no gain.
    pub fn new(
        a: &DMatrix<f64>,
        q: &DMatrix<f64>,
        h: &DMatrix<f64>,
        r: &DMatrix<f64>,
        p: &DMatrix<f64>,
    ) -> Self {
        let predicted = symmetric(a * p * a.transpose() + q);
        let innovation = symmetric(h * &predicted * h.transpose() + r);
        let cross = &predicted * h.transpose();
        let gain = match innovation.clone().cholesky() {
            Some(cholesky) => cholesky.solve(&cross.transpose()).transpose(),
            None => &cross * pseudo_inverse(&innovation),
        };
        let keep = DMatrix::identity(p.nrows(), p.nrows()) - &gain * h;
        let covariance =
            symmetric(&keep * &predicted * keep.transpose() + &gain * r * gain.transpose());
        Self {
            predicted,
            innovation,
            gain,
            covariance,
        }
    }

    /// Covariance of the change of mean that the observation brings, `K S K' = P- - P` (Eq. 5.6, corrected).
    pub fn mean_covariance(&self) -> DMatrix<f64> {
        symmetric(&self.gain * &self.innovation * self.gain.transpose())
    }
}

/// A Kalman filter over a state of `n` variables.
#[derive(Debug, Clone, PartialEq)]
pub struct KalmanFilter {
    /// State transition, `n x n`.
    pub a: DMatrix<f64>,
    /// Control matrix, `n x p`.
    pub b: DMatrix<f64>,
    /// Process noise covariance, `n x n`.
    pub q: DMatrix<f64>,
    /// Measurement matrix, `m x n`.
    pub h: DMatrix<f64>,
    /// Measurement noise covariance, `m x m`.
    pub r: DMatrix<f64>,
    /// Mean of the belief, length `n`.
    pub mean: DVector<f64>,
    /// Covariance of the belief, `n x n`.
    pub covariance: DMatrix<f64>,
}

impl KalmanFilter {
    /// Moves the belief on by one control (length `p`) and one observation (length `m`); returns the innovation.
    pub fn step(&mut self, control: &DVector<f64>, observation: &DVector<f64>) -> DVector<f64> {
        let correction = Correction::new(&self.a, &self.q, &self.h, &self.r, &self.covariance);
        let predicted = &self.a * &self.mean + &self.b * control;
        let innovation = observation - &self.h * &predicted;
        self.mean = predicted + &correction.gain * &innovation;
        self.covariance = correction.covariance;
        innovation
    }
}

/// The symmetric part, which removes rounding differences across the diagonal.
pub(crate) fn symmetric(matrix: DMatrix<f64>) -> DMatrix<f64> {
    (&matrix + matrix.transpose()) * 0.5
}

/// Largest difference of two entries.
pub(crate) fn distance(a: &DMatrix<f64>, b: &DMatrix<f64>) -> f64 {
    (a - b).amax()
}

/// A matrix `L` with `L L' = covariance`, for any positive semi-definite covariance; columns without variance are left out.
pub(crate) fn square_root(covariance: &DMatrix<f64>) -> DMatrix<f64> {
    let eigen = covariance.clone().symmetric_eigen();
    let largest = eigen.eigenvalues.amax();
    let kept: Vec<usize> = (0..eigen.eigenvalues.len())
        .filter(|&i| eigen.eigenvalues[i] > largest * 1e-14 && eigen.eigenvalues[i] > 0.0)
        .collect();
    DMatrix::from_fn(covariance.nrows(), kept.len(), |row, column| {
        eigen.eigenvectors[(row, kept[column])] * eigen.eigenvalues[kept[column]].sqrt()
    })
}

fn pseudo_inverse(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let eigen = matrix.clone().symmetric_eigen();
    let floor = eigen.eigenvalues.amax() * 1e-13;
    let inverse = eigen
        .eigenvalues
        .map(|value| if value > floor { 1.0 / value } else { 0.0 });
    &eigen.eigenvectors * DMatrix::from_diagonal(&inverse) * eigen.eigenvectors.transpose()
}
