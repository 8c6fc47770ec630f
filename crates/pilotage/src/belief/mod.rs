//! What the agent knows: Kalman filter, uncertainty levels, hypotheses, and the decision process they form.

pub mod filter;
pub mod gaussian;
pub mod hypotheses;
pub mod kalman;
pub mod levels;
pub mod mdp;
mod mixture;
mod nearby;
pub mod recall;
pub mod riccati;
mod tracker;

pub(crate) use filter::is_kept;
pub use filter::{Belief, Filter, LARGEST};
pub use hypotheses::{Hypothesis, HypothesisSettings, HypothesisTracker, Merge};
pub use kalman::{Correction, KalmanFilter};
pub use levels::{ClassId, LevelGraph, StratumId};
pub use mdp::{BeliefMdp, Survival};
pub use recall::{ClusterId, Clusters, Recall};
pub use tracker::{KalmanTracker, Reading, Tracker, Tracking};
