//! How long a policy lasts before it fails.

use serde::{Deserialize, Serialize};

use super::{Agent, Estimate, TrackingAgent};
use crate::belief::Tracking;
use crate::model::{Model, Then};
use crate::parallel;
use crate::policy::Policy;
use crate::progress::Progress;
use crate::scenario::Scenario;
use crate::world::{Observation, ProblemWorld, Streams, World};

/// How long to watch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LifeOptions {
    /// Independent runs, at least 1.
    pub runs: usize,
    /// Steps of each; whoever fails starts a new life within them. At least 1.
    pub steps: u64,
    /// Seed of every random number; a run's own are those of the episode with its number.
    pub seed: u64,
}

/// One run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Run {
    /// Steps taken.
    pub steps: u64,
    /// Lives that ended in failure.
    pub failures: u64,
    /// Those of them that ended within their first hundred steps, while the agent finds out where it is.
    pub early: u64,
}

/// Steps and failures, counted; nothing is thrown away when a run stops in the middle of a life.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Life {
    /// The runs, in order.
    pub runs: Vec<Run>,
}

const EARLY: u64 = 100;

impl Life {
    /// Steps taken in all runs.
    pub fn steps(&self) -> u64 {
        self.runs.iter().map(|run| run.steps).sum()
    }

    /// Failures in all runs.
    pub fn failures(&self) -> u64 {
        self.runs.iter().map(|run| run.failures).sum()
    }

    /// Failures of all runs within the first hundred steps of a life.
    pub fn early(&self) -> u64 {
        self.runs.iter().map(|run| run.early).sum()
    }

    /// Steps per failure, with the standard error of a Poisson count; `None` where nothing failed.
    pub fn mean(&self) -> Option<Estimate> {
        let failures = self.failures() as f64;
        let mean = self.steps() as f64 / failures;
        (failures > 0.0).then_some(Estimate {
            mean,
            stderr: mean / failures.sqrt(),
        })
    }

    /// Where nothing failed, the mean life is at least this with 95% confidence: `steps / ln 20`.
    pub fn at_least(&self) -> f64 {
        self.steps() as f64 / 20.0_f64.ln()
    }

    /// Runs without a failure.
    pub fn unfailing(&self) -> usize {
        self.runs.iter().filter(|run| run.failures == 0).count()
    }
}

/// Runs the policy in the scenario's world, starting a new life after every failure; the length of episodes does not count. The same
/// numbers for any number of threads.
pub fn life(
    scenario: &Scenario,
    tracking: &dyn Tracking,
    policy: &dyn Policy,
    options: LifeOptions,
    observer: &dyn Progress,
) -> Life {
    let done = std::sync::atomic::AtomicU64::new(0);
    let runs = parallel::map(options.runs, |run| {
        let mut world = ProblemWorld::new(scenario);
        let mut agent = TrackingAgent::new(tracking, policy);
        let mut draws = Streams::new(options.seed, run as u64);
        let counted = run_lives(
            &mut world,
            &mut agent,
            &mut draws,
            &scenario.model,
            options.steps,
        );
        let done = done.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1;
        observer.progress("runs", done, options.runs as u64);
        counted
    });
    Life { runs }
}

fn run_lives(
    world: &mut dyn World,
    agent: &mut dyn Agent,
    draws: &mut Streams,
    model: &Model,
    steps: u64,
) -> Run {
    let mut observation = Observation::new(model.observation_dim());
    let mut run = Run {
        steps,
        failures: 0,
        early: 0,
    };
    let mut age = 0;
    world.reset(draws);
    agent.reset();
    for _ in 0..steps {
        let action = agent.act();
        let step = world.step(action, draws, &mut observation);
        age += 1;
        if step.failed {
            run.failures += 1;
            run.early += u64::from(age <= EARLY);
        }
        match step.then {
            Then::Continue => agent.observe(action, observation.reading()),
            Then::Restart => agent.reset(),
            Then::End => {
                world.reset(draws);
                agent.reset();
                age = 0;
            }
        }
    }
    run
}
