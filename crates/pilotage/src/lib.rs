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
//! *uncertainty level* and a mean ([`belief`]). Solvers ([`solve`]) find what to do at every belief; what they find becomes an
//! automaton ([`policy`]) that runs without allocating and that can be saved, read and drawn. Data flows one way:
//! [`model`], [`belief`], [`solve`], [`policy`], [`simulate`]; what is true is a [`world`], into which no agent looks.
//!
//! ```
//! use pilotage::{progress::Silent, scenario, simulate::Options};
//! use pilotage::solve::{Request, ValueIteration, plan};
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
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

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

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
