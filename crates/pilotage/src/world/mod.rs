//! What is true: worlds an agent acts in. The agent never looks inside.

mod cart_pole;
mod noise;
mod problem;
mod robot;

pub use cart_pole::Plant;
pub use noise::Noise;
pub use problem::ProblemWorld;
pub use robot::RobotArena;

use crate::model::{ActionId, ModeId, Then};
use crate::random::{Rng, Role, stream};

/// A world to act in.
pub trait World: Send {
    /// Draws a new true start.
    fn reset(&mut self, draws: &mut Draws);

    /// Takes an action: pays `r(s, a)`, lets events happen, moves the state and writes what is then sensed (length `m`) to
    /// `observation`. Nothing is sensed when the episode ends or restarts.
    fn step(&mut self, action: ActionId, draws: &mut Draws, observation: &mut [f64]) -> Step;

    /// The true state, for drawings and for agents that are told it.
    fn state(&self) -> &[f64];

    /// The true hidden mode.
    fn mode(&self) -> ModeId;
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
pub struct Draws {
    /// For start and motion.
    pub world: Rng,
    /// For sensors.
    pub sensor: Rng,
}

impl Draws {
    /// The streams of an episode.
    pub fn new(seed: u64, episode: u64) -> Self {
        Self {
            world: stream(seed, episode, Role::World),
            sensor: stream(seed, episode, Role::Sensor),
        }
    }
}
