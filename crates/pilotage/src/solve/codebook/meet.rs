//! Beliefs that are met by acting in the world that a model assumes.

use crate::belief::{Keeping, Moments};
use crate::model::{Model, Then};
use crate::parallel;
use crate::policy::first_best;
use crate::random::{Rng, Role, stream, uniform};
use crate::scenario::Scenario;
use crate::solve::codebook::GridValues;
use crate::world::{Observation, ProblemWorld, Streams, World};

/// A belief that was met.
pub(in crate::solve) struct Met<F> {
    pub full: F,
    pub moments: Moments,
}

/// Share of actions that are taken at random when a policy is followed.
const SLIPS: f64 = 0.15;

/// Chance that a random walk changes its action.
const TURNS: f64 = 0.2;

/// Most beliefs that are kept of one episode.
const MOST: usize = 100;

/// Runs so many episodes and returns the beliefs met at their decisions: those of a policy that slips now and then, or of walks that take
/// an action for a while and then another. The same for any number of threads.
pub(in crate::solve) fn meet<K: Keeping>(
    model: &Model,
    keeping: &K,
    policy: Option<&GridValues>,
    episodes: usize,
    seed: u64,
) -> Vec<Met<K::Full>> {
    let assumed = Scenario::assumed(model);
    let runs = parallel::map(episodes, |episode| {
        let mut world = ProblemWorld::new(&assumed);
        let mut draws = Streams::new(seed, episode as u64);
        let mut whims = stream(seed, episode as u64, Role::Exploration);
        let mut observation = Observation::new(model.observation_dim());
        let mut met = Vec::new();
        let mut action = any(model, &mut whims);
        let mut full = keeping.start();
        world.reset(&mut draws);
        let mut step = 0;
        for _ in 0..model.episode.length.min(MOST) {
            let mut moments = Moments {
                step,
                ..Moments::default()
            };
            keeping.moments(&full, &mut moments);
            action = match policy {
                Some(policy) if uniform(&mut whims) >= SLIPS => {
                    first_best(&policy.values_between(&moments))
                }
                None if uniform(&mut whims) >= TURNS => action,
                _ => any(model, &mut whims),
            };
            met.push(Met {
                full: full.clone(),
                moments,
            });
            let taken = world.step(action, &mut draws, &mut observation);
            match taken.then {
                Then::End => break,
                Then::Restart => (full, step) = (keeping.start(), 0),
                Then::Continue => {
                    keeping.go_on(&mut full, action, step);
                    keeping.sense(&mut full, action, step, observation.reading());
                    step += 1;
                }
            }
        }
        met
    });
    runs.into_iter().flatten().collect()
}

fn any(model: &Model, whims: &mut Rng) -> usize {
    let actions = model.actions.len();
    ((uniform(whims) * actions as f64) as usize).min(actions - 1)
}
