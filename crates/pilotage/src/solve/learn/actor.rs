//! An agent that acts: a world, the belief about it, and the part of a model that it is told.

use crate::belief::{Belief, Filter};
use crate::model::{ActionId, Model, Then};
use crate::solve::learn::Worlds;
use crate::world::{Step, Streams, World};

/// A world and the belief about it.
pub struct Actor<'a> {
    world: Box<dyn World>,
    filter: &'a Filter,
    pub belief: Belief,
    scratch: Vec<f64>,
    observation: Vec<f64>,
}

impl<'a> Actor<'a> {
    /// An actor in a new world, whose belief `filter` keeps.
    pub fn new(worlds: &Worlds<'_>, filter: &'a Filter) -> Self {
        Self {
            world: worlds(),
            filter,
            belief: filter.initial(),
            scratch: vec![0.0; filter.states()],
            observation: vec![0.0; filter.readings()],
        }
    }

    /// Starts an episode.
    pub fn reset(&mut self, draws: &mut Streams) {
        self.world.reset(draws);
        self.filter.reset(&mut self.belief);
    }

    /// Takes an action and what it brings into the belief.
    pub fn step(&mut self, action: ActionId, draws: &mut Streams) -> Step {
        let step = self.world.step(action, draws, &mut self.observation);
        match step.then {
            Then::Continue => {
                let (belief, scratch) = (&mut self.belief, &mut self.scratch);
                self.filter
                    .update(belief, action, &self.observation, scratch);
            }
            Then::Restart => self.filter.reset(&mut self.belief),
            Then::End => {}
        }
        step
    }
}

/// The part of a model that a learner is told.
pub fn known(model: &Model) -> Model {
    let mut start = model.start.clone();
    start.iter_mut().for_each(|hypothesis| hypothesis.mode = 0);
    Model {
        modes: vec![String::new()],
        start,
        rewards: Vec::new(),
        events: Vec::new(),
        cost: None,
        map: None,
        ..model.clone()
    }
}
