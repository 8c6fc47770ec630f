//! The belief decision process: the planner's view of a model.
//!
//! Its state is a belief `(mode, level, mean)`. An action moves the mean to `A m + B u + K nu` with innovation
//! `nu ~ N(0, S)` and the level along the level graph; it earns the expected reward of Eq. 5.2. What a step does is said by the
//! model's effects, whose regions the belief integrates over.

use nalgebra::{DMatrix, DVector};

use super::filter::{Belief, Filter};
use super::gaussian::{interval_probability, region_probability};
use super::levels::{ClassId, LevelGraph, StratumId};
use super::mixture::Mixture;
use crate::error::Result;
use crate::model::{
    ActionId, Barriers, Effect, EffectTable, HypothesisBelief, Interval, ModeId, Model, Outcome,
    Region, Then, WallBelief, When, apart,
};

/// A model together with its uncertainty levels and the way a belief is read.
#[derive(Debug, Clone)]
pub struct BeliefMdp {
    model: Model,
    levels: LevelGraph,
    starts: Vec<(f64, Belief)>,
    walls: Option<Barriers>,
    reading: Reading,
    /// What a step can do. Regions are as the belief reads them: pushed
    /// beyond the walls it knows of, without those in places where no state can be, and events apart.
    effects: EffectTable,
    /// The start hypotheses, where one filter keeps them all.
    mixture: Option<Mixture>,
}

/// What a filter's `(level, mean)` says about the true state.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Reading {
    /// The state is N(mean, P).
    Gaussian,
    /// As `Gaussian`, with everything beyond the bounds sitting at the bounds.
    Clipped,
    /// The state is distributed as a mixture of the start hypotheses.
    Mixture,
}

impl BeliefMdp {
    /// The decision process of a model. Several start hypotheses are taken as one Gaussian with their mean and covariance, unless
    /// each is tracked on its own.
    pub fn new(model: &Model) -> Self {
        Self::within(model, None)
    }

    /// The same for episodes that are over after so many steps: levels are then told apart by the step at which they are held, and
    /// the last ones are over.
    pub fn with_horizon(model: &Model, steps: usize) -> Self {
        Self::within(model, Some(steps))
    }

    fn within(model: &Model, horizon: Option<usize>) -> Self {
        let tracked = model.belief.hypotheses == HypothesisBelief::Track;
        let (mean, covariance) = moments(model);
        let gaussians: Vec<_> = match tracked {
            true => model
                .start
                .iter()
                .map(|start| (start.weight, start.mode, &start.mean, &start.covariance))
                .collect(),
            false => vec![(1.0, model.start[0].mode, &mean, &covariance)],
        };
        let covariances: Vec<_> = gaussians.iter().map(|start| start.3.clone()).collect();
        let levels = LevelGraph::within(model, &covariances, horizon);
        let starts = gaussians
            .iter()
            .zip(levels.starts())
            .map(|(&(weight, mode, mean, _), &level)| {
                let mean = mean.as_slice().to_vec();
                (
                    weight,
                    Belief {
                        stratum: level,
                        mode,
                        mean,
                    },
                )
            })
            .collect();
        let mixture = Mixture::of(model, &levels, &mean);
        let reading = match (model.belief.hypotheses, model.belief.walls) {
            (HypothesisBelief::Collapse, _) if mixture.is_some() => Reading::Mixture,
            (_, WallBelief::Clip) => Reading::Clipped,
            _ => Reading::Gaussian,
        };
        let walls = (model.belief.walls == WallBelief::Clip).then(|| Barriers::new(model));
        let read = |effect: Effect| match (&walls, reading) {
            (Some(walls), Reading::Clipped) => walls.felt(effect),
            _ => Some(effect),
        };
        Self {
            effects: EffectTable::new(model, |effects| {
                apart(effects.into_iter().filter_map(read).collect())
            }),
            model: model.clone(),
            levels,
            starts,
            walls,
            reading,
            mixture,
        }
    }

    /// The model.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// The uncertainty levels.
    pub fn levels(&self) -> &LevelGraph {
        &self.levels
    }

    /// Number of strata, at least 1.
    pub fn strata(&self) -> usize {
        self.levels.len()
    }

    /// Covariance of the beliefs of a stratum, `n x n`.
    pub fn covariance(&self, stratum: StratumId) -> &DMatrix<f64> {
        self.levels.covariance(stratum)
    }

    /// Whether an episode is over at a stratum.
    pub fn is_over(&self, stratum: StratumId) -> bool {
        self.levels.is_over(stratum)
    }

    /// Number of noise classes: actions of one lead from every stratum to the same one, with means that spread alike.
    pub fn classes(&self) -> usize {
        self.levels.classes().len()
    }

    /// Noise class of an action.
    pub fn class_of(&self, action: ActionId) -> ClassId {
        self.levels.class_of(action)
    }

    /// The stratum after a step of a class.
    pub fn next(&self, stratum: StratumId, class: ClassId) -> StratumId {
        self.levels.step(stratum, class).next
    }

    /// The stratum after a step of a class whose reading is missing.
    pub fn next_blind(&self, stratum: StratumId, class: ClassId) -> StratumId {
        self.levels.step(stratum, class).blind
    }

    /// Probability that there is a reading after a step from a stratum.
    pub fn present(&self, stratum: StratumId) -> f64 {
        self.model.sensor_at(self.levels.time(stratum)).present
    }

    /// Checks that every belief is one, see [`LevelGraph::check`].
    ///
    /// # Errors
    /// As there.
    pub fn check(&self) -> Result<()> {
        self.levels.check(&self.model)
    }

    /// Checks that no uncertainty grows for ever. Levels that were cut at the limit while they still shrank will do.
    ///
    /// # Errors
    /// [`crate::Error::NoSteadyState`], with the direction that grows.
    pub fn check_bounded(&self) -> Result<()> {
        self.levels.check_bounded(&self.model)
    }

    /// The belief at the start; the first one where hypotheses are tracked.
    pub fn start(&self) -> &Belief {
        &self.starts[0].1
    }

    /// Weight and belief of each start hypothesis where they are tracked; otherwise the one start belief.
    pub fn starts(&self) -> &[(f64, Belief)] {
        &self.starts
    }

    /// The filter that keeps such beliefs, from [`BeliefMdp::start`] on.
    pub fn filter(&self) -> Filter {
        self.filter_from(self.start())
    }

    /// The filter that keeps such beliefs, from the given one on.
    pub fn filter_from(&self, start: &Belief) -> Filter {
        Filter::new(&self.model, &self.levels, start)
    }

    /// Whether a belief is read as the one Gaussian N(mean, P).
    pub fn is_gaussian(&self) -> bool {
        self.reading == Reading::Gaussian
    }

    /// Whether one filter keeps a belief exactly: nothing the model says about state and mode is lost in `(mode, level, mean)`.
    pub fn is_exact(&self) -> bool {
        self.reading != Reading::Clipped
            && self.model.modes.len() == 1
            && (self.model.start.len() == 1 || self.reading == Reading::Mixture)
            && self.model.episode.alive.sides.is_empty()
            && self.levels.converged()
    }

    /// Weight and mean of each start hypothesis at a belief, where one filter keeps them all.
    pub fn hypotheses(&self, level: StratumId, mean: &[f64]) -> Option<Vec<(f64, DVector<f64>)>> {
        let mixture = self.mixture.as_ref()?;
        Some(mixture.hypotheses(level, mean))
    }

    /// The hypotheses, where a belief is read as them.
    fn read_as_mixture(&self) -> Option<&Mixture> {
        let mixture = self.mixture.as_ref();
        mixture.filter(|_| self.reading == Reading::Mixture)
    }

    /// What an action can do in a mode at a level, with regions as the belief reads them.
    pub fn effects(&self, mode: ModeId, level: StratumId, action: ActionId) -> &[Effect] {
        self.effects.at(self.levels.time(level), mode, action)
    }

    /// Probability that the true state lies in the region (Eq. 5.2, exact).
    pub fn probability(&self, level: StratumId, mean: &[f64], region: &Region) -> f64 {
        match (&self.walls, self.reading) {
            (Some(walls), Reading::Clipped) => walls
                .reached(region)
                .map_or(0.0, |region| self.mass(level, mean, &region)),
            _ => self.mass(level, mean, region),
        }
    }

    /// As [`BeliefMdp::probability`], for a region as the belief reads it.
    fn mass(&self, level: StratumId, mean: &[f64], region: &Region) -> f64 {
        self.averaged(level, mean, |mean, covariance| {
            region_probability(mean, covariance, region)
        })
    }

    /// Probability that the true state lies in the region when the step asks for it. After the move it lies where the filter
    /// predicts it, N(A m + B u, P-).
    fn holds(
        &self,
        level: StratumId,
        mean: &[f64],
        action: ActionId,
        region: &Region,
        when: When,
    ) -> f64 {
        if when == When::After && self.model.actions[action].then != Then::Continue {
            return 0.0;
        }
        if when == When::Before || self.read_as_mixture().is_some() {
            return self.mass(level, mean, region);
        }
        let predicted = self.predicted(level, mean, action);
        let class = self.levels.class_of(action);
        let covariance = &self.levels.step(level, class).correction.predicted;
        region_probability(predicted.as_slice(), covariance, region)
    }

    /// Where an action leads from a state or mean, noise apart: `A m + B u`, on this side of every wall the belief knows of.
    pub fn predicted(&self, stratum: StratumId, mean: &[f64], action: ActionId) -> DVector<f64> {
        let time = self.levels.time(stratum);
        let moved = &self.model.motion_at(time).a * DVector::from_column_slice(mean)
            + self.model.displacement(action, time);
        self.stop(mean, moved)
    }

    /// Probability that the true state is within what [`crate::model::Episode::alive`] allows.
    pub fn alive(&self, level: StratumId, mean: &[f64]) -> f64 {
        let alive = &self.model.episode.alive;
        if alive.sides.is_empty() {
            return 1.0;
        }
        self.probability(level, mean, alive)
    }

    /// How an agent that has not failed gets through the step that an action takes: now the state is within all limits, and the filter
    /// does not know it.
    ///
    /// Counting the probability of being outside afresh at every step would count the same error of the estimate over and over.
    pub fn survival(&self, level: StratumId, mean: &[f64], action: ActionId) -> Survival {
        let alive = &self.model.episode.alive;
        if alive.sides.is_empty() || self.model.actions[action].then != Then::Continue {
            return Survival::SURE;
        }
        let a = &self.model.motion_at(self.levels.time(level)).a;
        let covariance = self.levels.covariance(level);
        let step = self.levels.step(level, self.levels.class_of(action));
        let predicted = self.predicted(level, mean, action);
        let carried = a * covariance;
        let sides = alive.sides.iter().map(|&(i, side)| {
            let later = (predicted[i], step.correction.predicted[(i, i)]);
            survival((mean[i], covariance[(i, i)]), later, carried[(i, i)], side)
        });
        sides.fold(Survival::SURE, |all, one| Survival {
            probability: all.probability * one.probability,
            odds: all.odds * one.odds,
        })
    }

    /// Expected immediate reward `r(b, a)`, events included, and what the action can do to mode and episode. The reward of failing is
    /// not counted, see [`BeliefMdp::survival`].
    pub fn step(
        &self,
        mode: ModeId,
        level: StratumId,
        mean: &[f64],
        action: ActionId,
    ) -> (f64, Vec<Outcome>) {
        let mut tally = self.model.tally(mode, action);
        let mut outcomes: Vec<Outcome> = Vec::new();
        let mut add = |outcome: Outcome| {
            let same =
                |known: &&mut Outcome| (known.mode, known.then) == (outcome.mode, outcome.then);
            match outcomes.iter_mut().find(same) {
                Some(known) => known.probability += outcome.probability,
                None if outcome.probability > 0.0 => outcomes.push(outcome),
                None => {}
            }
        };
        for effect in self.effects(mode, level, action) {
            let holds = self.holds(level, mean, action, &effect.region, effect.when);
            if let Some(outcome) = tally.take(effect, holds) {
                add(outcome);
            }
        }
        add(tally.rest());
        (
            tally.reward + self.running_cost(level, mean, action),
            outcomes,
        )
    }

    /// Expected cost of a step, as a negative reward.
    fn running_cost(&self, level: StratumId, mean: &[f64], action: ActionId) -> f64 {
        self.averaged(level, mean, |mean, covariance| {
            self.model.running_cost(mean, Some(covariance), action)
        })
    }

    /// Expected cost of ending an episode, as a negative reward.
    pub fn terminal_cost(&self, level: StratumId, mean: &[f64]) -> f64 {
        self.averaged(level, mean, |mean, covariance| {
            self.model.terminal_cost(mean, Some(covariance))
        })
    }

    /// Average of something that is known of a Gaussian.
    fn averaged(
        &self,
        level: StratumId,
        mean: &[f64],
        of: impl Fn(&[f64], &DMatrix<f64>) -> f64,
    ) -> f64 {
        match self.read_as_mixture() {
            None => of(mean, self.levels.covariance(level)),
            Some(mixture) => {
                let covariance = mixture.covariance(level);
                let hypotheses = mixture.hypotheses(level, mean);
                hypotheses
                    .iter()
                    .map(|(weight, x)| weight * of(x.as_slice(), covariance))
                    .sum()
            }
        }
    }

    /// Expected immediate reward `r(b, a)`, see [`BeliefMdp::step`].
    pub fn reward(&self, mode: ModeId, level: StratumId, mean: &[f64], action: ActionId) -> f64 {
        self.step(mode, level, mean, action).0
    }

    /// What the action can do to mode and episode, see [`BeliefMdp::step`].
    pub fn outcomes(
        &self,
        mode: ModeId,
        level: StratumId,
        mean: &[f64],
        action: ActionId,
    ) -> Vec<Outcome> {
        self.step(mode, level, mean, action).1
    }

    /// Where the next mean is centred, with which weight: the predicted mean `A m + B u`, moved by what each hypothesis makes the
    /// agent observe. The innovation's own noise has covariance [`BeliefMdp::mean_covariance`] around it.
    pub fn centres(
        &self,
        level: StratumId,
        mean: &[f64],
        action: ActionId,
    ) -> Vec<(f64, DVector<f64>)> {
        let predicted = self.predicted(level, mean, action);
        let Some(mixture) = self.read_as_mixture() else {
            return vec![(1.0, predicted)];
        };
        let class = self.levels.class_of(action);
        let gain = &self.levels.step(level, class).correction.gain;
        let h = &self.model.sensor_at(self.levels.time(level)).h;
        let mut centres = mixture.hypotheses(level, mean);
        for (_, x) in &mut centres {
            *x = &predicted + gain * h * (&*x - &predicted);
        }
        centres
    }

    /// Covariance of the next mean around its centre after an action of this class: `K S K'` (Eq. 5.6, corrected); for a mixture
    /// with the `S` of each of its hypotheses.
    pub fn mean_covariance(&self, level: StratumId, class: usize) -> DMatrix<f64> {
        let step = self.levels.step(level, class);
        match self.read_as_mixture() {
            None => self.levels.mean_covariance(level, class),
            Some(mixture) => {
                let time = self.levels.time(level);
                let (gain, h) = (&step.correction.gain, &self.model.sensor_at(time).h);
                let noise = self.model.sensor_noise(self.levels.classes()[class], time);
                let innovation = h * mixture.covariance(level) * h.transpose() + noise;
                gain * innovation * gain.transpose()
            }
        }
    }

    /// Bounds on the reward of one step, over all beliefs and actions, that of failing included: smallest, largest.
    pub fn reward_range(&self) -> (f64, f64) {
        self.model.reward_range()
    }

    /// A mean as the belief keeps it: where a state can be, if the belief knows of walls.
    pub fn confine(&self, mut mean: DVector<f64>) -> DVector<f64> {
        if let Some(walls) = &self.walls {
            walls.confine(mean.as_mut_slice());
        }
        mean
    }

    /// Where a mean that moves straight from one point to another is stopped, if the belief knows of walls.
    pub fn stop(&self, from: &[f64], mut to: DVector<f64>) -> DVector<f64> {
        if let Some(walls) = &self.walls {
            walls.stop(from, to.as_mut_slice());
        }
        to
    }
}

/// Mean and covariance of the mixture of all start hypotheses.
fn moments(model: &Model) -> (DVector<f64>, DMatrix<f64>) {
    let n = model.state_dim();
    let mean = model.start.iter().fold(DVector::zeros(n), |sum, start| {
        sum + &start.mean * start.weight
    });
    let covariance = model.start.iter().fold(DMatrix::zeros(n, n), |sum, start| {
        let apart = &start.mean - &mean;
        sum + (&start.covariance + &apart * apart.transpose()) * start.weight
    });
    (mean, covariance)
}

/// How someone who is alive gets through a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Survival {
    /// Probability of being within the limits afterwards.
    pub probability: f64,
    /// How much more likely that is than for the belief itself, which does not know that its agent is alive: what is known of the next
    /// belief, [`BeliefMdp::alive`], counts so many times.
    pub odds: f64,
}

impl Survival {
    /// No limits.
    const SURE: Self = Self {
        probability: 1.0,
        odds: 1.0,
    };
}

/// Survival along a variable with limits: mean and variance now and later, and the covariance of the two.
fn survival(now: (f64, f64), later: (f64, f64), shared: f64, side: Interval) -> Survival {
    // So many standard deviations inside its limits a variable leaves them less often than once in 1e11 steps.
    const NEVER: f64 = 6.7;
    // Less likely than this an agent is not there to ask.
    const HARDLY: f64 = 1e-9;
    let reach = NEVER * later.1.sqrt();
    if later.0 - side.low > reach && side.high - later.0 > reach {
        return Survival::SURE;
    }
    let inside = |(mean, variance)| interval_probability(mean, variance, side);
    let (alive, stays) = (inside(now), inside(later));
    if alive < HARDLY || stays < HARDLY {
        return Survival {
            probability: 0.0,
            odds: 0.0,
        };
    }
    let joint = DMatrix::from_row_slice(2, 2, &[now.1, shared, shared, later.1]);
    let both = region_probability(
        &[now.0, later.0],
        &joint,
        &Region::new(vec![(0, side), (1, side)]),
    );
    let probability = (both / alive).clamp(0.0, 1.0);
    Survival {
        probability,
        odds: probability / stays,
    }
}
