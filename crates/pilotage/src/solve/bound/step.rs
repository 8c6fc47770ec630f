//! What a step pays and does at a true state, as the world does it ([`crate::world::ProblemWorld`]), for the seen and for the
//! believed.

use crate::model::{ActionId, Event, ModeId, Model, Then, When};

/// What happens before the state moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Before {
    /// Rewards and that of the event.
    pub reward: f64,
    /// Mode afterwards.
    pub mode: ModeId,
    /// Whether the step goes on to move the state.
    pub then: Then,
    /// Whether an event happened: there is at most one a step.
    pub happened: bool,
}

/// What happens once it has moved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct After {
    /// Rewards, that of the event, or that of failing.
    pub reward: f64,
    /// Mode afterwards.
    pub mode: ModeId,
    /// What becomes of the episode.
    pub then: Then,
}

/// An action taken in a mode at a state.
pub(super) fn before(model: &Model, mode: ModeId, action: ActionId, at: &[f64]) -> Before {
    let event = first_event(model, When::Before, mode, action, at);
    let then = match (model.actions[action].then, event) {
        (Then::Continue, Some(event)) => event.then,
        (then, _) => then,
    };
    Before {
        reward: paid(model, When::Before, mode, action, at) + reward_of(event),
        mode: event.and_then(|event| event.becomes).unwrap_or(mode),
        then,
        happened: event.is_some(),
    }
}

/// Where the state has moved to after an action that was taken in a mode, and what happened before it moved.
pub(super) fn after(
    model: &Model,
    mode: ModeId,
    action: ActionId,
    before: &Before,
    at: &[f64],
) -> After {
    if !model.episode.alive.contains(at) {
        return After {
            reward: model.episode.failure_reward,
            mode: before.mode,
            then: Then::End,
        };
    }
    let event = match before.happened {
        true => None,
        false => first_event(model, When::After, mode, action, at),
    };
    After {
        reward: paid(model, When::After, mode, action, at) + reward_of(event),
        mode: event.and_then(|event| event.becomes).unwrap_or(before.mode),
        then: event.map_or(Then::Continue, |event| event.then),
    }
}

fn paid(model: &Model, when: When, mode: ModeId, action: ActionId, at: &[f64]) -> f64 {
    let rewards = model.rewards.iter().filter(|reward| {
        reward.when == when && reward.applies(mode, action) && reward.region.contains(at)
    });
    rewards.map(|reward| reward.value).sum()
}

fn first_event<'a>(
    model: &'a Model,
    when: When,
    mode: ModeId,
    action: ActionId,
    at: &[f64],
) -> Option<&'a Event> {
    model.events.iter().find(|event| {
        event.when == when && event.applies(mode, action) && event.region.contains(at)
    })
}

fn reward_of(event: Option<&Event>) -> f64 {
    event.map_or(0.0, |event| event.reward)
}

/// Whether anything starts the episode afresh.
pub(super) fn restarts(model: &Model) -> bool {
    let actions = model.actions.iter().map(|action| action.then);
    let mut all = actions.chain(model.events.iter().map(|event| event.then));
    all.any(|then| then == Then::Restart)
}
