//! The underlying decision process: the same model for an agent that is told the true state and mode.
//!
//! ```text
//! Q(s, a) = r(s, a) + F(s, a),   F(s, a) = discount * E V(A s + B u + v),   V(s) = max_a Q(s, a)
//! ```
//!
//! It is solved by value iteration on a grid of true states; where the start hypotheses are points that do not move, they are all
//! the states there are. What leaves [`crate::model::Episode::alive`] is worth the failure's reward and nothing after it.

use nalgebra::DVector;

pub(super) use super::grid::Settings;
use super::grid::{Axis, Grid, Interpolation, Smoother};
use super::refusals;
use super::solver::refuse_if;
use crate::belief::BeliefMdp;
use crate::error::Result;
use crate::memory;
use crate::model::{ActionId, HypothesisBelief, ModeId, Model, Outcome, Then, WallBelief};
use crate::parallel;
use crate::policy::first_best;
use crate::progress::Progress;

/// Most state variables for which a grid of true states is fine enough to be of use.
pub(crate) const MOST_VARIABLES: usize = 3;

/// A solved decision process of true states.
#[derive(Debug)]
pub(super) struct StateMdp {
    belief_mdp: BeliefMdp,
    space: Space,
    /// `V`, by mode, then state.
    values: Vec<Vec<f64>>,
    /// `F`, by mode and action, then state.
    future: Vec<Vec<f64>>,
    /// Whether the tolerance was reached within the allowed sweeps.
    pub converged: bool,
}

/// The true states.
#[derive(Debug, Clone)]
pub(crate) enum Space {
    /// Points of a grid; values between them are interpolated.
    Grid(Grid),
    /// The start hypotheses, which do not move.
    Points(Vec<DVector<f64>>),
}

impl Space {
    fn len(&self) -> usize {
        match self {
            Self::Grid(grid) => grid.len(),
            Self::Points(points) => points.len(),
        }
    }

    fn state(&self, index: usize) -> Vec<f64> {
        match self {
            Self::Grid(grid) => grid.point(index),
            Self::Points(points) => points[index].as_slice().to_vec(),
        }
    }
}

/// What an action leads to from a state.
#[derive(Debug)]
enum Next {
    /// The episode goes on in a mode, around a place (on the grid).
    Continue { mode: ModeId, centre: Vec<f64> },
    /// It starts anew.
    Restart,
    /// It is over.
    End,
}

/// One action in one state.
#[derive(Debug)]
struct Entry {
    reward: f64,
    next: Next,
}

impl StateMdp {
    /// Solves the decision process of true states that underlies a belief decision process.
    ///
    /// # Errors
    /// [`crate::Error::TooLarge`] and [`crate::Error::OutOfMemory`] where the grid does not fit the memory, [`crate::Error::Setting`] for settings out of range.
    pub(super) fn solve(
        belief_mdp: &BeliefMdp,
        settings: &Settings,
        observer: &dyn Progress,
    ) -> Result<Self> {
        settings.validate()?;
        let space = space(belief_mdp, settings)?;
        let (modes, actions) = (
            belief_mdp.model().modes.len(),
            belief_mdp.model().actions.len(),
        );
        let mut mdp = Self {
            values: vec![vec![0.0; space.len()]; modes],
            future: vec![vec![0.0; space.len()]; modes * actions],
            belief_mdp: belief_mdp.clone(),
            space,
            converged: false,
        };
        let entries: Vec<Vec<Entry>> = (0..modes * actions)
            .map(|index| {
                parallel::map(mdp.space.len(), |state| {
                    mdp.entry(index / actions, &mdp.space.state(state), index % actions)
                })
            })
            .collect();
        let smoothers = mdp.smoothers();
        let discount = mdp.model().discount;
        let target = settings.tolerance * (1.0 - discount) / discount.max(1e-9);
        observer.progress("sweeps", 0, 0);
        for sweep in 0..settings.sweeps {
            let change = mdp.sweep(&entries, &smoothers);
            observer.progress("sweeps", sweep as u64 + 1, 0);
            if change <= target {
                mdp.converged = true;
                break;
            }
        }
        Ok(mdp)
    }

    fn model(&self) -> &Model {
        self.belief_mdp.model()
    }

    /// The belief decision process above it.
    pub(crate) fn belief_mdp(&self) -> &BeliefMdp {
        &self.belief_mdp
    }

    /// The true states.
    pub(crate) fn space(&self) -> &Space {
        &self.space
    }

    /// `F(., a)` in a mode, by state: what an action brings beyond its immediate reward.
    pub(crate) fn future(&self, mode: ModeId, action: ActionId) -> &[f64] {
        &self.future[mode * self.model().actions.len() + action]
    }

    /// `Q(s, a)` of every action in a true state of length `n`; where the states are points, in the nearest of them.
    pub(super) fn q_values(&self, mode: ModeId, state: &[f64]) -> Vec<f64> {
        let nearest = |points: &[DVector<f64>]| {
            let distance = |x: &DVector<f64>| (x - DVector::from_column_slice(state)).norm();
            (0..points.len()).fold(0, |best, i| {
                if distance(&points[i]) < distance(&points[best]) {
                    i
                } else {
                    best
                }
            })
        };
        let future = |action| match &self.space {
            Space::Grid(grid) => grid.interpolate(self.future(mode, action), state),
            Space::Points(points) => self.future(mode, action)[nearest(points)],
        };
        (0..self.model().actions.len())
            .map(|action| seen(self.model(), mode, state, action).0 + future(action))
            .collect()
    }

    /// The best action in a true state, ties to the first.
    pub(crate) fn action(&self, mode: ModeId, state: &[f64]) -> ActionId {
        first_best(&self.q_values(mode, state))
    }

    fn entry(&self, mode: ModeId, state: &[f64], action: ActionId) -> Entry {
        let model = self.model();
        let (reward, outcome) = seen(model, mode, state, action);
        let next = match outcome.then {
            Then::End => Next::End,
            Then::Restart => Next::Restart,
            Then::Continue => Next::Continue {
                mode: outcome.mode,
                centre: self
                    .belief_mdp
                    .predicted(0, state, action)
                    .as_slice()
                    .to_vec(),
            },
        };
        Entry { reward, next }
    }

    /// Averages over the motion noise of each class; none where the states are points.
    fn smoothers(&self) -> Vec<Option<Smoother>> {
        let classes = self.belief_mdp.levels().classes().iter();
        classes
            .map(|&example| match &self.space {
                Space::Grid(grid) => {
                    let noise = self.model().motion_noise(example, 0);
                    Some(grid.smoother(noise))
                }
                Space::Points(_) => None,
            })
            .collect()
    }

    /// One sweep of value iteration; returns the largest change of `V`.
    fn sweep(&mut self, entries: &[Vec<Entry>], smoothers: &[Option<Smoother>]) -> f64 {
        let (modes, actions) = (self.values.len(), self.model().actions.len());
        let restart = self.discounted_start();
        let worth: Vec<Vec<f64>> = (0..modes).map(|mode| self.worth(mode)).collect();
        let expected = parallel::map(modes * smoothers.len(), |index| {
            let worth = &worth[index / smoothers.len()];
            match (&self.space, &smoothers[index % smoothers.len()]) {
                (Space::Grid(grid), Some(smoother)) => smoother.apply(grid, worth),
                _ => worth.clone(),
            }
        });
        let future = parallel::map(modes * actions, |index| {
            let class = self.belief_mdp.class_of(index % actions);
            let look_up = |(state, entry): (usize, &Entry)| match &entry.next {
                Next::End => 0.0,
                Next::Restart => restart,
                Next::Continue { mode, centre } => {
                    let expected = &expected[mode * smoothers.len() + class];
                    match &self.space {
                        Space::Grid(grid) => grid.interpolate(expected, centre),
                        Space::Points(_) => expected[state],
                    }
                }
            };
            entries[index].iter().enumerate().map(look_up).collect()
        });
        self.future = future;
        let mut change = 0.0_f64;
        for mode in 0..modes {
            for (state, value) in self.values[mode].iter_mut().enumerate() {
                let fresh = (mode * actions..(mode + 1) * actions)
                    .map(|index| entries[index][state].reward + self.future[index][state])
                    .fold(f64::NEG_INFINITY, f64::max);
                change = change.max((fresh - *value).abs());
                *value = fresh;
            }
        }
        change
    }

    /// What it is worth to arrive in each state, seen from one step before.
    fn worth(&self, mode: ModeId) -> Vec<f64> {
        let (alive, failure, discount) = (
            &self.model().episode.alive,
            self.model().episode.failure_reward,
            self.model().discount,
        );
        let worth = |(state, value): (usize, &f64)| {
            if alive.sides.is_empty() || alive.contains(&self.space.state(state)) {
                discount * value
            } else {
                failure
            }
        };
        self.values[mode].iter().enumerate().map(worth).collect()
    }

    /// Discounted value of a fresh start, where something in the model leads there.
    fn discounted_start(&self) -> f64 {
        let model = self.model();
        if !model.restarts() {
            return 0.0;
        }
        let values = model.start.iter().enumerate().map(|(index, start)| {
            let values = &self.values[start.mode];
            let value = match &self.space {
                Space::Points(_) => values[index],
                Space::Grid(grid) => grid.interpolate(
                    &grid.smoother(&start.covariance).apply(grid, values),
                    start.mean.as_slice(),
                ),
            };
            start.weight * value
        });
        model.discount * values.sum::<f64>()
    }
}

/// `r(s, a)`, and what happens to mode and episode, for someone who sees the state.
fn seen(model: &Model, mode: ModeId, state: &[f64], action: ActionId) -> (f64, Outcome) {
    let mut tally = model.tally(mode, action);
    let happened = tally.see(&model.effects(mode, action, 0), state);
    let reward = tally.reward + model.running_cost(state, None, action);
    (reward, happened.unwrap_or_else(|| tally.rest()))
}

/// Whether a planner on true states is made for such a model.
///
/// # Errors
/// [`crate::Error::Unsupported`] in the planner's name, with the reason and what would do.
pub(crate) fn accepts(solver: &'static str, model: &Model) -> Result<()> {
    let (n, most) = (model.state_dim(), MOST_VARIABLES);
    let too_many = || {
        (n > most).then(|| {
            format!(
                "it has {n} state variables, and a grid of true states is fine enough for {most} at most; use policy-search or lqg"
            )
        })
    };
    let reason = refusals::reward_missing(model)
        .or_else(|| refusals::pays_afterwards(model))
        .or_else(|| refusals::changes(model))
        .or_else(|| refusals::bound_missing(model))
        .or_else(too_many);
    refuse_if(solver, model, reason)
}

fn space(belief_mdp: &BeliefMdp, settings: &Settings) -> Result<Space> {
    let model = belief_mdp.model();
    let start = belief_mdp.start();
    if model.belief.hypotheses == HypothesisBelief::Collapse
        && let Some(points) = belief_mdp.hypotheses(start.stratum, &start.mean)
    {
        let points = points.into_iter().map(|(_, point)| point.clone());
        return Ok(Space::Points(points.collect()));
    }
    let n = model.state_dim();
    let points = settings.points.unwrap_or(match n {
        1 => 1601,
        2 => 161,
        _ => 41,
    });
    // `V` and what it is smoothed to, `F` as it is and averaged over every level, and the entries.
    let tables = model.modes.len()
        * (1 + belief_mdp.classes() + model.actions.len() * (1 + belief_mdp.strata() + 6 + n));
    let total = (points as u64).saturating_pow(n as u32);
    let numbers = total.saturating_mul(tables as u64);
    let mebibytes = numbers.saturating_mul(8) >> 20;
    memory::check(&model.name, numbers, mebibytes, settings.memory)?;
    let axes = (0..n).map(|variable| {
        let bounds = model.state[variable].bounds;
        if model.belief.walls == WallBelief::Clip {
            return Axis::new(bounds.low, bounds.high, points);
        }
        let variance = belief_mdp
            .levels()
            .classes()
            .iter()
            .map(|&example| model.motion_noise(example, 0)[(variable, variable)])
            .fold(0.0, f64::max);
        Axis::around(bounds, variance.sqrt(), points)
    });
    // Rewards jump at the borders of regions; straight lines do not overshoot there.
    Ok(Space::Grid(Grid::new(
        axes.collect(),
        Interpolation::Linear,
    )))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use nalgebra::dmatrix;

    use super::{Settings, StateMdp};
    use crate::belief::BeliefMdp;
    use crate::model::{Interval, Region};
    use crate::progress::Silent;
    use crate::scenario;

    #[test]
    fn who_leaves_the_living_fails_once() {
        let mut model = scenario::find("corridor-unbounded").unwrap().model;
        model.actions.truncate(1);
        model.motion.noise = dmatrix![0.0];
        model.rewards[0].region = Region::everywhere();
        model.episode.alive = Region::new(vec![(0, Interval::new(-1.0, 2.0))]);
        model.episode.failure_reward = -5.0;
        model.validate().unwrap();
        let mdp = BeliefMdp::new(&model);
        let settings = Settings {
            points: Some(241),
            ..Default::default()
        };
        let states = StateMdp::solve(&mdp, &settings, &Silent).unwrap();
        // From 0.5 one step east is inside, the second is not, and nothing comes after it.
        let expected = 1.0 + 0.75 * (1.0 - 5.0);
        assert!((states.q_values(0, &[0.5])[0] - expected).abs() < 1e-9);
        assert!((states.q_values(0, &[1.5])[0] - (1.0 - 5.0)).abs() < 1e-9);
    }
}
