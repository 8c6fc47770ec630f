//! The linear-quadratic-Gaussian controller: the best linear feedback on the mean of the Kalman filter, `u = -L m`.
//!
//! Costs count as negative reward: what is planned and what is earned are both `-cost`, so that more is better everywhere.
//!
//! A model that has a `[cost]` and pays no reward is solved exactly: a free control over a finite episode ([`Controller`]). For other
//! models it is a baseline: the action whose control is nearest to the command ([`NearestAction`]), which for two opposite forces
//! is the sign of the command.
//!
//! # References
//! K. J. Åström, *Introduction to Stochastic Control Theory*, 1970, chapter 8.

mod control;
mod nearest;
mod tune;

pub use control::Controller;
pub use nearest::{NearestAction, Weights};
pub use tune::{PoleWeights, tuned};

use nalgebra::DMatrix;

use crate::belief::kalman::symmetric;
use crate::error::{Error, Result};
use crate::model::{Interval, Model};

/// Which of its two uses a model is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Use {
    /// A free control and a quadratic cost, solved exactly.
    Control,
    /// A choice among actions, for whatever reward the model pays.
    Actions,
}

/// Which use a model is for, or why it is for neither and what would do.
pub fn use_of(model: &Model) -> std::result::Result<Use, String> {
    let limited = |&(_, side): &(usize, Interval)| side != Interval::ALL;
    let fails = model.episode.alive.sides.iter().any(limited);
    let pays = !model.rewards.is_empty() || !model.events.is_empty() || fails;
    match (&model.cost, pays) {
        (Some(_), false) => Ok(Use::Control),
        (Some(_), true) => Ok(Use::Actions),
        (None, _) if fails => Ok(Use::Actions),
        (None, _) => Err(
            "nothing says what is to be held near the origin; add a [cost], or limits to `episode.alive`".to_owned(),
        ),
    }
}

/// One step of the Riccati recursion backwards in time.
#[derive(Debug, Clone)]
struct Stage {
    /// `L = M^-1 g B' S_next A`, the gain, `p x n`.
    gain: DMatrix<f64>,
    /// `M = R + g B' S_next B`, what a deviation from the command costs, `p x p`.
    deviation: DMatrix<f64>,
    /// `S = Q + g A' S_next A - L' M L`, what the state costs from here on, `n x n`.
    cost: DMatrix<f64>,
}

impl Stage {
    fn new(
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
