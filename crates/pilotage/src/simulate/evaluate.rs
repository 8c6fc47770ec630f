//! What a policy earns, with its standard error.

use std::sync::atomic::{AtomicU64, Ordering};

use serde::{Deserialize, Serialize};

use super::estimate::{Estimate, Moments};
use super::{Agent, Episode, TrackingAgent, run_episode};
use crate::belief::{LARGEST, Tracking};
use crate::error::{Error, Result};
use crate::parallel;
use crate::policy::Policy;
use crate::progress::Progress;
use crate::scenario::Scenario;
use crate::world::{Observation, ProblemWorld, Streams};

/// How to evaluate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// Episodes to run, at least 1.
    pub episodes: usize,
    /// Seed of every random number.
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            episodes: 10_000,
            seed: 1,
        }
    }
}

/// What a policy earned.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Evaluation {
    /// Episodes run.
    pub episodes: usize,
    /// Discounted return.
    pub discounted: Estimate,
    /// Undiscounted return.
    pub undiscounted: Estimate,
    /// Steps of an episode.
    pub steps: Estimate,
    /// Share of episodes that ended in failure.
    pub failed: f64,
    /// Where the agent no longer had a belief; the numbers above then say little.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lost: Option<Lost>,
}

/// A belief whose mean had grown to [`crate::belief::LARGEST`], beyond which filters keep none: the state, or the filter's own numbers, grow
/// without end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Lost {
    /// Number of the first episode in which it happened, from 0.
    pub episode: u64,
    /// Steps of that episode until then.
    pub step: usize,
    /// Episodes in which it happened. They count as ended there.
    pub episodes: u64,
}

impl Evaluation {
    /// Whether every belief was one, so that the numbers say what the policy earns.
    ///
    /// # Errors
    /// [`Error::Lost`] with the first episode and step at which one was not.
    pub fn check(&self) -> Result<()> {
        match self.lost {
            None => Ok(()),
            Some(Lost { episode, step, .. }) => Err(Error::Lost {
                episode,
                step,
                largest: LARGEST,
            }),
        }
    }
}

/// Discounted return of one policy less that of another, over the same episodes.
pub type Difference = Estimate;

/// Episodes that a thread runs at a time.
const CHUNK: usize = 64;

/// Chunks whose episodes are kept until they are counted, in order.
const CHUNKS: usize = 1024;

/// Runs the policy in the scenario's world. The same numbers for any number of threads.
pub fn evaluate(
    scenario: &Scenario,
    tracking: &dyn Tracking,
    policy: &dyn Policy,
    options: Options,
    observer: &dyn Progress,
) -> Evaluation {
    summarise(options, observer, &|| {
        episodes(
            scenario,
            Box::new(TrackingAgent::new(tracking, policy)),
            options,
        )
    })
}

/// Makes agents, each for a number of episodes.
pub type Agents<'a, 'b> = dyn Fn() -> Box<dyn Agent + 'a> + Sync + 'b;

/// Runs agents in the scenario's world, each made anew for a number of episodes. The same numbers for any number of threads.
pub fn evaluate_agent(
    scenario: &Scenario,
    agent: &Agents<'_, '_>,
    options: Options,
    observer: &dyn Progress,
) -> Evaluation {
    summarise(options, observer, &|| episodes(scenario, agent(), options))
}

/// Discounted return of `first` less that of `second` in the same worlds with the same noise, a paired comparison.
pub fn compare(
    scenario: &Scenario,
    tracking: &dyn Tracking,
    first: &dyn Policy,
    second: &dyn Policy,
    options: Options,
    observer: &dyn Progress,
) -> Difference {
    let first = || -> Box<dyn Agent + '_> { Box::new(TrackingAgent::new(tracking, first)) };
    let second = || -> Box<dyn Agent + '_> { Box::new(TrackingAgent::new(tracking, second)) };
    compare_agents(scenario, &first, &second, options, observer)
}

/// The same for agents, whatever they keep.
pub fn compare_agents(
    scenario: &Scenario,
    first: &Agents<'_, '_>,
    second: &Agents<'_, '_>,
    options: Options,
    observer: &dyn Progress,
) -> Difference {
    evaluate_both(scenario, (first, second), options, observer).1
}

/// What two agents earn in the same worlds with the same noise, and how much more the first earns.
pub fn evaluate_both(
    scenario: &Scenario,
    (first, second): (&Agents<'_, '_>, &Agents<'_, '_>),
    options: Options,
    observer: &dyn Progress,
) -> ([Evaluation; 2], Difference) {
    let [mut ours, mut theirs] = [Tally::default(), Tally::default()];
    let mut gain = Moments::default();
    let runner = || {
        let mut first = episodes(scenario, first(), options);
        let mut second = episodes(scenario, second(), options);
        Box::new(move |episode| (first(episode), second(episode))) as Runner<_>
    };
    run_all(
        options.episodes,
        "episodes",
        observer,
        &runner,
        &mut |(first, second): (Episode, Episode)| {
            gain.add(first.discounted - second.discounted);
            ours.add(&first);
            theirs.add(&second);
        },
    );
    ([ours.evaluation(), theirs.evaluation()], gain.estimate())
}

/// Something that runs the episode of a number.
pub(crate) type Runner<'a, T> = Box<dyn FnMut(u64) -> T + 'a>;

/// Runs an agent in a scenario's world.
fn episodes<'a>(
    scenario: &'a Scenario,
    mut agent: Box<dyn Agent + 'a>,
    options: Options,
) -> Runner<'a, Episode> {
    let model = &scenario.model;
    let limits = (model.episode.length, model.discount);
    let mut world = ProblemWorld::new(scenario);
    let mut observation = Observation::new(model.observation_dim());
    Box::new(move |episode| {
        run_episode(
            &mut world,
            agent.as_mut(),
            &mut Streams::new(options.seed, episode),
            &mut observation,
            limits,
            &mut |_, _| {},
        )
    })
}

/// Runs so many episodes, in chunks that each have a runner of their own, and hands over what comes of them, in order. However many
/// they are, few are kept at a time.
pub(crate) fn run_all<'a, T: Send>(
    episodes: usize,
    stage: &'static str,
    observer: &dyn Progress,
    runner: &(dyn Fn() -> Runner<'a, T> + Sync),
    take: &mut dyn FnMut(T),
) {
    let done = AtomicU64::new(0);
    let mut from = 0;
    while from < episodes {
        let count = (episodes - from).min(CHUNK * CHUNKS);
        let wave = parallel::map(count.div_ceil(CHUNK), |chunk| {
            let range = chunk * CHUNK..((chunk + 1) * CHUNK).min(count);
            let size = range.len() as u64;
            let mut run = runner();
            let results: Vec<T> = range.map(|episode| run((from + episode) as u64)).collect();
            let done = done.fetch_add(size, Ordering::Relaxed) + size;
            observer.progress(stage, done, episodes as u64);
            results
        });
        wave.into_iter().flatten().for_each(&mut *take);
        from += count;
    }
}

/// Runs all episodes, and what they earned.
pub(crate) fn summarise<'a>(
    options: Options,
    observer: &dyn Progress,
    runner: &(dyn Fn() -> Runner<'a, Episode> + Sync),
) -> Evaluation {
    let mut tally = Tally::default();
    run_all(
        options.episodes,
        "episodes",
        observer,
        runner,
        &mut |episode: Episode| tally.add(&episode),
    );
    tally.evaluation()
}

/// What was earned in the episodes so far.
#[derive(Default)]
struct Tally {
    discounted: Moments,
    undiscounted: Moments,
    steps: Moments,
    failed: u64,
    lost: Option<Lost>,
}

impl Tally {
    fn add(&mut self, episode: &Episode) {
        if episode.lost {
            let first = Lost {
                episode: self.discounted.count(),
                step: episode.steps,
                episodes: 0,
            };
            self.lost.get_or_insert(first).episodes += 1;
        }
        self.discounted.add(episode.discounted);
        self.undiscounted.add(episode.undiscounted);
        self.steps.add(episode.steps as f64);
        self.failed += u64::from(episode.failed);
    }

    fn evaluation(&self) -> Evaluation {
        let episodes = self.discounted.count();
        Evaluation {
            episodes: episodes as usize,
            discounted: self.discounted.estimate(),
            undiscounted: self.undiscounted.estimate(),
            steps: self.steps.estimate(),
            failed: self.failed as f64 / episodes as f64,
            lost: self.lost,
        }
    }
}
