//! Solvers: from a model, or from experience, to a policy.
//!
//! [`plan`] runs a planner on a model, [`learn`] a learner in a scenario's world, and [`solve`] whichever it is. A [`Request`] says
//! what [`Form`] the policy is to have; the [`Solution`] has the policy, what it is expected to earn and what is to be known of it, and
//! [`Solution::earned`] what it does earn.
//!
//! A solver is a value that carries its own settings:
//!
//! | solver | what it does |
//! |---|---|
//! | [`PointBased`] | backs up values of policies at beliefs on cells; policy graphs for discrete sensors |
//! | [`CodebookPlanner`] | value iteration on strata and means of beliefs of any kind |
//! | [`ValueIteration`] | value iteration on levels and means, for models of at most three variables |
//! | [`Kbvi`] | the thesis' search of action sequences that are fixed in advance |
//! | [`PolicySearch`] | moves the planes at which actions switch, where no grid fits |
//! | [`Lqg`] | the linear-quadratic-Gaussian controller |
//! | [`Qmdp`], [`Mls`] | the baselines: all uncertainty gone after a step, and the most likely state |
//! | [`Kafaq`] | learns regions of means that share an action |
//! | [`Arkaq`] | learns clusters of beliefs with an action each |
//!
//! [`Registry`] has them by name, their settings as text. [`bound`] gives a number that no policy can exceed, and
//! [`compile`](mod@compile) makes an automaton of any policy.
//!
//! # A solver of one's own
//! A [`Planner`] is handed a [`Problem`], from which nothing true can be reached, and gives a [`Plan`]; a [`Learner`] is handed
//! [`Worlds`] to act in as well, and gives a [`Lesson`]. A learner that is a [`Course`], a state and a step, is run, kept in
//! checkpoints and gone on with by [`run_course`]. With [`Settings`] of its own it is an [`Entry`] of a registry.

pub mod arkaq;
pub mod bound;
pub mod codebook;
pub mod compile;
mod deviation;
mod grid;
pub mod kafaq;
pub mod kbvi;
mod learn;
pub mod lqg;
pub mod lqr;
mod mdp;
mod mls;
pub mod point_based;
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
pub use codebook::CodebookPlanner;
pub use kafaq::Settings as Kafaq;
pub use kbvi::Kbvi;
pub use learn::{Course, Learned, Owner, Run, learn as run_course};
pub use lqg::Lqg;
pub use mls::Mls;
pub use point_based::PointBased;
pub use policy_search::PolicySearch;
pub use promise::{ByRule, Earned};
pub use qmdp::Qmdp;
pub use registry::{Entry, Registry};
pub use run::{learn, plan, solve};
pub use settings::{SettingInfo, Settings};
pub use solution::{Form, Learning, Line, Solution, Solved};
pub use solver::{Found, Learner, Lesson, Plan, Planner, Problem, Request, Size, Solver, Worlds};
pub use value_iteration::ValueIteration;
