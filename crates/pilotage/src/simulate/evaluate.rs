//! What a policy earns, with its standard error.

use serde::{Deserialize, Serialize};

use super::{Agent, Episode, FilterAgent, run_episode};
use crate::belief::Filter;
use crate::observe::Observer;
use crate::parallel;
use crate::policy::Policy;
use crate::scenario::Scenario;
use crate::world::{Draws, ProblemWorld};

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

/// A mean with its standard error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// Mean over episodes.
    pub mean: f64,
    /// Standard error of the mean; 0 for a single episode.
    pub stderr: f64,
}

impl Estimate {
    /// Mean and standard error of a sample, summed in its order.
    pub fn of(sample: impl ExactSizeIterator<Item = f64> + Clone) -> Self {
        let count = sample.len() as f64;
        let mean = sample.clone().sum::<f64>() / count;
        let squares: f64 = sample.map(|value| (value - mean) * (value - mean)).sum();
        Self {
            mean,
            stderr: if count > 1.0 {
                (squares / (count - 1.0) / count).sqrt()
            } else {
                0.0
            },
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
}

/// Discounted return of one policy less that of another, over the same episodes.
pub type Difference = Estimate;

const CHUNK: usize = 64;

/// Runs the policy in the scenario's world. The same numbers for any number of threads.
pub fn evaluate(
    scenario: &Scenario,
    filter: &Filter,
    policy: &dyn Policy,
    options: Options,
    observer: &dyn Observer,
) -> Evaluation {
    summarise(&episodes(
        scenario,
        &|| Box::new(FilterAgent::new(filter, policy)),
        options,
        observer,
    ))
}

/// As [`evaluate`], for agents of any make.
pub fn evaluate_agents<'a>(
    scenario: &Scenario,
    agent: &(dyn Fn() -> Box<dyn Agent + 'a> + Sync),
    options: Options,
    observer: &dyn Observer,
) -> Evaluation {
    summarise(&episodes(scenario, agent, options, observer))
}

/// Discounted return of `first` less that of `second` in the same worlds with the same noise, a paired comparison.
pub fn compare(
    scenario: &Scenario,
    filter: &Filter,
    first: &dyn Policy,
    second: &dyn Policy,
    options: Options,
    observer: &dyn Observer,
) -> Difference {
    let run = |policy| {
        episodes(
            scenario,
            &|| Box::new(FilterAgent::new(filter, policy)),
            options,
            observer,
        )
    };
    let (first, second) = (run(first), run(second));
    Estimate::of(
        first
            .iter()
            .zip(&second)
            .map(|(a, b)| a.discounted - b.discounted),
    )
}

fn episodes<'a>(
    scenario: &Scenario,
    agent: &(dyn Fn() -> Box<dyn Agent + 'a> + Sync),
    options: Options,
    observer: &dyn Observer,
) -> Vec<Episode> {
    let model = &scenario.model;
    let limits = (model.episode.length, model.discount);
    run_all(options, observer, &|| {
        let mut world = ProblemWorld::new(scenario);
        let mut agent = agent();
        let mut observation = vec![0.0; model.observation_dim()];
        Box::new(move |episode| {
            run_episode(
                &mut world,
                agent.as_mut(),
                &mut Draws::new(options.seed, episode),
                &mut observation,
                limits,
                &mut |_, _| {},
            )
        })
    })
}

/// Something that runs the episode of a number.
pub(crate) type Runner<'a> = Box<dyn FnMut(u64) -> Episode + 'a>;

/// Runs all episodes, in chunks that each have a runner of their own.
pub(crate) fn run_all<'a>(
    options: Options,
    observer: &dyn Observer,
    runner: &(dyn Fn() -> Runner<'a> + Sync),
) -> Vec<Episode> {
    let chunks = options.episodes.div_ceil(CHUNK);
    let done = std::sync::atomic::AtomicU64::new(0);
    parallel::map(chunks, |chunk| {
        let range = chunk * CHUNK..((chunk + 1) * CHUNK).min(options.episodes);
        let count = range.len() as u64;
        let mut run = runner();
        let episodes: Vec<Episode> = range.map(|episode| run(episode as u64)).collect();
        let done = done.fetch_add(count, std::sync::atomic::Ordering::Relaxed) + count;
        observer.progress("episodes", done, options.episodes as u64);
        episodes
    })
    .concat()
}

pub(crate) fn summarise(episodes: &[Episode]) -> Evaluation {
    Evaluation {
        episodes: episodes.len(),
        discounted: Estimate::of(episodes.iter().map(|episode| episode.discounted)),
        undiscounted: Estimate::of(episodes.iter().map(|episode| episode.undiscounted)),
        steps: Estimate::of(episodes.iter().map(|episode| episode.steps as f64)),
        failed: episodes.iter().filter(|episode| episode.failed).count() as f64
            / episodes.len() as f64,
    }
}
