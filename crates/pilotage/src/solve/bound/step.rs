//! What an action pays and does at a true state, by the model's [effects](crate::model::Effect), for the seen and for the believed.

use crate::model::{ActionId, Effect, ModeId, Model, Tally, Then, When};

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

/// An action taken in a mode, in a model that no step of the episode changes.
pub(super) struct Doing<'a> {
    model: &'a Model,
    tally: Tally,
    before: Vec<Effect>,
    after: Vec<Effect>,
}

impl<'a> Doing<'a> {
    pub(super) fn new(model: &'a Model, mode: ModeId, action: ActionId) -> Self {
        let effects = model.effects(mode, action, 0).into_iter();
        let (before, after) = effects.partition(|effect| effect.when == When::Before);
        Self {
            model,
            tally: model.tally(mode, action),
            before,
            after,
        }
    }

    /// The action at a state.
    pub(super) fn before(&self, at: &[f64]) -> Before {
        let mut tally = self.tally;
        let happened = tally.see(&self.before, at);
        let outcome = happened.unwrap_or_else(|| tally.rest());
        Before {
            reward: tally.reward,
            mode: outcome.mode,
            then: outcome.then,
            happened: happened.is_some(),
        }
    }

    /// Where the state has moved to, and what happened before it moved.
    pub(super) fn after(&self, before: &Before, at: &[f64]) -> After {
        if !self.model.episode.alive.contains(at) {
            return After {
                reward: self.model.episode.failure_reward,
                mode: before.mode,
                then: Then::End,
            };
        }
        let mut tally = self.tally;
        let over = |effect: &&Effect| before.happened && effect.change.is_some();
        let left = self.after.iter().filter(|effect| !over(effect));
        let happened = tally.see(left, at);
        After {
            reward: tally.reward,
            mode: happened.map_or(before.mode, |outcome| outcome.mode),
            then: happened.map_or(Then::Continue, |outcome| outcome.then),
        }
    }
}
