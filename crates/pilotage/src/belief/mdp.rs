//! The belief decision process: the planner's view of a model.
//!
//! Its state is a belief `(mode, level, mean)`. An action moves the mean to `A m + B u + K nu` with innovation
//! `nu ~ N(0, S)` and the level along the level graph; it earns the expected reward of Eq. 5.2.

use nalgebra::{DMatrix, DVector};

use super::filter::{Belief, Filter};
use super::gaussian::region_probability;
use super::levels::{LevelGraph, LevelId};
use crate::model::{
    ActionId, Barriers, Event, HypothesisBelief, Interval, Map, ModeId, Model, Region, Reward,
    Then, WallBelief, When,
};

/// A model together with its uncertainty levels and the way a belief is read.
#[derive(Debug, Clone)]
pub struct BeliefMdp {
    model: Model,
    levels: LevelGraph,
    starts: Vec<(f64, Belief)>,
    walls: Option<Barriers>,
    reading: Reading,
    /// Rewards and events as the belief reads them: their regions pushed beyond the walls it knows of, without those in places
    /// where no state can be.
    rewards: Vec<Reward>,
    events: Vec<Event>,
    /// The start hypotheses, where they are points that do not move.
    points: Option<Points>,
}

/// What a filter's `(level, mean)` says about the true state.
#[derive(Debug, Clone)]
enum Reading {
    /// The state is N(mean, P).
    Gaussian,
    /// As `Gaussian`, with everything beyond the bounds sitting at the bounds.
    Clipped,
    /// The state is one of a few points that do not move, and the filter only keeps score of them.
    Points,
}

/// Hypotheses that are points. The Gaussian filter is a sufficient statistic of their weights:
/// `log w_i = log w_i(0) + x_i' y - x_i' Y x_i / 2`, with the information gained `y = P^-1 m - P_0^-1 m_0`, `Y = P^-1 - P_0^-1`.
/// For the tiger at -1 or +1 the log-odds are `2 m / P`.
#[derive(Debug, Clone)]
struct Points {
    positions: Vec<DVector<f64>>,
    log_priors: Vec<f64>,
    /// Per level `P^-1`, and `P_0^-1 m_0`, `P_0^-1`.
    information: Vec<DMatrix<f64>>,
    prior_vector: DVector<f64>,
    prior_information: DMatrix<f64>,
}

/// One thing that can happen to mode and episode when an action is taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome {
    /// Its probability; those of one action sum to 1.
    pub probability: f64,
    /// Mode afterwards.
    pub mode: ModeId,
    /// What it does to the episode.
    pub then: Then,
}

impl BeliefMdp {
    /// The decision process of a model. Several start hypotheses are taken as one Gaussian with their mean and covariance, unless
    /// each is tracked on its own.
    pub fn new(model: &Model) -> Self {
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
        let levels = LevelGraph::new(model, &covariances);
        let starts = gaussians
            .iter()
            .zip(levels.starts())
            .map(|(&(weight, mode, mean, _), &level)| {
                let mean = mean.as_slice().to_vec();
                (weight, Belief { level, mode, mean })
            })
            .collect();
        let points = are_points(model).then(|| Points::new(model, &levels, &mean));
        let reading = match (model.belief.hypotheses, model.belief.walls) {
            (HypothesisBelief::Collapse, _) if points.is_some() => Reading::Points,
            (_, WallBelief::Clip) => Reading::Clipped,
            _ => Reading::Gaussian,
        };
        let read = |region: &Region| match reading {
            Reading::Clipped => beyond_walls(model, region),
            _ => Some(region.clone()),
        };
        let rewards = model.rewards.iter().filter_map(|reward| {
            let region = read(&reward.region)?;
            Some(Reward {
                region,
                ..reward.clone()
            })
        });
        let events = model.events.iter().filter_map(|event| {
            let region = read(&event.region)?;
            Some(Event {
                region,
                ..event.clone()
            })
        });
        Self {
            rewards: rewards.collect(),
            events: events.collect(),
            model: model.clone(),
            levels,
            starts,
            walls: (model.belief.walls == WallBelief::Clip).then(|| Barriers::new(model)),
            reading,
            points,
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
        matches!(self.reading, Reading::Gaussian)
    }

    /// Weight and position of each start hypothesis at a belief, where they are points that do not move.
    pub fn hypotheses(&self, level: LevelId, mean: &[f64]) -> Option<Vec<(f64, &DVector<f64>)>> {
        self.points.as_ref().map(|points| {
            points
                .weights(level, mean)
                .into_iter()
                .zip(&points.positions)
                .collect()
        })
    }

    /// The hypotheses, where a belief is read as them.
    fn read_as_points(&self) -> Option<&Points> {
        self.points
            .as_ref()
            .filter(|_| matches!(self.reading, Reading::Points))
    }

    /// Probability that the true state lies in the region (Eq. 5.2, exact).
    pub fn probability(&self, level: LevelId, mean: &[f64], region: &Region) -> f64 {
        match self.reading {
            Reading::Clipped => beyond_walls(&self.model, region)
                .map_or(0.0, |region| self.mass(level, mean, &region)),
            _ => self.mass(level, mean, region),
        }
    }

    /// As [`BeliefMdp::probability`], for a region as the belief reads it.
    fn mass(&self, level: LevelId, mean: &[f64], region: &Region) -> f64 {
        if let Some(points) = self.read_as_points() {
            let weights = points.weights(level, mean);
            return weights
                .iter()
                .zip(&points.positions)
                .filter(|(_, x)| region.contains(x.as_slice()))
                .map(|(w, _)| w)
                .sum();
        }
        region_probability(mean, self.levels.covariance(level), region)
    }

    /// Probability that the true state lies in the region when the step asks for it. After the move it lies where the filter
    /// predicts it, N(A m + B u, P-).
    fn chance(
        &self,
        level: LevelId,
        mean: &[f64],
        action: ActionId,
        region: &Region,
        when: When,
    ) -> f64 {
        if when == When::After && self.model.actions[action].then != Then::Continue {
            return 0.0;
        }
        if when == When::Before || self.read_as_points().is_some() {
            return self.mass(level, mean, region);
        }
        let predicted = self.predicted(mean, action);
        let class = self.levels.class_of(action);
        let covariance = &self.levels.step(level, class).correction.predicted;
        region_probability(predicted.as_slice(), covariance, region)
    }

    /// `A m + B u`, on this side of every wall the belief knows of.
    fn predicted(&self, mean: &[f64], action: ActionId) -> DVector<f64> {
        let moved = &self.model.motion.a * DVector::from_column_slice(mean)
            + self.model.displacement(action);
        self.stop(mean, moved)
    }

    /// Probability that the true state has left what [`crate::model::Episode::alive`] allows.
    pub fn failure(&self, level: LevelId, mean: &[f64]) -> f64 {
        let alive = &self.model.episode.alive;
        if alive.sides.is_empty() {
            return 0.0;
        }
        (1.0 - self.probability(level, mean, alive)).max(0.0)
    }

    /// Expected immediate reward `r(b, a)`, events included; that of failing is not, see [`BeliefMdp::failure`].
    pub fn reward(&self, mode: ModeId, level: LevelId, mean: &[f64], action: ActionId) -> f64 {
        let rewards = self
            .rewards
            .iter()
            .filter(|reward| reward.applies(mode, action));
        let paid: f64 = rewards
            .map(|reward| {
                reward.value * self.chance(level, mean, action, &reward.region, reward.when)
            })
            .sum();
        let events = self
            .events
            .iter()
            .filter(|event| event.applies(mode, action));
        paid + events
            .map(|event| event.reward * self.chance(level, mean, action, &event.region, event.when))
            .sum::<f64>()
    }

    /// What the action can do to mode and episode. Events whose regions overlap share probability in file order.
    pub fn outcomes(
        &self,
        mode: ModeId,
        level: LevelId,
        mean: &[f64],
        action: ActionId,
    ) -> Vec<Outcome> {
        let ends = self.model.actions[action].then;
        let mut left = 1.0;
        let mut outcomes = Vec::new();
        let of = |when| {
            let events = self.events.iter();
            events.filter(move |event| event.when == when && event.applies(mode, action))
        };
        for event in of(When::Before).chain(of(When::After)) {
            let probability = self
                .chance(level, mean, action, &event.region, event.when)
                .min(left);
            left -= probability;
            let then = if ends == Then::Continue {
                event.then
            } else {
                ends
            };
            outcomes.push(Outcome {
                probability,
                mode: event.becomes.unwrap_or(mode),
                then,
            });
        }
        outcomes.push(Outcome {
            probability: left,
            mode,
            then: ends,
        });
        outcomes.retain(|outcome| outcome.probability > 0.0);
        outcomes
    }

    /// Where the next mean is centred, with which weight: the predicted mean `A m + B u`, moved by what each component makes
    /// the agent observe. The innovation's own noise has covariance [`BeliefMdp::spread`] around it.
    pub fn centres(
        &self,
        level: LevelId,
        mean: &[f64],
        action: ActionId,
    ) -> Vec<(f64, DVector<f64>)> {
        let predicted = self.predicted(mean, action);
        let Some(points) = self.read_as_points() else {
            return vec![(1.0, predicted)];
        };
        let gain = &self
            .levels
            .step(level, self.levels.class_of(action))
            .correction
            .gain;
        let moved = points
            .positions
            .iter()
            .map(|x| &predicted + gain * &self.model.sensor.h * (x - &predicted));
        points.weights(level, mean).into_iter().zip(moved).collect()
    }

    /// Covariance of the next mean around its centre after an action of this class: `K S K'` (Eq. 5.6, corrected), or
    /// `K R K'` where the component fixes the state.
    pub fn spread(&self, level: LevelId, class: usize) -> DMatrix<f64> {
        let correction = &self.levels.step(level, class).correction;
        if self.read_as_points().is_some() {
            return &correction.gain
                * &self.levels.classes()[class].sensor_noise
                * correction.gain.transpose();
        }
        correction.spread()
    }

    /// Bounds on the reward of one step, over all beliefs and actions, that of failing included: smallest, largest.
    pub fn reward_range(&self) -> (f64, f64) {
        let failing = std::iter::once(self.model.episode.failure_reward);
        let events = self
            .model
            .events
            .iter()
            .map(|event| event.reward)
            .chain(failing);
        let values = || {
            self.model
                .rewards
                .iter()
                .map(|reward| reward.value)
                .chain(events.clone())
        };
        (
            values().map(|value| value.min(0.0)).sum(),
            values().map(|value| value.max(0.0)).sum(),
        )
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

/// The region with sides that touch the bounds pushed outwards for ever: what a Gaussian has beyond a bound sits at the bound.
/// `None` where no state can be in the region.
fn beyond_walls(model: &Model, region: &Region) -> Option<Region> {
    let blocked = |map: &Map| map.blocked.contains(region);
    if model.map.as_ref().is_some_and(blocked) {
        return None;
    }
    let pushed = |&(variable, side): &(usize, Interval)| {
        let bounds = model.state[variable].bounds;
        let low = match side.low <= bounds.low {
            true => f64::NEG_INFINITY,
            false => side.low,
        };
        let high = match side.high >= bounds.high {
            true => f64::INFINITY,
            false => side.high,
        };
        let inside = side.low < bounds.high && side.high > bounds.low;
        inside.then(|| (variable, Interval::new(low, high)))
    };
    let sides: Option<_> = region.sides.iter().map(pushed).collect();
    Some(Region::new(sides?))
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

/// Whether the hypotheses are several points that no action moves.
fn are_points(model: &Model) -> bool {
    let n = model.state_dim();
    model.start.len() > 1
        && model
            .start
            .iter()
            .all(|start| start.covariance.amax() == 0.0)
        && model.motion.a == DMatrix::identity(n, n)
        && (0..model.actions.len()).all(|action| {
            model.motion_noise(action).amax() == 0.0 && model.displacement(action).amax() == 0.0
        })
}

impl Points {
    fn new(model: &Model, levels: &LevelGraph, mean: &DVector<f64>) -> Self {
        let inverse = |matrix: &DMatrix<f64>| {
            // No decomposition of a matrix that is not finite comes to an end.
            if matrix.iter().any(|entry| !entry.is_finite()) {
                return matrix.clone();
            }
            matrix
                .clone()
                .pseudo_inverse(1e-12 * matrix.amax().max(1e-300))
                .unwrap_or_else(|_| matrix.clone() * 0.0)
        };
        let prior_information = inverse(levels.covariance(levels.starts()[0]));
        Self {
            positions: model.start.iter().map(|start| start.mean.clone()).collect(),
            log_priors: model.start.iter().map(|start| start.weight.ln()).collect(),
            information: (0..levels.len())
                .map(|level| inverse(levels.covariance(level)))
                .collect(),
            prior_vector: &prior_information * mean,
            prior_information,
        }
    }

    fn weights(&self, level: LevelId, mean: &[f64]) -> Vec<f64> {
        let vector =
            &self.information[level] * DVector::from_column_slice(mean) - &self.prior_vector;
        let matrix = &self.information[level] - &self.prior_information;
        let scores: Vec<f64> = self
            .positions
            .iter()
            .zip(&self.log_priors)
            .map(|(x, log_prior)| log_prior + x.dot(&vector) - 0.5 * x.dot(&(&matrix * x)))
            .collect();
        let best = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let total: f64 = scores.iter().map(|score| (score - best).exp()).sum();
        scores
            .iter()
            .map(|score| (score - best).exp() / total)
            .collect()
    }
}
