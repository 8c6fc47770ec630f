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

pub(crate) use filter::is_kept;
pub use filter::{Belief, Filter, LARGEST, Switch};
pub use hypotheses::{Hypothesis, Merge, Tracker, Tracking};
pub use kalman::{Correction, KalmanFilter};
pub use levels::{ClassId, LevelGraph, StratumId};
pub use mdp::{BeliefMdp, Survival};
pub use recall::{ClusterId, Clusters, Recall};
