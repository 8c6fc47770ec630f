//! Solvers: from a model, or from experience, to a policy. [`solve`] runs any of them by name.

pub mod arkaq;
pub mod bound;
pub mod cma;
pub mod compile;
pub mod grid;
pub mod hazard;
pub mod kafaq;
pub mod kbvi;
mod learn;
pub mod lqg;
pub mod lqr;
pub mod mdp;
pub mod mls;
mod promise;
pub mod qmdp;
pub mod refine;
pub mod rollout;
mod run;
mod solution;
mod solver;
pub mod walled;

pub use learn::SettingInfo;
pub use promise::Earned;
pub use run::{SolveSettings, solve};
pub use solution::{Form, Learning, Solution, Solved};
pub use solver::SolverKind;
