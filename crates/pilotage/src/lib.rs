//! Plan under uncertainty with Kalman beliefs.

pub mod belief;
pub mod error;
pub mod model;
pub mod observe;
mod parallel;
pub mod policy;
pub mod random;
#[cfg(feature = "report")]
pub mod report;
pub mod simulate;
pub mod solve;
pub mod world;

pub use error::{Error, Result};
