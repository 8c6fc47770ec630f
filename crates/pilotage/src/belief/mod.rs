//! What the agent knows: Kalman filter, uncertainty levels, hypotheses, and the decision process they form.

mod filter;
pub mod gaussian;
mod hypotheses;
pub(crate) mod kalman;
mod levels;
mod mdp;
mod mixture;
mod nearby;
mod reading;
pub(crate) mod recall;
pub mod riccati;
mod tracker;

pub(crate) use filter::is_kept;
pub use filter::{Belief, Filter, LARGEST};
pub use hypotheses::{Hypothesis, HypothesisSettings, HypothesisTracker, Merge};
pub use kalman::{Correction, KalmanFilter};
pub use levels::{ClassId, LevelGraph, StratumId};
pub use mdp::{BeliefMdp, Survival};
pub use reading::Reading;
pub(crate) use recall::ClusterId;
pub use recall::{Clusters, Recall};
pub use tracker::{KalmanTracker, Tracker, Tracking};
