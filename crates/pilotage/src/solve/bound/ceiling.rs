//! The bound that always holds: the most that any state pays, at every step.

use super::frame::{cuts, inside};
use super::step::Doing;
use crate::model::{ActionId, Effect, ModeId, Model, Then};

/// Most cells of states that are looked at one by one.
const MOST_CELLS: usize = 10_000;
/// Most sweeps; further steps are bounded together.
const MOST_SWEEPS: usize = 100_000;

/// The most that any policy earns within so many steps, wherever it is and whatever it knows.
#[derive(Debug, Clone)]
pub(super) struct Ceiling {
    discount: f64,
    /// The most that a step pays after which the episode may go on, and the most of one after which it may not.
    going_on: f64,
    ending: f64,
}

impl Ceiling {
    pub(super) fn new(model: &Model) -> Self {
        let mut ceiling = Self {
            discount: model.discount,
            going_on: f64::NEG_INFINITY,
            ending: f64::NEG_INFINITY,
        };
        let places = places(model);
        for mode in 0..model.modes.len() {
            for action in 0..model.actions.len() {
                match &places {
                    Some(places) => ceiling.look(model, mode, action, places),
                    None => ceiling.add_up(model, mode, action),
                }
            }
        }
        ceiling
    }

    /// Every place to begin in with every place to end in.
    fn look(&mut self, model: &Model, mode: ModeId, action: ActionId, places: &[Vec<f64>]) {
        let doing = Doing::new(model, mode, action);
        let mut known: Vec<(ModeId, bool, [f64; 2])> = Vec::new();
        for at in places {
            let before = doing.before(at);
            if before.then != Then::Continue {
                self.take(before.then, before.reward);
                continue;
            }
            let alike = known
                .iter()
                .find(|known| (known.0, known.1) == (before.mode, before.happened));
            let [going_on, ending] = match alike {
                Some(known) => known.2,
                None => {
                    let mut most = [f64::NEG_INFINITY; 2];
                    for to in places {
                        let after = doing.after(&before, to);
                        let kind = usize::from(after.then == Then::End);
                        most[kind] = most[kind].max(after.reward);
                    }
                    known.push((before.mode, before.happened, most));
                    most
                }
            };
            self.take(Then::Continue, before.reward + going_on);
            self.take(Then::End, before.reward + ending);
        }
    }

    /// With too many places to look at: all rewards above 0 together, and the best event.
    fn add_up(&mut self, model: &Model, mode: ModeId, action: ActionId) {
        let effects = model.effects(mode, action, 0).into_iter();
        let (events, rewards): (Vec<Effect>, Vec<Effect>) =
            effects.partition(|effect| effect.change.is_some());
        let paid: f64 = rewards.iter().map(|effect| effect.reward.max(0.0)).sum();
        let event = events
            .iter()
            .map(|effect| effect.reward)
            .fold(0.0, f64::max);
        let most = paid + event + model.episode.failure_reward.max(0.0);
        self.take(Then::End, most);
        if model.actions[action].then != Then::End {
            self.take(Then::Continue, most);
        }
    }

    fn take(&mut self, then: Then, reward: f64) {
        let most = match then {
            Then::End => &mut self.ending,
            Then::Continue | Then::Restart => &mut self.going_on,
        };
        *most = most.max(reward);
    }

    /// The most for one step more than those that can bring `less`.
    pub(super) fn one_more(&self, less: f64) -> f64 {
        self.ending.max(self.going_on + self.discount * less)
    }

    /// The most within so many steps.
    pub(super) fn within(&self, steps: usize) -> f64 {
        let (mut most, mut rise) = (0.0, 0.0);
        for _ in 0..steps.min(MOST_SWEEPS) {
            let next = self.one_more(most);
            rise = f64::max(next - most, 0.0);
            if next == most {
                return most;
            }
            most = next;
        }
        // Every further step adds at most `discount` times what the last one added.
        let further = (steps - steps.min(MOST_SWEEPS)) as f64;
        most + rise * further.min(1.0 / (1.0 - self.discount).max(0.0))
    }
}

/// One state in every cell between the borders of all regions.
fn places(model: &Model) -> Option<Vec<Vec<f64>>> {
    let mut places = vec![Vec::new()];
    for axis in 0..model.state_dim() {
        let along = inside(&cuts(model, axis));
        if places.len() * along.len() > MOST_CELLS {
            return None;
        }
        let with = |place: &Vec<f64>| {
            let next = along.iter().map(|&x| {
                let mut place = place.clone();
                place.push(x);
                place
            });
            next.collect::<Vec<_>>()
        };
        places = places.iter().flat_map(with).collect();
    }
    Some(places)
}
