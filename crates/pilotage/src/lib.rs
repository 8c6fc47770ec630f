//! Plan under uncertainty with Kalman beliefs, and hand over a small finite automaton.
//!
//! The world moves and is sensed linearly, with Gaussian noise; what it pays need not be linear in anything:
//!
//! ```text
//! s' = A s + B u_a + v,   v ~ N(0, Q)        the state, moved by action a
//! o  = H s' + n,          n ~ N(0, R)        what is sensed of it
//! maximise  E[ sum_t discount^t r(s_t, a_t) ]
//! ```
//!
//! The agent's belief is a Gaussian that a Kalman filter keeps. Its covariances follow from the model alone, so a belief is an
//! *uncertainty level* and a mean. Solvers find what to do at every belief; what they find becomes an automaton that runs without
//! allocating and that can be saved, read and drawn.
//!
//! ```
//! use pilotage::prelude::*;
//!
//! // A robot in a corridor of four cells, paid in the last one.
//! let corridor = scenario::find("corridor-unbounded")?;
//! let solution = plan(&ValueIteration::default(), &corridor.model, &Request::default(), &Silent)?;
//!
//! // Go EAST below 3, STOP up to 4, WEST above.
//! let automaton = solution.automaton().expect("the default form is an automaton");
//! assert_eq!(automaton.nodes.len(), 3);
//!
//! let earned = solution.evaluate(&corridor, Options { episodes: 2000, seed: 1 }, &Silent)?.discounted;
//! assert!((earned.mean - 0.82928).abs() < 4.0 * earned.stderr);
//!
//! // On the robot: act, then say what was sensed, or that nothing was.
//! let mut runner = AutomatonRunner::new(automaton);
//! for reading in [Reading::Values(&[1.4]), Reading::Nothing, Reading::Values(&[3.6])] {
//!     let (_, action) = runner.decide();
//!     runner.observe(action, reading);
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Where to find what
//!
//! Data flows one way, and the modules are best read in its order. The names that a first program needs are in the [`prelude`].
//!
//! | module | what it is for | begin with |
//! |---|---|---|
//! | [`model`] | what the agent assumes | [`ModelBuilder`](model::ModelBuilder), [`Model`](model::Model) |
//! | [`scenario`] | a model, and what is true where that differs; model files | [`find`](scenario::find), [`Scenario`](scenario::Scenario) |
//! | [`belief`] | what the agent knows, and what planners ask | [`Belief`](belief::Belief), [`Tracker`](belief::Tracker), [`BeliefMdp`](belief::BeliefMdp) |
//! | [`solve`] | planners and learners | [`plan`](solve::plan), [`learn`](solve::learn), [`Registry`](solve::Registry) |
//! | [`policy`] | what to do at a belief, or after a signal | [`Automaton`](policy::Automaton), [`AutomatonRunner`](policy::AutomatonRunner), [`PolicyGraph`](policy::PolicyGraph) |
//! | [`world`] | what happens; no agent looks inside | [`World`](world::World), [`ProblemWorld`](world::ProblemWorld) |
//! | [`simulate`] | what a policy earns in a world | [`evaluate`](simulate::evaluate), [`compare`](simulate::compare) |
//! | [`progress`] | watching all this at work | [`Progress`](progress::Progress), [`Silent`](progress::Silent) |
//!
//! All of them share [`error`], [`random`] (one seed, streams by number) and [`parallel`].
//!
//! # What a problem may be
//!
//! - *Hidden modes and events.* Rewards and events hold in regions, before or after the move, in some modes or all, and an event may
//!   change the mode, end the episode or start it anew ([`model::Event`]).
//! - *A model that changes with the step.* From a step on, motion and sensor may be others ([`model::Phase`]), and what is paid or
//!   happens may do so during some steps alone ([`model::Steps`]).
//! - *Readings that are missing.* A sensor says how likely there is one ([`model::Sensor::present`]), and where there was none an agent is
//!   told [`belief::Reading::Nothing`].
//! - *Beliefs of another kind.* A belief is kept by a [`belief::Tracker`]; agents, learners and compilers know it by this trait alone,
//!   so that a filter of one's own may take the place of the Kalman filter.
//!
//! Solvers, learners, worlds and policies of one's own are values of a trait too: [`solve::Planner`], [`solve::Learner`],
//! [`world::World`], [`policy::Policy`].

#![warn(unreachable_pub)]

pub mod belief;
mod digest;
pub mod error;
mod files;
mod memory;
pub mod model;
pub mod parallel;
pub mod policy;
pub mod progress;
pub mod random;
pub mod scenario;
pub mod simulate;
pub mod solve;
pub mod world;

pub use error::{Error, Result};

/// The names that a first program needs.
///
/// ```
/// use pilotage::prelude::*;
///
/// let hallway = ModelBuilder::new("hallway", 0.9)
///     .variable("x", 0.0, 10.0)
///     .start(&[1.0], &[0.5])
///     .motion(&[1.0], &[1.0], &[0.1])
///     .sensor(&[1.0], &[0.4])
///     .action("FORWARD", &[1.0])
///     .action("STAY", &[0.0])
///     .reward(1.0, Clause::new().within("x", 6.0, 7.0))
///     .build()?;
/// let solution = plan(&ValueIteration::default(), &hallway, &Request::default(), &Silent)?;
/// let world = Scenario::assumed(&hallway);
/// let earned = solution.evaluate(&world, Options::default(), &Silent)?;
/// assert!(earned.discounted.mean > 0.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub mod prelude {
    pub use crate::belief::{Belief, BeliefMdp, Reading};
    pub use crate::error::Error;
    pub use crate::model::{Clause, Model, ModelBuilder};
    pub use crate::policy::{Automaton, AutomatonRunner, Policy};
    pub use crate::progress::{Progress, Silent};
    pub use crate::scenario::{self, Scenario};
    pub use crate::simulate::{Evaluation, Options, compare, evaluate};
    pub use crate::solve::{
        Arkaq, Form, Kafaq, Kbvi, Lqg, PolicySearch, Request, Solution, ValueIteration, learn, plan,
    };
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
