//! Hypotheses that do not move, tracked exactly.
//!
//! Where a state stays where it is and the start is a mixture of Gaussians of the same covariance, one Kalman filter is enough: what
//! it has learned since the start, `y = P^-1 m - P_0^-1 m_0` and `Y = P^-1 - P_0^-1`, is a sufficient statistic of all of them. Of a
//! hypothesis N(x_i, C) with prior weight `w_i`
//!
//! ```text
//! log w_i' = log w_i + x_i' y - x_i' Y x_i / 2 + (y - Y x_i)' C' (y - Y x_i) / 2 + const,   C' = (I + C Y)^-1 C
//! x_i'     = x_i + C' (y - Y x_i)
//! ```
//!
//! For the tiger, two points at -1 and +1, the log-odds are `2 m / P`.

use nalgebra::{DMatrix, DVector};

use super::levels::{LevelGraph, StratumId};
use crate::model::{Model, StartHypothesis};

/// The hypotheses of a start as functions of level and mean.
#[derive(Debug, Clone)]
pub(super) struct Mixture {
    means: Vec<DVector<f64>>,
    log_priors: Vec<f64>,
    /// By level.
    learned: Vec<Learned>,
    /// `P_0^-1 m_0`.
    prior: DVector<f64>,
}

/// What a level says.
#[derive(Debug, Clone)]
struct Learned {
    /// `P^-1`.
    information: DMatrix<f64>,
    /// `Y`.
    gained: DMatrix<f64>,
    /// `C'`.
    covariance: DMatrix<f64>,
}

impl Mixture {
    /// The mixture of a model whose hypotheses can be kept by one filter; `mean` is the mean of all, `n` long.
    pub(super) fn of(model: &Model, levels: &LevelGraph, mean: &DVector<f64>) -> Option<Self> {
        if !suits(model) {
            return None;
        }
        let own = &model.start[0].covariance;
        let one = DMatrix::identity(own.nrows(), own.nrows());
        let prior = inverse(levels.covariance(levels.starts()[0]));
        let learned = (0..levels.len()).map(|level| {
            let information = inverse(levels.covariance(level));
            let gained = &information - &prior;
            let shrunk = (&one + own * &gained).try_inverse();
            Learned {
                covariance: shrunk.map_or_else(|| own.clone(), |shrunk| shrunk * own),
                information,
                gained,
            }
        });
        Some(Self {
            means: model.start.iter().map(|start| start.mean.clone()).collect(),
            log_priors: model.start.iter().map(|start| start.weight.ln()).collect(),
            learned: learned.collect(),
            prior: &prior * mean,
        })
    }

    /// Covariance of every hypothesis at a level, `n x n`; 0 where they are points.
    pub(super) fn covariance(&self, level: StratumId) -> &DMatrix<f64> {
        &self.learned[level].covariance
    }

    /// Weight and mean of each hypothesis.
    pub(super) fn hypotheses(&self, level: StratumId, mean: &[f64]) -> Vec<(f64, DVector<f64>)> {
        let Learned {
            information,
            gained,
            covariance,
        } = &self.learned[level];
        let vector = information * DVector::from_column_slice(mean) - &self.prior;
        let (mut scores, mut means) = (Vec::new(), Vec::new());
        for (x, log_prior) in self.means.iter().zip(&self.log_priors) {
            let beside = &vector - gained * x;
            let moved = covariance * &beside;
            scores.push(
                log_prior + x.dot(&vector) - 0.5 * x.dot(&(gained * x)) + 0.5 * beside.dot(&moved),
            );
            means.push(x + moved);
        }
        let best = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let total: f64 = scores.iter().map(|score| (score - best).exp()).sum();
        let weights = scores.iter().map(|score| (score - best).exp() / total);
        weights.zip(means).collect()
    }
}

/// Whether a model has several hypotheses of one mode and covariance, and a state that no action moves.
fn suits(model: &Model) -> bool {
    let n = model.state_dim();
    let first = &model.start[0];
    let alike = |start: &StartHypothesis| {
        (start.mode, &start.covariance) == (first.mode, &first.covariance)
    };
    let still = |step| {
        model.motion_at(step).a == DMatrix::identity(n, n)
            && (0..model.actions.len()).all(|action| {
                model.motion_noise(action, step).amax() == 0.0
                    && model.displacement(action, step).amax() == 0.0
            })
    };
    model.start.len() > 1 && model.start.iter().all(alike) && model.phases().all(still)
}

fn inverse(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    // No decomposition of a matrix that is not finite comes to an end.
    if matrix.iter().any(|entry| !entry.is_finite()) {
        return matrix.clone();
    }
    matrix
        .clone()
        .pseudo_inverse(1e-12 * matrix.amax().max(1e-300))
        .unwrap_or_else(|_| matrix.clone() * 0.0)
}
