//! Trials: what an automaton earns in the worlds it was learned in.

use crate::belief::gaussian::normal_cdf;
use crate::belief::{Belief, Reading};
use crate::model::Model;
use crate::parallel;
use crate::policy::{Automaton, AutomatonRunner};
use crate::simulate::{Agent, Episode, run_episode};
use crate::solve::learn::Worlds;
use crate::world::{Observation, Streams};

/// Trials are episodes of this number and up, which learning never reaches.
const TRIALS: u64 = 1 << 40;

/// Episodes of a trial that one thread runs at a time.
const CHUNK: usize = 25;

/// What an automaton earned.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Trial {
    pub episodes: Vec<Episode>,
    /// Steps spent in each node.
    pub visits: Vec<f64>,
}

impl Trial {
    /// Steps taken.
    pub(crate) fn steps(&self) -> u64 {
        self.episodes
            .iter()
            .map(|episode| episode.steps as u64)
            .sum()
    }

    /// Mean of a return.
    pub(crate) fn mean(&self, of: fn(&Episode) -> f64) -> f64 {
        self.episodes.iter().map(of).sum::<f64>() / self.episodes.len() as f64
    }

    /// Standard errors by which a return exceeds that of another trial, episode by episode.
    pub(crate) fn excess(&self, other: &Self, of: fn(&Episode) -> f64) -> f64 {
        let pairs = self.episodes.iter().zip(&other.episodes);
        let differences: Vec<f64> = pairs.map(|(a, b)| of(a) - of(b)).collect();
        let estimate = crate::simulate::Estimate::of(differences.iter().copied());
        if estimate.mean == 0.0 {
            0.0
        } else {
            estimate.mean / estimate.stderr
        }
    }

    /// Whether neither return is less than that of another trial by more than this share of it, nor surely (by so many standard
    /// errors) less at all.
    pub(crate) fn loses_nothing(&self, before: &Self, worth: f64, surely: f64) -> bool {
        [discounted, undiscounted].into_iter().all(|of| {
            let least = before.mean(of) - worth * before.mean(of).abs();
            self.mean(of) >= least && self.excess(before, of) > -surely
        })
    }
}

/// Discounted return of an episode.
pub(crate) fn discounted(episode: &Episode) -> f64 {
    episode.discounted
}

/// Undiscounted return of an episode.
pub(crate) fn undiscounted(episode: &Episode) -> f64 {
    episode.undiscounted
}

/// Runs an automaton that learning in `model` made, for so many episodes, the same ones at every trial.
pub(crate) fn run_trial(
    model: &Model,
    worlds: &Worlds<'_>,
    automaton: &Automaton,
    episodes: usize,
    seed: u64,
) -> Trial {
    let controller = AutomatonRunner::new(automaton);
    let chunks = parallel::map(episodes.div_ceil(CHUNK), |chunk| {
        let mut world = worlds();
        let mut agent = Visitor {
            controller: controller.clone(),
            visits: vec![0.0; automaton.nodes.len()],
        };
        let mut observation = Observation::new(model.observation_dim());
        let range = chunk * CHUNK..((chunk + 1) * CHUNK).min(episodes);
        let returns: Vec<Episode> = range
            .map(|episode| {
                let mut draws = Streams::new(seed, TRIALS + episode as u64);
                let limits = (model.episode.length, model.discount);
                run_episode(
                    world.as_mut(),
                    &mut agent,
                    &mut draws,
                    &mut observation,
                    limits,
                    &mut |_, _| {},
                )
            })
            .collect();
        (returns, agent.visits)
    });
    let mut trial = Trial {
        episodes: Vec::with_capacity(episodes),
        visits: vec![0.0; automaton.nodes.len()],
    };
    for (episodes, visits) in chunks {
        trial.episodes.extend(episodes);
        trial
            .visits
            .iter_mut()
            .zip(visits)
            .for_each(|(sum, visits)| *sum += visits);
    }
    trial
}

/// Runs an automaton and counts where it is.
struct Visitor {
    controller: AutomatonRunner,
    visits: Vec<f64>,
}

impl Agent for Visitor {
    fn reset(&mut self) {
        self.controller.reset();
    }

    fn act(&mut self) -> usize {
        let (node, action) = self.controller.decide();
        self.visits[node] += 1.0;
        action
    }

    fn observe(&mut self, action: usize, reading: Reading<'_>) {
        self.controller.observe(action, reading);
    }

    fn belief(&self) -> Option<&Belief> {
        Some(self.controller.belief())
    }
}

/// The `z` that N(0, 1) exceeds with the given probability, in `(0, 0.5)`.
pub(crate) fn critical(probability: f64) -> f64 {
    let (mut low, mut high) = (0.0, 40.0);
    for _ in 0..80 {
        let middle: f64 = 0.5 * (low + high);
        if normal_cdf(-middle) > probability {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn critical_values_are_those_of_the_tables() {
        for (probability, z) in [(0.05, 1.6448536), (0.001, 3.0902323), (0.025, 1.9599640)] {
            assert!((critical(probability) - z).abs() < 1e-6);
        }
    }
}
