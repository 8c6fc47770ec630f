//! What learners share: a body that knows its own noise and acts in worlds it does not know, temporal-difference tables, trials of
//! automata, checkpoints.

mod actor;
pub(super) mod checkpoint;
mod ensure;
mod experience;
mod table;
mod trial;

pub(super) use actor::{Actor, known};
pub use ensure::SettingInfo;
pub(super) use ensure::{described, ensure, set};
pub(super) use experience::Experience;
pub(super) use table::{Rates, Table, Transition, any_action, boltzmann};
pub(super) use trial::{Trial, critical, discounted, run_trial, undiscounted};

use crate::world::World;

/// Makes a world to act in.
pub type Worlds<'a> = dyn Fn() -> Box<dyn World> + Sync + 'a;
