//! Where a search begins: the linear-quadratic regulator of what is to be kept small.
//!
//! Being at a limit, or at the edge of a place that pays, costs one unit, and so the strongest control of the actions costs
//! `control_weight` (A. E. Bryson, Y.-C. Ho, *Applied Optimal Control*, 1975). The regulator's command then switches between actions
//! along planes through the space of means.

use nalgebra::{DMatrix, DVector};

use super::settings::{Objective, PolicySearch};
use crate::belief::{BeliefMdp, StratumId};
use crate::error::Result;
use crate::model::{Interval, Model, Region};
use crate::solve::compile::planes::{Command, Group};
use crate::solve::lqr::lqr_gain;

/// Groups of levels end where the variances, in units of the limits squared, fall below so many times their steady sum.
const GROUPS_END: [f64; 2] = [5.0, 1.3];

/// The regulator's command, which steers to [`target`].
pub(super) fn command(model: &Model, settings: &PolicySearch, aim: Objective) -> Result<Command> {
    // Discounting is the same as a motion that shrinks by the root of the discount with every step.
    let shrinks = match aim {
        Objective::Survival => 1.0,
        Objective::Return => model.discount.sqrt(),
    };
    let (a, b) = (&model.motion.a, &model.motion.b);
    let gain = lqr_gain(
        &(a * shrinks),
        &(b * shrinks),
        &state_weights(model, aim),
        &control_weights(model, settings, aim),
    )?;
    let target = target(model, aim);
    // What it takes to stay there.
    let drift = &target - a * &target;
    let hold = b
        .clone()
        .pseudo_inverse(1e-12)
        .map_or_else(|_| DVector::zeros(b.ncols()), |inverse| inverse * drift);
    Ok(Command {
        offset: &gain * target + hold,
        gain,
    })
}

/// Where the state is to be (length `n`): in the middle of the place that pays best, and otherwise at the origin, or in the middle of
/// limits that leave it out.
pub(super) fn target(model: &Model, aim: Objective) -> DVector<f64> {
    let best = goal(model, aim);
    DVector::from_fn(model.state_dim(), |i, _| {
        let wanted = best.map_or(Interval::ALL, |region| region.side(i));
        let allowed = model.episode.alive.side(i);
        match (middle(wanted), middle(allowed)) {
            (Some(middle), _) => middle,
            (None, Some(middle)) if !allowed.contains(0.0) => middle,
            (None, _) => 0.0,
        }
    })
}

/// The place that pays best, where something good is paid in a place.
fn goal(model: &Model, aim: Objective) -> Option<&Region> {
    let rewards = model.rewards.iter().map(|term| (term.value, &term.region));
    let events = model
        .events
        .iter()
        .map(|event| (event.reward, &event.region));
    let good = rewards
        .chain(events)
        .filter(|(value, region)| *value > 0.0 && !region.sides.is_empty());
    let best = good.max_by(|a, b| a.0.total_cmp(&b.0));
    best.map(|(_, region)| region)
        .filter(|_| aim == Objective::Return)
}

/// The middle of an interval, or its end where it has only one.
fn middle(side: Interval) -> Option<f64> {
    match (side.low.is_finite(), side.high.is_finite()) {
        (true, true) => Some(0.5 * (side.low + side.high)),
        (true, false) => Some(side.low),
        (false, true) => Some(side.high),
        (false, false) => None,
    }
}

/// One unit of cost at the nearer limit of each variable, or where the return is the aim at the edge of the place that pays, if that is
/// nearer (`n x n`, diagonal). The model's own cost, where it has one and the return is the aim.
pub(super) fn state_weights(model: &Model, aim: Objective) -> DMatrix<f64> {
    let n = model.state_dim();
    if let (Objective::Return, Some(cost)) = (aim, &model.cost) {
        return cost.state.clone();
    }
    let target = target(model, aim);
    let nearer = |i: usize, side: Interval| (side.high - target[i]).min(target[i] - side.low);
    let mut reach = vec![f64::INFINITY; n];
    let goal = goal(model, aim).map_or(&[][..], |region| &region.sides);
    for &(i, side) in model.episode.alive.sides.iter().chain(goal) {
        reach[i] = reach[i].min(nearer(i, side));
    }
    // Nothing says where to be, but for the bounds.
    if reach.iter().all(|reach| !reach.is_finite()) {
        for (reach, variable) in reach.iter_mut().zip(&model.state) {
            *reach = 0.5 * variable.bounds.width();
        }
    }
    let weight = |reach: f64| {
        if reach > 0.0 { reach.powi(-2) } else { 0.0 }
    };
    DMatrix::from_fn(n, n, |i, j| if i == j { weight(reach[i]) } else { 0.0 })
}

fn control_weights(model: &Model, settings: &PolicySearch, aim: Objective) -> DMatrix<f64> {
    let p = model.motion.b.ncols();
    if let (Objective::Return, Some(cost)) = (aim, &model.cost) {
        return cost.control.clone();
    }
    let strongest = |j: usize| {
        let strengths = model.actions.iter().map(|action| action.control[j].abs());
        strengths.fold(f64::MIN_POSITIVE, f64::max)
    };
    DMatrix::from_fn(p, p, |i, j| {
        if i == j {
            settings.control_weight / strongest(j).powi(2)
        } else {
            0.0
        }
    })
}

/// The levels of an episode in groups of like uncertainty; the last holds the steady level.
pub(super) fn groups_of_levels(mdp: &BeliefMdp, aim: Objective) -> Vec<Group> {
    let levels = mdp.levels();
    let last = levels.len() - 1;
    let weights = state_weights(mdp.model(), aim);
    let uncertainty = |level| weights.component_mul(levels.covariance(level)).sum();
    let excess = |level: StratumId| uncertainty(level) / uncertainty(last);
    let mut groups = Vec::new();
    let mut first = 0;
    for end in GROUPS_END {
        let next = (first..last)
            .find(|&level| excess(level) < end)
            .unwrap_or(last);
        if next > first {
            groups.push((first, next - 1));
            first = next;
        }
    }
    groups.push((first, last));
    groups
}
