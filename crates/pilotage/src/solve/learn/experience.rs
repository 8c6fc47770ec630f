//! What a learner has met, and the random numbers of what it will meet next.

use serde::{Deserialize, Serialize};

use crate::random::{Rng, Role, stream};
use crate::world::Streams;

/// More episodes or steps than any run comes to.
pub(super) const MOST_COUNTED: u64 = 1 << 60;

/// What a learner has met.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(crate) struct Experience {
    pub episodes: u64,
    pub samples: u64,
    /// Smallest and largest reward, 0 included.
    pub rewards: (f64, f64),
    /// Notable rewards with the mean at which they were seen.
    pub events: Vec<(f64, Vec<f64>)>,
}

impl Experience {
    /// Whether it is that of a run so far, in a state of so many variables.
    pub(crate) fn fits(&self, states: usize) -> bool {
        let counted = |count: u64| count <= MOST_COUNTED;
        counted(self.episodes)
            && counted(self.samples)
            && self.rewards.0 <= 0.0
            && self.rewards.1 >= 0.0
            && self.events.iter().all(|(_, mean)| mean.len() == states)
    }

    /// Random numbers of the next episode: for the world, and for exploration.
    pub(crate) fn next_episode(&mut self, seed: u64) -> (Streams, Rng) {
        let episode = self.episodes;
        self.episodes += 1;
        (
            Streams::new(seed, episode),
            stream(seed, episode, Role::Exploration),
        )
    }

    /// Takes in a step.
    pub(crate) fn collect(&mut self, reward: f64) {
        self.samples += 1;
        self.rewards = (self.rewards.0.min(reward), self.rewards.1.max(reward));
    }

    /// Whether a reward is at least this share of the largest one met.
    pub(crate) fn is_notable(&self, reward: f64, share: f64) -> bool {
        reward > 0.0 && reward >= share * self.rewards.1
    }

    /// Difference between the largest and the smallest reward, more than 0.
    pub(crate) fn reward_range(&self) -> f64 {
        (self.rewards.1 - self.rewards.0).max(1e-6)
    }
}
