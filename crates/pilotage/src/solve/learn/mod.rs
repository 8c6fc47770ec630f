//! What learners share: a body that knows its own noise and acts in worlds it does not know, temporal-difference tables, trials of
//! automata, and the loop that runs a learner, with its checkpoints.

mod actor;
mod body;
mod checkpoint;
mod experience;
mod run;
mod table;
mod trial;

pub(super) use actor::Actor;
pub(super) use body::{Strata, beliefs, unbounded};
pub use checkpoint::Owner;
pub(super) use experience::Experience;
pub(super) use run::fitting;
pub use run::{Course, Learned, Run, learn};
pub(super) use table::{Rates, Table, Transition, any_action, boltzmann};
pub(super) use trial::{Trial, critical, discounted, run_trial, undiscounted};

pub(super) use super::solver::Worlds;
