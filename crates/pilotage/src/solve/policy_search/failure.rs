//! How likely a policy is to fail, without waiting for it to fail.
//!
//! Beliefs are simulated, not states: at every step the belief itself says how likely the true state is outside the limits. The
//! average of that over a run is the probability of failing in a step, found with far fewer steps than counting failures takes
//! (Rao-Blackwell). A run starts afresh with just that probability.
//!
//! At the start of an episode the agent may be so uncertain that hardly any state it thinks possible is within the limits, while it is
//! there to act only because the true one is. A start is then drawn as the agent believes it, from those within the limits, and it is
//! the belief of an observer who was told it that says how likely the state is outside.

use nalgebra::{DMatrix, DVector};

use crate::belief::gaussian::exit_probability;
use crate::belief::{Belief, BeliefMdp, Filter, StratumId};
use crate::model::{Interval, Model, Region, StartHypothesis, StartShape};
use crate::parallel;
use crate::policy::Policy;
use crate::random::{Rng, Role, stream, uniform};
use crate::scenario::Scenario;
use crate::world::{Noise, ProblemWorld, Streams, World};

/// Runs of beliefs from one kind of start.
#[derive(Debug)]
pub struct Runs {
    /// Keeps the belief that is acted on.
    agent: Filter,
    /// Who is told where each run begins; nobody where the agent's own belief is all there is to know.
    observer: Option<Observer>,
    /// What the belief that tells of failures is made of: of the observer, or else the agent.
    covariances: Vec<DMatrix<f64>>,
    alive: Region,
    /// `H A` row by row, `H B u` by action, innovation by level and action.
    carried: Vec<f64>,
    pushed: Vec<Vec<f64>>,
    innovations: Vec<Vec<Noise>>,
}

/// A filter that begins with certainty.
#[derive(Debug)]
struct Observer {
    filter: Filter,
    /// Starts are drawn here.
    scenario: Scenario,
}

/// How many runs, how long, from which seed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sample {
    /// Runs, at least 1.
    pub runs: usize,
    /// Steps of each, at least 1.
    pub steps: usize,
    /// Seed of their random numbers.
    pub seed: u64,
}

impl Runs {
    /// Runs that begin and stay at a level that repeats itself, from a mean (length `n`).
    pub fn steady(mdp: &BeliefMdp, level: StratumId, mean: &[f64]) -> Self {
        let start = Belief {
            stratum: level,
            mode: mdp.start().mode,
            mean: mean.to_vec(),
        };
        Self::new(mdp, mdp.filter_from(&start), None)
    }

    /// Runs that begin as an episode does, at a state within the limits that the agent is not told.
    pub fn from_start(mdp: &BeliefMdp) -> Self {
        let model = mdp.model();
        let n = model.state_dim();
        let certain = StartHypothesis {
            weight: 1.0,
            mode: mdp.start().mode,
            mean: DVector::zeros(n),
            covariance: DMatrix::zeros(n, n),
            shape: StartShape::Normal,
        };
        let told = BeliefMdp::new(&Model {
            start: vec![certain],
            ..model.clone()
        });
        let observer = Observer {
            filter: told.filter(),
            scenario: Scenario::assumed(model),
        };
        Self::new(&told, mdp.filter(), Some(observer))
    }

    fn new(mdp: &BeliefMdp, agent: Filter, observer: Option<Observer>) -> Self {
        let (model, levels) = (mdp.model(), mdp.levels());
        let actions = 0..model.actions.len();
        let h = &model.sensor.h;
        let innovation = |level, action| {
            let step = levels.step(level, levels.class_of(action));
            Noise::new(&step.correction.innovation)
        };
        Self {
            agent,
            observer,
            covariances: (0..levels.len())
                .map(|level| levels.covariance(level).clone())
                .collect(),
            alive: model.episode.alive.clone(),
            carried: (h * &model.motion.a).transpose().as_slice().to_vec(),
            pushed: actions
                .clone()
                .map(|action| (h * model.displacement(action, 0)).as_slice().to_vec())
                .collect(),
            innovations: (0..levels.len())
                .map(|level| {
                    actions
                        .clone()
                        .map(|action| innovation(level, action))
                        .collect()
                })
                .collect(),
        }
    }

    /// Draws the limits in to `factor` times their distance from the origin. Where failures are too rare to be seen in a sample,
    /// closer limits tell policies apart.
    pub fn with_limits(mut self, factor: f64) -> Self {
        for (_, side) in &mut self.alive.sides {
            *side = Interval::new(side.low * factor, side.high * factor);
        }
        self
    }

    /// Draws the limits in until the policy fails in at least `least` of all steps, or they are a tenth of what they were.
    pub(crate) fn with_failures(mut self, policy: &dyn Policy, sample: Sample, least: f64) -> Self {
        const FACTOR: f64 = 0.95;
        const TIMES: usize = 45;
        for _ in 0..TIMES {
            if self.failure(policy, sample) >= least {
                break;
            }
            self = self.with_limits(FACTOR);
        }
        self
    }

    /// Probability of failing in a step, averaged over the sample; who fails begins anew. The same for any number of threads.
    pub fn failure(&self, policy: &dyn Policy, sample: Sample) -> f64 {
        let sums = parallel::map(sample.runs, |run| {
            let mut sum = 0.0;
            self.run(policy, sample, run, &mut |_, failure, fate| {
                sum += failure;
                uniform(fate) < failure
            });
            sum
        });
        sums.iter().sum::<f64>() / (sample.runs * sample.steps) as f64
    }

    /// Probability of failing within a run. The same for any number of threads.
    pub(crate) fn failing(&self, policy: &dyn Policy, sample: Sample) -> f64 {
        let failed = parallel::map(sample.runs, |run| {
            let mut alive = 1.0;
            self.run(policy, sample, run, &mut |_, failure, _| {
                alive *= 1.0 - failure;
                false
            });
            1.0 - alive
        });
        failed.iter().sum::<f64>() / sample.runs as f64
    }

    /// Standard deviation of the mean of the belief about where it began, by variable.
    pub(crate) fn deviation(&self, policy: &dyn Policy, sample: Sample) -> Vec<f64> {
        let start = self.agent.initial().mean;
        let sums = parallel::map(sample.runs, |run| {
            let mut sum = vec![0.0; start.len()];
            self.run(policy, sample, run, &mut |mean, failure, fate| {
                for ((sum, value), start) in sum.iter_mut().zip(mean).zip(&start) {
                    *sum += (value - start) * (value - start);
                }
                uniform(fate) < failure
            });
            sum
        });
        let total = (sample.runs * sample.steps) as f64;
        (0..start.len())
            .map(|i| (sums.iter().map(|sum| sum[i]).sum::<f64>() / total).sqrt())
            .collect()
    }

    /// One run. After every step `visit` is told the mean and the probability of failing in it, and says whether to begin anew.
    fn run(
        &self,
        policy: &dyn Policy,
        sample: Sample,
        run: usize,
        visit: &mut impl FnMut(&[f64], f64, &mut Rng) -> bool,
    ) {
        let mut sensor = stream(sample.seed, run as u64, Role::Sensor);
        let mut fate = stream(sample.seed, run as u64, Role::World);
        let mut told = self.observer.as_ref().map(|observer| {
            let draws = Streams::new(sample.seed, run as u64);
            Told::new(observer, draws)
        });
        let mut held = self.agent.initial();
        let mut observation = vec![0.0; self.pushed.first().map_or(0, Vec::len)];
        let mut scratch = vec![0.0; self.agent.states()];
        for _ in 0..sample.steps {
            let action = policy.action(&held);
            let knows = told.as_ref().map_or(&held, |told| &told.belief);
            self.sense(knows, action, &mut observation, &mut sensor);
            self.agent
                .update(&mut held, action, &observation, &mut scratch);
            if let Some(told) = &mut told {
                let filter = &told.observer.filter;
                filter.update(&mut told.belief, action, &observation, &mut scratch);
            }
            let knows = told.as_ref().map_or(&held, |told| &told.belief);
            let failure =
                exit_probability(&knows.mean, &self.covariances[knows.stratum], &self.alive);
            if visit(&knows.mean, failure, &mut fate) {
                self.agent.reset(&mut held);
                if let Some(told) = &mut told {
                    told.begin();
                }
            }
        }
    }

    /// Draws what is sensed after an action from what the belief expects.
    fn sense(&self, from: &Belief, action: usize, observation: &mut [f64], rng: &mut Rng) {
        let n = from.mean.len();
        for ((reading, row), pushed) in observation
            .iter_mut()
            .zip(self.carried.chunks_exact(n))
            .zip(&self.pushed[action])
        {
            *reading = pushed + row.iter().zip(&from.mean).map(|(a, m)| a * m).sum::<f64>();
        }
        self.innovations[from.stratum][action].add_to(observation, rng);
    }
}

/// An observer during a run.
struct Told<'a> {
    observer: &'a Observer,
    belief: Belief,
    world: ProblemWorld,
    draws: Streams,
}

impl<'a> Told<'a> {
    fn new(observer: &'a Observer, draws: Streams) -> Self {
        let mut told = Self {
            belief: observer.filter.initial(),
            world: ProblemWorld::new(&observer.scenario),
            observer,
            draws,
        };
        told.begin();
        told
    }

    fn begin(&mut self) {
        self.observer.filter.reset(&mut self.belief);
        self.world.reset(&mut self.draws);
        self.belief.mean.copy_from_slice(self.world.state());
    }
}
