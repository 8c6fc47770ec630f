//! Solvers: from a model, or from experience, to a policy.
//!
//! A solver is a value that carries its own settings, such as [`ValueIteration`] or [`Kafaq`]. A [`Planner`] is handed a [`Problem`], from
//! which nothing true can be reached; a [`Learner`] is handed worlds to act in as well. [`plan`], [`learn`] and [`solve`] run them and
//! bring what they find into the form asked for. [`Registry`] has them by name, their settings as text.

pub mod arkaq;
pub mod bound;
pub mod compile;
mod grid;
pub mod kafaq;
pub mod kbvi;
mod learn;
pub mod lqg;
pub mod lqr;
mod mdp;
mod mls;
pub mod policy_search;
mod promise;
mod qmdp;
mod refusals;
mod registry;
pub mod rollout;
mod run;
mod settings;
mod solution;
mod solver;
pub mod value_iteration;
mod walled;

pub use arkaq::Settings as Arkaq;
pub use kafaq::Settings as Kafaq;
pub use kbvi::Kbvi;
pub use learn::{Course, Learned, Owner, Run, learn as run_course};
pub use lqg::Lqg;
pub use mls::Mls;
pub use policy_search::PolicySearch;
pub use promise::Earned;
pub use qmdp::Qmdp;
pub use registry::{Entry, Registry};
pub use run::{learn, plan, solve};
pub use settings::{SettingInfo, Settings};
pub use solution::{Form, Learning, Line, Solution, Solved};
pub use solver::{Found, Learner, Lesson, Plan, Planner, Problem, Request, Solver, Worlds};
pub use value_iteration::ValueIteration;
