//! What planners refuse for the same reasons, with what would do.

use crate::model::{Event, Interval, Model, When};

/// Those that maximise reward need some.
pub(super) fn nothing_paid(model: &Model) -> Option<String> {
    let pays = !model.rewards.is_empty()
        || !model.events.is_empty()
        || model.episode.failure_reward != 0.0
        || model.cost.is_some();
    (!pays).then(|| "nothing in it pays a reward; add a [[reward]] or a [cost]".to_owned())
}

/// Sums without end need a discount.
pub(super) fn reward_missing(model: &Model) -> Option<String> {
    if let Some(reason) = nothing_paid(model) {
        return Some(reason);
    }
    (model.discount >= 1.0).then(|| {
        "its discount is 1, and a sum without end needs one below 1; set `discount` to 0.99 or less"
            .to_owned()
    })
}

/// Some solvers pay by `r(s, a)` only.
pub(super) fn pays_afterwards(model: &Model) -> Option<String> {
    let rewards = model.rewards.iter().map(|reward| reward.when);
    let mut asked = rewards.chain(model.events.iter().map(|event| event.when));
    asked.any(|when| when == When::After).then(|| {
        "it pays for where a step has led (`when = \"after\"`), and this solver only for where it begins; use value-iteration or state the rewards by action and place".to_owned()
    })
}

/// Values of true states do not tell the step.
pub(super) fn changes(model: &Model) -> Option<String> {
    let clock = model.clock();
    let other = match model.is_linear() {
        true => "value-iteration",
        false => "codebook",
    };
    (clock > 0).then(|| {
        format!("what it pays or changes, or how it moves or is sensed, depends on the step of the episode up to step {clock}, and this solver's values do not; use {other}")
    })
}

/// Some solvers know one motion and one sensor.
pub(super) fn phases(model: &Model) -> Option<String> {
    model.later.first().map(|phase| {
        format!(
            "how it moves or is sensed changes at step {} ([[later]]), and this solver knows one motion and one sensor; use value-iteration",
            phase.from
        )
    })
}

/// Some solvers know one motion, one sensor, and readings that always come.
pub(super) fn steps_differ(model: &Model) -> Option<String> {
    if let Some(reason) = phases(model) {
        return Some(reason);
    }
    model.misses_readings().then(|| {
        "its readings may be missing (`present` in [sensor]), and this solver counts on each of them; use value-iteration".to_owned()
    })
}

/// Uncertainty levels follow linear models.
pub(super) fn beyond_levels(model: &Model) -> Option<String> {
    let parts = model.beyond_linear();
    (!parts.is_empty()).then(|| {
        format!(
            "uncertainty levels follow linear models, and this one has {}; use codebook",
            parts.join(", ")
        )
    })
}

/// Feedback on the mean alone has no place for what is added at every step.
pub(super) fn drifts(model: &Model) -> Option<String> {
    let drifts = model
        .phases()
        .any(|step| model.motion_at(step).drift.amax() > 0.0);
    drifts.then(|| {
        "its motion has a drift, which this solver does not know; use value-iteration".to_owned()
    })
}

/// Planners on a grid need to know where to put it.
pub(super) fn bound_missing(model: &Model) -> Option<String> {
    let unbounded = model
        .state
        .iter()
        .find(|variable| variable.bounds == Interval::ALL)?;
    Some(format!(
        "`{}` has no bounds to put a grid between; add `bounds` to [state]",
        unbounded.name
    ))
}

/// Whether a mode changes at a place while the agent is not sure where it is, so that it has to guess the mode from then on.
pub(super) fn guesses_modes(model: &Model) -> bool {
    let placed = |event: &Event| event.becomes.is_some() && !event.region.sides.is_empty();
    let moved = |action| model.motion_noise(action, 0).amax() > 0.0;
    let starts = || {
        model
            .start
            .iter()
            .any(|start| start.covariance.amax() > 0.0)
    };
    model.events.iter().any(placed) && (starts() || (0..model.actions.len()).any(moved))
}
