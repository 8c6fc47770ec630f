//! What is true: worlds an agent acts in. The agent never looks inside.
//!
//! A [`World`] takes an action, pays, and writes what is then sensed to an [`Observation`]; its draws come from [`Streams`], so that the
//! same seed gives the same episode. A [`ProblemWorld`] is the world of a scenario. What moves and senses in it is a body, of which there
//! is a file for each simulator; what that pays and changes is said by the model's effects.

mod cart_pole;
mod lawful;
mod linear;
mod noise;
mod observation;
mod problem;
mod robot;

pub(crate) use noise::Noise;
pub use observation::Observation;
pub use problem::ProblemWorld;

use crate::model::{ActionId, ModeId, Then};
use crate::random::{Rng, Role, fork, stream};

/// A world to act in.
pub trait World: Send {
    /// Draws a new true start.
    fn reset(&mut self, draws: &mut Streams);

    /// Takes an action: pays `r(s, a)`, lets events happen, moves the state and writes what is then sensed to `observation`. Nothing
    /// is written when the episode ends or restarts.
    fn step(
        &mut self,
        action: ActionId,
        draws: &mut Streams,
        observation: &mut Observation,
    ) -> Step;

    /// What is paid besides in the current state because an episode ends there, in units of reward.
    fn ending(&self) -> f64 {
        0.0
    }

    /// The true state, for drawings and for agents that are told it.
    fn state(&self) -> &[f64];

    /// The true hidden mode.
    fn mode(&self) -> ModeId;
}

/// What an agent does: an action in a mode, at a step of the episode and in the phase of the model that it belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Doing {
    mode: ModeId,
    action: ActionId,
    phase: usize,
    step: usize,
}

/// What moves and senses in a world. States have length `n`, observations `m`.
trait Body: Send {
    /// Puts it down at a state, or as near as it can stand, and writes where that is.
    fn put(&mut self, state: &mut [f64]) {
        let _ = state;
    }

    /// Writes to `to` where an action leads from a state, noise included.
    fn advance(&mut self, doing: Doing, from: &[f64], to: &mut [f64], rng: &mut Rng);

    /// Moves a state that walls have stopped to where it can stand.
    fn rest(&self, state: &mut [f64]) {
        let _ = state;
    }

    /// Probability that something is sensed in a state, where the body knows better than [`crate::model::Sensor::present`].
    fn present(&self, doing: Doing, state: &[f64]) -> Option<f64> {
        let _ = (doing, state);
        None
    }

    /// Writes what is sensed in a state after an action, noise included. The mode is that afterwards.
    fn sense(&self, doing: Doing, state: &[f64], observation: &mut Observation, rng: &mut Rng);
}

/// What a step in the world did.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// Reward collected.
    pub reward: f64,
    /// Whether the episode goes on. A restart has already been made by the world.
    pub then: Then,
    /// Whether it ended because the state left what [`crate::model::Episode::alive`] allows.
    pub failed: bool,
}

/// The streams of random numbers of one episode in the world.
#[derive(Debug)]
pub struct Streams {
    /// For start and motion.
    pub world: Rng,
    /// For sensors.
    pub sensor: Rng,
}

impl Streams {
    /// The streams of an episode.
    pub fn new(seed: u64, episode: u64) -> Self {
        Self {
            world: stream(seed, episode, Role::World),
            sensor: stream(seed, episode, Role::Sensor),
        }
    }

    /// The same streams from where they are, for an episode that goes on in two ways.
    pub(crate) fn fork(&self) -> Self {
        Self {
            world: fork(&self.world),
            sensor: fork(&self.sensor),
        }
    }
}
