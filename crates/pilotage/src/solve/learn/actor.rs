//! An agent that acts: a world and the belief about it.

use crate::belief::{Belief, Tracker, Tracking};
use crate::model::{ActionId, Then};
use crate::solve::learn::Worlds;
use crate::world::{Observation, Step, Streams, World};

/// A world and the belief about it.
pub(crate) struct Actor<'a> {
    world: Box<dyn World>,
    tracker: Box<dyn Tracker + 'a>,
    observation: Observation,
}

impl<'a> Actor<'a> {
    /// An actor in a new world, with a sensor of so many readings.
    pub(crate) fn new(worlds: &Worlds<'_>, tracking: &'a dyn Tracking, readings: usize) -> Self {
        Self {
            world: worlds(),
            tracker: tracking.tracker(),
            observation: Observation::new(readings),
        }
    }

    /// What it believes.
    pub(crate) fn belief(&self) -> &Belief {
        self.tracker.belief()
    }

    /// Starts an episode.
    pub(crate) fn reset(&mut self, draws: &mut Streams) {
        self.world.reset(draws);
        self.tracker.reset();
    }

    /// Takes an action and what it brings into the belief.
    pub(crate) fn step(&mut self, action: ActionId, draws: &mut Streams) -> Step {
        let step = self.world.step(action, draws, &mut self.observation);
        match step.then {
            Then::Continue => self.tracker.update(action, self.observation.reading()),
            Then::Restart => self.tracker.reset(),
            Then::End => {}
        }
        step
    }
}
