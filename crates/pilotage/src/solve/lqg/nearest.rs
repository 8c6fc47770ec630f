//! The controller as a baseline for models with a list of actions: the one nearest to the command.

use nalgebra::{DMatrix, DVector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::belief::{Belief, BeliefMdp};
use crate::error::{Error, Result};
use crate::model::{ActionId, Interval, Model, Then};
use crate::policy::{Automaton, Matching, Node, Place, Policy};
use crate::solve::lqr::lqr_gain;

/// What deviations cost, variable by variable: `x' diag(state) x + u' diag(control) u`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
pub struct Weights {
    /// What a deviation of each state variable costs, such as `[1.0, 0.0]`; each at least 0, or `auto` for the model's own cost, or else
    /// 1 at each limit.
    #[serde(rename = "state_weights")]
    pub state: Option<Vec<f64>>,
    /// What each control costs, such as `[0.1]`; each more than 0, or `auto` for the model's own cost, or else 1 at the largest of an
    /// action.
    #[serde(rename = "control_weights")]
    pub control: Option<Vec<f64>>,
}

/// What weights have to be.
pub(super) const WEIGHTS: &str =
    "one finite number for each variable or control, none negative, those of controls above 0";

/// The action whose control is nearest to `u = -L m`, ties to the first.
#[derive(Debug, Clone)]
pub struct NearestAction {
    gain: DMatrix<f64>,
    /// Actions that leave the episode alone, with their controls.
    actions: Vec<(ActionId, DVector<f64>)>,
}

impl NearestAction {
    /// The stationary gain of the discounted problem, from the weights given, or else the model's `[cost]`, or else Bryson's rule: a
    /// variable costs 1 at its limit in `episode.alive`, a control 1 at the largest that an action has, and what has no limit
    /// costs nothing.
    ///
    /// # Errors
    /// [`Error::Setting`] for weights out of range, [`Error::NoSteadyState`] where no gain holds every direction that costs.
    pub fn new(model: &Model, weights: &Weights) -> Result<Self> {
        let state = match (&weights.state, &model.cost) {
            (Some(weights), _) => diagonal("state_weights", weights, model.state_dim(), 0.0)?,
            (None, Some(cost)) => cost.state.clone(),
            (None, None) => bryson_state(model),
        };
        let control = match (&weights.control, &model.cost) {
            (Some(weights), _) => {
                let controls = model.motion.b.ncols();
                diagonal("control_weights", weights, controls, f64::MIN_POSITIVE)?
            }
            (None, Some(cost)) => cost.control.clone(),
            (None, None) => bryson_control(model),
        };
        let actions = model.actions.iter().enumerate();
        Ok(Self {
            gain: stationary_gain(model, &state, &control)?,
            actions: actions
                .filter(|(_, action)| action.then == Then::Continue)
                .map(|(id, action)| (id, action.control.clone()))
                .collect(),
        })
    }

    /// The gain `L`, `p x n`.
    pub fn gain(&self) -> &DMatrix<f64> {
        &self.gain
    }

    /// The command `-L m`, length `p`.
    pub fn command(&self, mean: &[f64]) -> DVector<f64> {
        -(&self.gain * DVector::from_column_slice(mean))
    }

    /// With two actions, the automaton of two nodes that does the same: they lie mirrored at the plane on which both actions are
    /// equally near to the command. `None` with more actions, or with two that are the same control.
    pub fn automaton(&self, mdp: &BeliefMdp) -> Option<Automaton> {
        let [(first, low), (second, high)] = self.actions.as_slice() else {
            return None;
        };
        // |high - u| < |low - u| where normal . m > offset.
        let normal = -(self.gain.transpose() * (high - low));
        let offset = 0.5 * (high.norm_squared() - low.norm_squared());
        let square = normal.norm_squared();
        if square == 0.0 {
            return None;
        }
        let foot = &normal * (offset / square);
        let aside = &normal / square.sqrt();
        let mut automaton = Automaton::new(mdp, super::SOLVER, Matching::Nearest);
        for (point, action) in [(&foot - &aside, *first), (&foot + &aside, *second)] {
            let place = Place::Point(point.as_slice().to_vec());
            let levels = 0..=mdp.strata() - 1;
            automaton
                .nodes
                .push(Node::new(levels, mdp.start().mode, place, action, None));
        }
        Some(automaton)
    }
}

impl Policy for NearestAction {
    fn action(&self, belief: &Belief) -> ActionId {
        let command = self.command(&belief.mean);
        let mut best = (0, f64::INFINITY);
        for (action, control) in &self.actions {
            let distance = (control - &command).norm_squared();
            if distance < best.1 {
                best = (*action, distance);
            }
        }
        best.0
    }
}

/// The gain for ever, discounted: discounting is the same as a motion that shrinks by the root of the discount with every step.
fn stationary_gain(
    model: &Model,
    state: &DMatrix<f64>,
    control: &DMatrix<f64>,
) -> Result<DMatrix<f64>> {
    let root = model.discount.sqrt();
    lqr_gain(
        &(&model.motion.a * root),
        &(&model.motion.b * root),
        state,
        control,
    )
}

fn diagonal(
    setting: &'static str,
    weights: &[f64],
    length: usize,
    least: f64,
) -> Result<DMatrix<f64>> {
    let fits = |weight: &f64| weight.is_finite() && *weight >= least;
    if weights.len() != length || !weights.iter().all(fits) {
        return Err(Error::Setting {
            setting,
            value: format!("{weights:?}"),
            range: WEIGHTS,
        });
    }
    Ok(DMatrix::from_diagonal(&DVector::from_column_slice(weights)))
}

fn bryson_state(model: &Model) -> DMatrix<f64> {
    let weight = |variable: usize| {
        let side = model
            .episode
            .alive
            .sides
            .iter()
            .find(|(limited, _)| *limited == variable);
        let (low, high) = match side {
            Some((_, Interval { low, high })) => (low.abs(), high.abs()),
            None => return 0.0,
        };
        1.0 / low.min(high).powi(2)
    };
    let n = model.state_dim();
    DMatrix::from_fn(n, n, |i, j| if i == j { weight(i) } else { 0.0 })
}

fn bryson_control(model: &Model) -> DMatrix<f64> {
    let p = model.motion.b.ncols();
    let largest = |control: usize| {
        let controls = model.actions.iter().map(|action| action.control[control]);
        controls.fold(0.0, |largest: f64, u| largest.max(u.abs()))
    };
    DMatrix::from_fn(p, p, |i, j| match (i == j, largest(i)) {
        (false, _) => 0.0,
        (true, 0.0) => 1.0,
        (true, most) => 1.0 / (most * most),
    })
}
