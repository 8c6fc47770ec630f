//! How likely a policy is to fail, without waiting for it to fail.
//!
//! Beliefs are simulated, not states: at every step the belief itself says how likely the true state is outside the limits. The
//! average of that over a run is the probability of failing in a step, found with far fewer steps than counting failures takes
//! (Rao-Blackwell). A run starts afresh with just that probability.

use nalgebra::DMatrix;

use crate::belief::gaussian::exit_probability;
use crate::belief::{Belief, BeliefMdp, Filter, LevelId};
use crate::model::{Interval, Region};
use crate::parallel;
use crate::policy::Policy;
use crate::random::{Rng, Role, stream, uniform};
use crate::world::Noise;

/// Runs of beliefs from one start.
#[derive(Debug)]
pub struct Runs {
    filter: Filter,
    covariances: Vec<DMatrix<f64>>,
    alive: Region,
    /// `H A` row by row, `H B u` by action, innovation by level and action.
    carried: Vec<f64>,
    pushed: Vec<Vec<f64>>,
    innovations: Vec<Vec<Noise>>,
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
    /// Runs that begin and stay at a level that repeats itself, from the origin.
    pub fn steady(mdp: &BeliefMdp, level: LevelId) -> Self {
        let start = Belief {
            level,
            mode: 0,
            mean: vec![0.0; mdp.model().state_dim()],
        };
        let filter = Filter::new(mdp.model(), mdp.levels(), &start);
        Self::new(mdp, filter)
    }

    /// Runs that begin as an episode does.
    pub fn from_start(mdp: &BeliefMdp) -> Self {
        Self::new(mdp, mdp.filter())
    }

    fn new(mdp: &BeliefMdp, filter: Filter) -> Self {
        let (model, levels) = (mdp.model(), mdp.levels());
        let actions = 0..model.actions.len();
        let h = &model.sensor.h;
        let innovation = |level, action| {
            let step = levels.step(level, levels.class_of(action));
            Noise::new(&step.correction.innovation)
        };
        Self {
            filter,
            covariances: (0..levels.len())
                .map(|level| levels.covariance(level).clone())
                .collect(),
            alive: model.episode.alive.clone(),
            carried: (h * &model.motion.a).transpose().as_slice().to_vec(),
            pushed: actions
                .clone()
                .map(|action| (h * model.displacement(action)).as_slice().to_vec())
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
    pub fn with_failures(mut self, policy: &dyn Policy, sample: Sample, least: f64) -> Self {
        const FACTOR: f64 = 0.95;
        const TIMES: usize = 45;
        for _ in 0..TIMES {
            if self.hazard(policy, sample) >= least {
                break;
            }
            self = self.with_limits(FACTOR);
        }
        self
    }

    /// Probability of failing in a step, averaged over the sample. The same for any number of threads.
    pub fn hazard(&self, policy: &dyn Policy, sample: Sample) -> f64 {
        let sums = parallel::map(sample.runs, |run| {
            let mut sum = 0.0;
            self.run(policy, sample, run, &mut |_, hazard| sum += hazard);
            sum
        });
        sums.iter().sum::<f64>() / (sample.runs * sample.steps) as f64
    }

    /// Standard deviation of the mean of the belief about 0, by variable.
    pub fn spread(&self, policy: &dyn Policy, sample: Sample) -> Vec<f64> {
        let n = self.filter.states();
        let sums = parallel::map(sample.runs, |run| {
            let mut sum = vec![0.0; n];
            self.run(policy, sample, run, &mut |mean, _| {
                for (sum, value) in sum.iter_mut().zip(mean) {
                    *sum += value * value;
                }
            });
            sum
        });
        let total = (sample.runs * sample.steps) as f64;
        (0..n)
            .map(|i| (sums.iter().map(|sum| sum[i]).sum::<f64>() / total).sqrt())
            .collect()
    }

    fn run(
        &self,
        policy: &dyn Policy,
        sample: Sample,
        run: usize,
        visit: &mut impl FnMut(&[f64], f64),
    ) {
        let mut sensor = stream(sample.seed, run as u64, Role::Sensor);
        let mut fate = stream(sample.seed, run as u64, Role::World);
        let mut belief = self.filter.initial();
        let mut observation = vec![0.0; self.pushed.first().map_or(0, Vec::len)];
        let mut scratch = vec![0.0; self.filter.states()];
        for _ in 0..sample.steps {
            let action = policy.action(&belief);
            self.sense(&belief, action, &mut observation, &mut sensor);
            self.filter
                .update(&mut belief, action, &observation, &mut scratch);
            let hazard =
                exit_probability(&belief.mean, &self.covariances[belief.level], &self.alive);
            visit(&belief.mean, hazard);
            if uniform(&mut fate) < hazard {
                self.filter.reset(&mut belief);
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
        self.innovations[from.level][action].add_to(observation, rng);
    }
}
