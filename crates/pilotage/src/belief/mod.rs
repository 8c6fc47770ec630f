//! What the agent knows, and the decision process that it forms.
//!
//! - A [`Belief`] is what a policy reads: an uncertainty level, a mode and a mean.
//! - A [`Tracker`] keeps one from step to step, by actions and [`Reading`]s; a reading may be numbers, a symbol or
//!   [nothing](Reading::Nothing). Whatever makes trackers is a [`Tracking`], such as the [`Filter`], which is the Kalman filter as it
//!   runs, and agents, learners and compilers ask for no more than that.
//! - A [`BeliefMdp`] is a model as planners see it: what is paid at a belief, what happens, and how the mean moves. It is made of a model
//!   and gives the filter ([`BeliefMdp::filter`]).
//!
//! Beneath these are the [`LevelGraph`] of the covariances that a filter can have, the [`KalmanFilter`] of the textbook and its
//! [steady state](riccati), and probabilities under a [Gaussian](gaussian). A [`HypothesisTracker`] keeps several beliefs with a weight
//! each, and a [`Memory`] remembers where beliefs were and what was done there.

mod cells;
mod codebook;
mod filter;
mod full;
pub mod gaussian;
mod hypotheses;
pub(crate) mod kalman;
mod levels;
mod mdp;
mod memory;
mod mixture;
mod nearby;
mod reading;
pub(crate) mod recall;
pub mod riccati;
mod space;
mod sum;
mod tracker;
mod updater;

pub(crate) use cells::Heard;
pub use cells::{Cells, CellsKeeping};
pub use codebook::{Codebook, Stratum};
pub(crate) use filter::is_kept;
pub use filter::{Belief, Filter, LARGEST};
pub use full::{Acted, Keeping, Moments, Sensed};
pub use hypotheses::{Hypothesis, HypothesisSettings, HypothesisTracker, Merge};
pub use kalman::{Correction, KalmanFilter};
pub use levels::{ClassId, LevelGraph, StratumId};
pub use mdp::{BeliefMdp, Survival};
pub use memory::Memory;
pub use reading::Reading;
pub(crate) use recall::ClusterId;
pub use recall::{Clusters, Recall};
pub use space::{BeliefSpace, CodedSpace};
pub use sum::{Component, Sum, SumKeeping};
pub use tracker::{KalmanTracker, Tracker, Tracking};
pub(crate) use updater::Pace;
pub use updater::{Coded, Held, Updater};
