//! The bound that always holds: the most that any state pays, at every step.

use crate::model::{ActionId, ModeId, Model, Then};

/// The most that any policy earns within so many steps, wherever it is and whatever it knows.
#[derive(Debug, Clone)]
pub(super) struct Ceiling {
    discount: f64,
    /// The most that an action pays that may go on, and one after which nothing more comes.
    going_on: f64,
    ending: f64,
}

impl Ceiling {
    pub fn new(model: &Model) -> Self {
        let mut ceiling = Self {
            discount: model.discount,
            going_on: f64::NEG_INFINITY,
            ending: f64::NEG_INFINITY,
        };
        for action in 0..model.actions.len() {
            let most = (0..model.modes.len())
                .map(|mode| most_paid(model, mode, action))
                .fold(f64::NEG_INFINITY, f64::max);
            let ends_by_event = model.events.iter().any(|event| {
                event.then == Then::End
                    && (0..model.modes.len()).any(|mode| event.applies(mode, action))
            });
            let ends = model.actions[action].then == Then::End;
            if ends || ends_by_event || !model.episode.alive.sides.is_empty() {
                ceiling.ending = ceiling.ending.max(most);
            }
            if !ends {
                ceiling.going_on = ceiling.going_on.max(most);
            }
        }
        ceiling
    }

    /// The most for one step more than those that can bring `less`.
    pub fn one_more(&self, less: f64) -> f64 {
        self.ending.max(self.going_on + self.discount * less)
    }

    /// The most within so many steps.
    pub fn within(&self, steps: usize) -> f64 {
        const ENOUGH: usize = 100_000;
        let (mut most, mut rise) = (0.0, 0.0);
        for _ in 0..steps.min(ENOUGH) {
            let next = self.one_more(most);
            rise = f64::max(next - most, 0.0);
            if next == most {
                return most;
            }
            most = next;
        }
        // Every further step adds at most `discount` times what the last one added.
        let further = (steps - steps.min(ENOUGH)) as f64;
        most + rise * further.min(1.0 / (1.0 - self.discount).max(0.0))
    }
}

/// The most that one step pays: all rewards above 0 that it can bring, and the best event or failure.
fn most_paid(model: &Model, mode: ModeId, action: ActionId) -> f64 {
    let rewards = model.rewards.iter();
    let rewards = rewards.filter(|reward| reward.applies(mode, action));
    let paid: f64 = rewards
        .map(|reward| match reward.region.sides.is_empty() {
            // What is paid everywhere before the step cannot be avoided.
            true if reward.when == crate::model::When::Before => reward.value,
            _ => reward.value.max(0.0),
        })
        .sum();
    let events = model.events.iter();
    let events = events.filter(|event| event.applies(mode, action));
    let event = events.map(|event| event.reward).fold(0.0, f64::max);
    paid + event + model.episode.failure_reward.max(0.0)
}
