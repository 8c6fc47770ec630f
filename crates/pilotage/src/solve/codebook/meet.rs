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

/// How beliefs are met.
#[derive(Clone, Copy)]
pub(in crate::solve) enum Walk<'a> {
    /// By taking any action for a while and then another.
    Blind,
    /// The same, but none by which the episode is most likely over: it leads to no belief.
    Wary,
    /// By following a plan that now and then gives way to a wary walk.
    Following(&'a GridValues),
}

/// Share of actions that are taken at random when a plan is followed.
const SLIPS: f64 = 0.15;

/// Chance that a random walk changes its action.
const TURNS: f64 = 0.2;

/// Most beliefs that are kept of one episode.
const MOST: usize = 100;

/// Runs so many episodes and returns the beliefs met at their decisions. The same for any number of threads.
pub(in crate::solve) fn meet<K: Keeping>(
    model: &Model,
    keeping: &K,
    walk: Walk<'_>,
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
        let mut full = keeping.start();
        world.reset(&mut draws);
        let mut step = 0;
        let mut action = walk.any(keeping, (&full, step), &mut whims);
        for _ in 0..model.episode.length.min(MOST) {
            let mut moments = Moments {
                step,
                ..Moments::default()
            };
            keeping.moments(&full, &mut moments);
            action = match walk {
                Walk::Following(plan) if uniform(&mut whims) >= SLIPS => {
                    first_best(&plan.values_between(&moments))
                }
                Walk::Blind | Walk::Wary if uniform(&mut whims) >= TURNS => action,
                _ => walk.any(keeping, (&full, step), &mut whims),
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

impl Walk<'_> {
    /// An action at random.
    fn any<K: Keeping>(
        self,
        keeping: &K,
        (full, step): (&K::Full, usize),
        whims: &mut Rng,
    ) -> usize {
        let goes_on = |action: &usize| match self {
            Self::Blind => true,
            Self::Wary | Self::Following(_) => {
                keeping.act(&mut full.clone(), *action, step).ended < 0.5
            }
        };
        let actions: Vec<usize> = (0..keeping.actions()).filter(goes_on).collect();
        // Where all of them end it, it is any.
        let count = match actions.len() {
            0 => keeping.actions(),
            count => count,
        };
        let drawn = ((uniform(whims) * count as f64) as usize).min(count - 1);
        actions.get(drawn).copied().unwrap_or(drawn)
    }
}
