//! The horizon-N Q-value (thesis 5.3): depth-first search for the best sequence of actions.
//!
//! A branch of the tree is a sequence of actions fixed in advance. Its worth is the discounted sum of expected rewards over the
//! beliefs that may be held at each step. Branches are cut where the mean leaves the world (the thesis' pruning), where even the
//! largest reward at every later step could not make up for what is missing (branch and bound). What follows an expected belief
//! does not depend on how it was reached, so it is searched once and remembered: where actions commute, as in a maze, the search
//! grows with the places within reach and no longer with the number of sequences.

use std::collections::HashMap;

use nalgebra::DVector;

use super::formulas::{Formulas, Outlook};
use crate::belief::{Belief, BeliefMdp, ClassId};
use crate::model::{ActionId, ModeId, Outcome, Then};
use crate::policy::{Policy, first_best};

/// Settings of the search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Steps the agent looks ahead: a branch collects the rewards of steps 0 to `horizon`.
    pub horizon: usize,
    /// Steps for which an action is kept once chosen ("logically grouped actions"), at least 1.
    pub group: usize,
    /// The formulas.
    pub formulas: Formulas,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            horizon: 12,
            group: 1,
            formulas: Formulas::default(),
        }
    }
}

/// How far outside the bounds an expected mean may be, in standard deviations of the level.
const REACH: f64 = 2.5;

/// The planner that searches the tree anew at every belief.
#[derive(Debug, Clone)]
pub struct Branches {
    mdp: BeliefMdp,
    settings: Settings,
}

impl Branches {
    /// A planner for the decision process.
    pub fn new(mdp: BeliefMdp, settings: Settings) -> Self {
        Self { mdp, settings }
    }

    /// The same planner with another horizon.
    pub(crate) fn with_horizon(&self, horizon: usize) -> Self {
        Self {
            mdp: self.mdp.clone(),
            settings: Settings {
                horizon,
                ..self.settings
            },
        }
    }

    /// Steps it looks ahead.
    pub(crate) fn horizon(&self) -> usize {
        self.settings.horizon
    }

    /// The decision process.
    pub(crate) fn mdp(&self) -> &BeliefMdp {
        &self.mdp
    }

    /// `Q` of every action as the first of a branch.
    ///
    /// Where observations gather around the true state and not around the mean (the tiger), the branch is searched once for each
    /// case, as the thesis does, and the cases are weighted by the belief.
    pub fn q_values(&self, belief: &Belief) -> Vec<f64> {
        let hypotheses = self.mdp.hypotheses(belief.stratum, &belief.mean);
        let cases = match &hypotheses {
            Some(points) => points
                .iter()
                .map(|(weight, point)| (*weight, Some(point)))
                .collect(),
            None => vec![(1.0, None)],
        };
        let mut q = vec![0.0; self.mdp.model().actions.len()];
        for (weight, case) in cases {
            let mut search = Search::new(&self.mdp, &self.settings, case);
            for (action, q) in q.iter_mut().enumerate() {
                *q += weight * search.best_branch_from(belief, action);
            }
        }
        q
    }
}

impl Policy for Branches {
    fn action(&self, belief: &Belief) -> ActionId {
        first_best(&self.q_values(belief))
    }

    fn value(&self, belief: &Belief) -> Option<f64> {
        self.q_values(belief).into_iter().reduce(f64::max)
    }
}

/// Index of an outlook in [`Search::outlooks`].
type OutlookId = usize;

/// An expected belief in the tree.
#[derive(Debug, Clone)]
struct Expected {
    mode: ModeId,
    outlook: OutlookId,
    mean: DVector<f64>,
}

struct Search<'a> {
    mdp: &'a BeliefMdp,
    settings: &'a Settings,
    /// The true state, where the case fixes it.
    case: Option<&'a DVector<f64>>,
    actions: usize,
    /// `discount^t`, and the least and the most that steps `t..=horizon` can earn, by `t`.
    weights: Vec<f64>,
    bounds: Vec<(f64, f64)>,
    /// Outlooks met so far, and where each noise class leads from them.
    outlooks: Vec<Outlook>,
    leads_to: HashMap<(OutlookId, ClassId), OutlookId>,
    /// Actions by mode: the first action that earns the same rewards everywhere.
    earns_like: Vec<Vec<ActionId>>,
    /// What the steps from an expected belief on can collect.
    known: HashMap<Key, Worth>,
}

/// Step, mode, outlook and mean, in bits, of an expected belief.
type Key = (usize, ModeId, OutlookId, Vec<u64>);

/// What the best branch from an expected belief collects.
#[derive(Debug, Clone, Copy)]
enum Worth {
    Exactly(f64),
    AtMost(f64),
}

impl<'a> Search<'a> {
    fn new(mdp: &'a BeliefMdp, settings: &'a Settings, case: Option<&'a DVector<f64>>) -> Self {
        let model = mdp.model();
        let (smallest, largest) = mdp.reward_range();
        let weights: Vec<f64> = (0..=settings.horizon as i32)
            .map(|t| model.discount.powi(t))
            .collect();
        let mut bounds = vec![(0.0, 0.0); weights.len() + 1];
        for t in (0..weights.len()).rev() {
            let (least, most) = bounds[t + 1];
            bounds[t] = (least + weights[t] * smallest, most + weights[t] * largest);
        }
        let actions = 0..model.actions.len();
        let pays = |mode: ModeId, action: ActionId| -> Vec<bool> {
            let rewards = model
                .rewards
                .iter()
                .map(|reward| reward.applies(mode, action));
            rewards
                .chain(model.events.iter().map(|event| event.applies(mode, action)))
                .collect()
        };
        let first_alike = |mode, action| {
            actions
                .clone()
                .find(|&other| pays(mode, other) == pays(mode, action))
                .unwrap_or(action)
        };
        Self {
            mdp,
            settings,
            case,
            actions: model.actions.len(),
            weights,
            bounds,
            outlooks: Vec::new(),
            leads_to: HashMap::new(),
            earns_like: (0..model.modes.len())
                .map(|mode| {
                    actions
                        .clone()
                        .map(|action| first_alike(mode, action))
                        .collect()
                })
                .collect(),
            known: HashMap::new(),
        }
    }

    /// What the best branch that begins with the action collects.
    fn best_branch_from(&mut self, belief: &Belief, action: ActionId) -> f64 {
        let root = self.root(belief);
        let reward = self.reward(&root, action);
        self.take(&root, action, reward, 0, f64::NEG_INFINITY)
    }

    fn root(&mut self, belief: &Belief) -> Expected {
        let certain = Outlook::certain(self.mdp, belief.stratum);
        let outlook = self
            .outlooks
            .iter()
            .position(|known| *known == certain)
            .unwrap_or_else(|| {
                self.outlooks.push(certain);
                self.outlooks.len() - 1
            });
        Expected {
            mode: belief.mode,
            outlook,
            mean: DVector::from_column_slice(&belief.mean),
        }
    }

    fn reward(&self, at: &Expected, action: ActionId) -> f64 {
        self.settings.formulas.reward(
            self.mdp,
            at.mode,
            &self.outlooks[at.outlook],
            &at.mean,
            action,
        )
    }

    /// What the best branch collects that takes an action, whose reward here is known, for one group of steps from step `time`.
    /// Where that is no more than `floor`, any number between the two will do.
    fn take(
        &mut self,
        from: &Expected,
        action: ActionId,
        reward: f64,
        time: usize,
        floor: f64,
    ) -> f64 {
        let mut at = from.clone();
        let mut collected = self.weights[time] * reward;
        let end = time
            .saturating_add(self.settings.group)
            .min(self.settings.horizon + 1);
        for t in time..end {
            if t > time {
                collected += self.weights[t] * self.reward(&at, action);
            }
            match self.advance(&mut at, action) {
                Then::Continue if self.fails(&at) => {
                    let paid = self.mdp.model().episode.failure_reward;
                    return collected + self.weights[t] * paid;
                }
                Then::Continue => {}
                Then::End => return collected,
                Then::Restart => at = self.root(self.mdp.start()),
            }
        }
        if end > self.settings.horizon {
            return collected;
        }
        collected + self.descend(&at, end, floor - collected)
    }

    /// What the best branch from an expected belief collects; where that is no more than `floor`, any number between the two.
    fn descend(&mut self, at: &Expected, time: usize, floor: f64) -> f64 {
        let (least, most) = self.bounds[time];
        if most <= floor {
            return most;
        }
        if !self.within_reach(at) {
            // Not worth a look, and no way out of costs: it counts for the least it can earn.
            return least;
        }
        let key = key(at, time);
        match self.known.get(&key) {
            Some(&Worth::Exactly(value)) => return value,
            Some(&Worth::AtMost(value)) if value <= floor => return value,
            _ => {}
        }
        let mut promising: Vec<(f64, ActionId)> = Vec::with_capacity(self.actions);
        for action in 0..self.actions {
            let alike = self.earns_like[at.mode][action];
            let reward = if alike < action {
                promising[alike].0
            } else {
                self.reward(at, action)
            };
            promising.push((reward, action));
        }
        promising.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut best = f64::NEG_INFINITY;
        for (reward, action) in promising {
            best = best.max(self.take(at, action, reward, time, floor.max(best)));
        }
        let worth = if best > floor {
            Worth::Exactly(best)
        } else {
            Worth::AtMost(best)
        };
        self.known.insert(key, worth);
        best
    }

    /// Moves the expected belief on by one step (Eq. 5.3 and 5.5); the mode follows the event that the expected mean calls for.
    fn advance(&mut self, at: &mut Expected, action: ActionId) -> Then {
        let model = self.mdp.model();
        let level = self.outlooks[at.outlook].level;
        let mut tally = model.tally(at.mode, action);
        let effects = self.mdp.effects(at.mode, level, action);
        let happened = tally.see(effects, at.mean.as_slice());
        let Outcome { mode, then, .. } = happened.unwrap_or_else(|| tally.rest());
        if then != Then::Continue {
            return then;
        }
        let class = self.mdp.class_of(action);
        let mut mean = self.mdp.predicted(level, at.mean.as_slice(), action);
        if let Some(point) = self.case {
            let step = self
                .mdp
                .levels()
                .step(self.outlooks[at.outlook].level, class);
            mean += &step.correction.gain * (&model.sensor.h * (point - &mean));
        }
        *at = Expected {
            mode,
            outlook: self.next_outlook(at.outlook, class),
            mean: self.mdp.confine(mean),
        };
        then
    }

    fn next_outlook(&mut self, from: OutlookId, class: ClassId) -> OutlookId {
        if let Some(&known) = self.leads_to.get(&(from, class)) {
            return known;
        }
        let next = self.settings.formulas.next_outlook(
            self.mdp,
            &self.outlooks[from],
            class,
            self.case.is_some(),
        );
        let id = self
            .outlooks
            .iter()
            .position(|known| *known == next)
            .unwrap_or_else(|| {
                self.outlooks.push(next);
                self.outlooks.len() - 1
            });
        self.leads_to.insert((from, class), id);
        id
    }

    /// Whether the expected mean is where the agent fails: a branch is over there.
    fn fails(&self, at: &Expected) -> bool {
        !self.mdp.model().episode.alive.contains(at.mean.as_slice())
    }

    /// Whether the expected mean is inside the bounds, extended by 2.5 standard deviations of the level (Figure 5.5).
    fn within_reach(&self, at: &Expected) -> bool {
        let model = self.mdp.model();
        let covariance = self.mdp.covariance(self.outlooks[at.outlook].level);
        let inside = |i: usize| {
            let margin = REACH * covariance[(i, i)].sqrt();
            let bounds = model.state[i].bounds;
            bounds.low - margin <= at.mean[i] && at.mean[i] <= bounds.high + margin
        };
        (0..at.mean.len()).all(inside)
    }
}

fn key(at: &Expected, time: usize) -> Key {
    // To the bit: without noise the last digit decides on which side of a border a mean lies.
    let bits = at.mean.iter().map(|value| value.to_bits());
    (time, at.mode, at.outlook, bits.collect())
}
