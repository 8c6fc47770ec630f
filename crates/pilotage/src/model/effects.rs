//! What a step does besides moving the state: rewards, events, and the end of an episode. Said once, for the world that tests it at a
//! state and for beliefs that integrate it.
//!
//! A step asks twice where the state is ([`When`]): when the action is taken, and where it has led. Of all [`Effect`]s that apply,
//! plain rewards add up, and of those that change something (events) the first happens and no other. What the action itself does to the
//! episode comes before what an event does; a step that ends or restarts the episode does not move.

use nalgebra::DMatrix;

use super::law::{Formula, Point};
use super::{ActionId, Event, ModeId, Model, Region, Steps, Then, When, applies};

/// One thing that a step can do. Whoever knows how likely its region holds knows the rest ([`Tally`]).
#[derive(Debug, Clone, PartialEq)]
pub struct Effect {
    /// Where the state must be.
    pub region: Region,
    /// When it must be there.
    pub when: When,
    /// Paid when it happens.
    pub reward: f64,
    /// What is paid besides, where it depends on the state.
    pub formula: Option<Formula>,
    /// Probability that it happens where its region holds.
    pub chance: f64,
    /// What it changes; `None` for a reward, which is paid beside everything else.
    pub change: Option<Change>,
}

/// What an event changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Change {
    /// Mode afterwards.
    pub mode: ModeId,
    /// What it does to the episode.
    pub then: Then,
}

/// One thing that can have happened to mode and episode once the step is over.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome {
    /// Its probability; those of one action sum to 1.
    pub probability: f64,
    /// Mode afterwards.
    pub mode: ModeId,
    /// What happens to the episode.
    pub then: Then,
}

/// A change of mode that an agent infers from its own action and where it believes to be. Of several the first happens, those before
/// the move first.
#[derive(Debug, Clone, PartialEq)]
pub struct Switch {
    /// Actions it happens on; `None` for all.
    pub actions: Option<Vec<ActionId>>,
    /// Mode it happens in; `None` for any.
    pub mode: Option<ModeId>,
    /// Where the mean must be.
    pub region: Region,
    /// Whether it must be there when the action is taken, or once what it brought has been sensed.
    pub when: When,
    /// Steps of an episode in which it happens.
    pub steps: Steps,
    /// Mode afterwards.
    pub becomes: ModeId,
}

impl Switch {
    /// Whether it happens to someone who is at a place (length `n`) then, in a mode, with an action, at a step.
    pub fn happens(
        &self,
        when: When,
        (mode, action): (ModeId, ActionId),
        step: usize,
        at: &[f64],
    ) -> bool {
        self.when == when
            && applies(&self.actions, self.mode, mode, action)
            && self.steps.contains(step)
            && self.region.contains(at)
    }
}

impl Model {
    /// How the mode changes for someone who takes the mean of a belief for the state.
    ///
    /// An event that leaves the mode as it is stands in the way of those after it, unless it ends or restarts the episode: who goes on
    /// knows that it has not happened.
    pub(crate) fn switches(&self) -> Vec<Switch> {
        let (before, after): (Vec<&Event>, Vec<&Event>) = self
            .events
            .iter()
            .partition(|event| event.when == When::Before);
        let events = [before, after].concat();
        let last = events.iter().rposition(|event| event.becomes.is_some());
        let of = |(i, event): (usize, &&Event)| {
            let to = |mode, becomes| Switch {
                actions: event.actions.clone(),
                mode,
                region: event.region.clone(),
                when: event.when,
                steps: event.steps,
                becomes,
            };
            match (event.becomes, event.mode) {
                (Some(becomes), mode) => vec![to(mode, becomes)],
                _ if event.then != Then::Continue || Some(i) > last => Vec::new(),
                (None, Some(mode)) => vec![to(Some(mode), mode)],
                (None, None) => {
                    let modes = 0..self.modes.len();
                    modes.map(|mode| to(Some(mode), mode)).collect()
                }
            }
        };
        events.iter().enumerate().flat_map(of).collect()
    }

    /// All that an action can do in a mode: rewards, then events in the order in which they are asked, those before the move first.
    /// `step` counts the steps of the episode from 0.
    pub fn effects(&self, mode: ModeId, action: ActionId, step: usize) -> Vec<Effect> {
        let rewards = self.rewards.iter();
        let rewards =
            rewards.filter(|term| term.steps.contains(step) && term.applies(mode, action));
        let paid = rewards.map(|term| Effect {
            region: term.region.clone(),
            when: term.when,
            reward: term.value,
            formula: term.formula.clone(),
            chance: 1.0,
            change: None,
        });
        let mut events: Vec<&Event> = self
            .events
            .iter()
            .filter(|event| event.steps.contains(step) && event.applies(mode, action))
            .collect();
        events.sort_by_key(|event| event.when == When::After);
        let happening = events.into_iter().map(|event| Effect {
            region: event.region.clone(),
            when: event.when,
            reward: event.reward,
            formula: None,
            chance: event.probability,
            change: Some(Change {
                mode: event.becomes.unwrap_or(mode),
                then: event.then,
            }),
        });
        paid.chain(happening).collect()
    }

    /// What the [`QuadraticCost`](super::QuadraticCost) pays, 0 or less, for an action in a state whose mean is `mean` (length `n`) and
    /// whose covariance, if it is not known, is `covariance` (`n x n`): `-(m' Q m + tr(Q P) + u' R u)`.
    pub fn running_cost(
        &self,
        mean: &[f64],
        covariance: Option<&DMatrix<f64>>,
        action: ActionId,
    ) -> f64 {
        self.cost.as_ref().map_or(0.0, |cost| {
            let control = self.actions[action].control.as_slice();
            -(quadratic(&cost.state, mean, covariance) + quadratic(&cost.control, control, None))
        })
    }

    /// The same for a state in which an episode ends.
    pub fn terminal_cost(&self, mean: &[f64], covariance: Option<&DMatrix<f64>>) -> f64 {
        let terminal = self.cost.as_ref();
        terminal.map_or(0.0, |cost| -quadratic(&cost.terminal, mean, covariance))
    }

    /// Bounds on the reward of one step, that of failing included and what formulas and costs pay apart: smallest, largest.
    pub fn reward_range(&self) -> (f64, f64) {
        let events = self.events.iter().map(|event| event.reward);
        let events = events.chain([self.episode.failure_reward]);
        let values = || {
            let rewards = self.rewards.iter().map(|reward| reward.value);
            rewards.chain(events.clone())
        };
        (
            values().map(|value| value.min(0.0)).sum(),
            values().map(|value| value.max(0.0)).sum(),
        )
    }

    /// The account of a step that has not happened yet.
    pub fn tally(&self, mode: ModeId, action: ActionId) -> Tally {
        Tally {
            reward: 0.0,
            mode,
            ends: self.actions[action].then,
            left: 1.0,
        }
    }

    /// The first step of an episode from which on nothing in the model changes any more with the step; 0 where nothing ever does. What
    /// would change after the last step of an episode does not count.
    pub fn clock(&self) -> usize {
        if self.formulas_tell_steps() {
            return self.episode.length;
        }
        let last = self.turns().into_iter().max().unwrap_or(0);
        last.min(self.episode.length)
    }

    fn formulas_tell_steps(&self) -> bool {
        let starts = self.start.iter().map(|start| start.mean.as_slice());
        let places: Vec<Point<'_>> = starts
            .flat_map(|state| {
                self.actions.iter().map(move |action| Point {
                    state,
                    control: action.control.as_slice(),
                    step: 0,
                })
            })
            .collect();
        let paid = self.rewards.iter().filter_map(|term| term.formula.as_ref());
        let mut formulas = paid.chain(self.laws.formulas());
        formulas.any(|formula| formula.tells_steps(&places, self.episode.length))
    }

    /// The steps from which on something is different from before, in rising order, 0 among them.
    fn turns(&self) -> Vec<usize> {
        let rewards = self.rewards.iter().map(|term| term.steps);
        let steps = rewards.chain(self.events.iter().map(|event| event.steps));
        let ends = steps.flat_map(|steps| [steps.from, steps.until]);
        let mut turns: Vec<usize> = ends
            .filter(|step| *step != usize::MAX)
            .chain(self.phases())
            .collect();
        turns.sort_unstable();
        turns.dedup();
        turns
    }

    /// Whether anything leads back to the start.
    pub(crate) fn restarts(&self) -> bool {
        let ends = self.actions.iter().map(|action| action.then);
        let mut ends = ends.chain(self.events.iter().map(|event| event.then));
        ends.any(|then| then == Then::Restart)
    }
}

/// `E x' W x` of a vector with that mean and covariance.
fn quadratic(weights: &DMatrix<f64>, mean: &[f64], covariance: Option<&DMatrix<f64>>) -> f64 {
    let n = mean.len();
    let pairs = (0..n).flat_map(|i| (0..n).map(move |j| (i, j)));
    let of = |(i, j)| {
        let spread = covariance.map_or(0.0, |covariance| covariance[(i, j)]);
        weights[(i, j)] * (mean[i] * mean[j] + spread)
    };
    pairs.map(of).sum()
}

/// The effects of a model by step, mode and action, kept once for all steps between which nothing changes.
#[derive(Debug, Clone)]
pub(crate) struct EffectTable {
    /// The steps from which on effects are others, 0 first.
    turns: Vec<usize>,
    /// By turn, mode, action.
    effects: Vec<Vec<Vec<Vec<Effect>>>>,
}

impl EffectTable {
    /// The table of a model, whose effects are `read` by whoever uses it.
    pub(crate) fn new(model: &Model, read: impl Fn(Vec<Effect>) -> Vec<Effect>) -> Self {
        let turns = model.turns();
        let (modes, actions) = (0..model.modes.len(), 0..model.actions.len());
        let at = |step, mode, action| read(model.effects(mode, action, step));
        let of_mode = |step, mode| actions.clone().map(|a| at(step, mode, a)).collect();
        let of_step = |step| modes.clone().map(|mode| of_mode(step, mode)).collect();
        Self {
            effects: turns.iter().map(|step| of_step(*step)).collect(),
            turns,
        }
    }

    /// What an action can do in a mode at a step of the episode.
    pub(crate) fn at(&self, step: usize, mode: ModeId, action: ActionId) -> &[Effect] {
        let turn = self.turns.partition_point(|turn| *turn <= step) - 1;
        &self.effects[turn][mode][action]
    }
}

/// Splits the regions of events so that no two of the same time overlap: each is left with what comes to it first. Then the
/// probability of an event is that of its regions.
pub fn apart(effects: Vec<Effect>) -> Vec<Effect> {
    let mut taken: Vec<(When, Region)> = Vec::new();
    let mut split = Vec::with_capacity(effects.len());
    for effect in effects {
        if effect.change.is_none() {
            split.push(effect);
            continue;
        }
        let earlier = taken.iter().filter(|(when, _)| *when == effect.when);
        let rest = earlier.fold(vec![effect.region.clone()], |rest, (_, region)| {
            rest.iter()
                .flat_map(|piece| piece.without(region))
                .collect()
        });
        taken.push((effect.when, effect.region.clone()));
        split.extend(rest.into_iter().map(|region| Effect {
            region,
            ..effect.clone()
        }));
    }
    split
}

/// The account of a step: fed with its effects in order and how likely the region of each holds (0 or 1 for someone who sees the
/// state), it knows the expected reward, and says what can have happened.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tally {
    /// Expected reward so far.
    pub reward: f64,
    mode: ModeId,
    ends: Then,
    /// Probability that no event has happened yet.
    left: f64,
}

impl Tally {
    /// Takes in the next effect, which happens with this probability unless an event has; for an event, the outcome that it leads to.
    pub fn take(&mut self, effect: &Effect, holds: f64) -> Option<Outcome> {
        let Some(change) = effect.change else {
            self.reward += effect.reward * holds;
            return None;
        };
        let probability = holds.min(self.left);
        self.left -= probability;
        self.reward += effect.reward * probability;
        Some(Outcome {
            probability,
            mode: change.mode,
            then: match self.ends {
                Then::Continue => change.then,
                ends => ends,
            },
        })
    }

    /// Takes in effects for someone who sees the state, of length `n`, of a model whose events are certain and whose rewards are
    /// numbers; what has happened, if an event has.
    pub fn see<'a>(
        &mut self,
        effects: impl IntoIterator<Item = &'a Effect>,
        state: &[f64],
    ) -> Option<Outcome> {
        let point = Point {
            state,
            control: &[],
            step: 0,
        };
        self.live(effects, &point, &mut || 0.0)
    }

    /// Takes in effects for someone who sees the state and to whom chance happens: `chance` draws a number in `[0, 1)`, once for every
    /// event that may or may not happen here. What has happened, if an event has.
    pub fn live<'a>(
        &mut self,
        effects: impl IntoIterator<Item = &'a Effect>,
        point: &Point<'_>,
        chance: &mut dyn FnMut() -> f64,
    ) -> Option<Outcome> {
        let mut happened = None;
        for effect in effects {
            let mut holds = effect.region.contains(point.state);
            if holds && self.left > 0.0 && effect.chance < 1.0 {
                holds = chance() < effect.chance;
            }
            if let Some(formula) = effect.formula.as_ref().filter(|_| holds) {
                self.reward += formula.value(point);
            }
            let outcome = self.take(effect, f64::from(holds));
            happened = happened.or(outcome.filter(|outcome| outcome.probability == 1.0));
        }
        happened
    }

    /// What has happened where no event has.
    pub fn rest(&self) -> Outcome {
        Outcome {
            probability: self.left,
            mode: self.mode,
            then: self.ends,
        }
    }
}
