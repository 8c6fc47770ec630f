//! Every table and figure of the thesis, made again: one function for each, with a verdict.
//!
//! [`EXPERIMENTS`] lists what can be made, in the order of the thesis; each makes a [`Finding`](pilotage_report::Finding), and
//! [`pilotage_report`] turns findings into a page. What is shaped by the thesis' problems is here and not in the library:
//! whom its learners are measured against ([`baseline`]), the pole's regulator with tuned weights ([`regulator`]), and the
//! [`episodes`] that open the report.
//!
//! ```
//! use pilotage::progress::Silent;
//! use pilotage_report::Verdict;
//! use pilotage_thesis::{Context, EXPERIMENTS};
//!
//! let context = Context { seed: 1, quick: true, observer: &Silent };
//! let levels = EXPERIMENTS.iter().find(|experiment| experiment.id == "table-4.1").expect("listed");
//! assert_eq!((levels.make)(&context)?.verdict, Verdict::Reproduced);
//! # Ok::<(), pilotage_thesis::Error>(())
//! ```

mod algorithms;
pub mod baseline;
mod chapter3;
mod chapter4;
mod chapter5;
mod chapter6;
mod context;
mod episodes;
mod error;
mod experiments;
mod learning;
mod pole;
pub mod regulator;
mod wake_up;

pub use algorithms::algorithms;
pub use context::Context;
pub use episodes::episodes;
pub use error::{Error, Result};
pub use experiments::{EXPERIMENTS, Experiment};
