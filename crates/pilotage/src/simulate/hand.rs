//! An agent that follows a rule of thumb.

use super::Agent;
use crate::belief::{Belief, BeliefSpace, Held, Reading, Tracker, Tracking};
use crate::model::ActionId;
use crate::policy::{Asked, Feature};
use crate::scenario::HandRule;

/// Follows a rule of thumb on the belief that a tracker keeps. Standard deviations and probabilities of modes are those of the belief itself
/// where it is kept in full, else those of its stratum.
pub struct HandAgent<'a> {
    tracker: Box<dyn Tracker + 'a>,
    rule: &'a HandRule,
    told: &'a [Told],
    step: usize,
}

/// What a rule is told of the beliefs of a stratum, means apart.
#[derive(Debug, Clone, PartialEq)]
pub struct Told {
    /// Standard deviations, length `n`.
    pub deviations: Vec<f64>,
    /// Probability of each mode; `None` where one is believed.
    pub weights: Option<Vec<f64>>,
    /// Number of modes.
    pub modes: usize,
}

impl Told {
    /// What is told of every stratum of a space.
    pub fn of(space: &dyn BeliefSpace) -> Vec<Self> {
        let updater = space.updater();
        let codebook = updater.codebook();
        let of = |stratum| {
            let variances = space.covariance(stratum).diagonal();
            Self {
                deviations: variances.iter().map(|v| v.max(0.0).sqrt()).collect(),
                weights: codebook.map(|codebook| codebook.stratum(stratum).weights.clone()),
                modes: space.model().modes.len(),
            }
        };
        (0..space.strata()).map(of).collect()
    }
}

impl<'a> HandAgent<'a> {
    /// The agent at the start of an episode; `told` is what [`Told::of`] says of the space of the beliefs.
    pub fn new(tracking: &'a dyn Tracking, rule: &'a HandRule, told: &'a [Told]) -> Self {
        Self {
            tracker: tracking.tracker(),
            rule,
            told,
            step: 0,
        }
    }
}

impl Agent for HandAgent<'_> {
    fn reset(&mut self) {
        self.tracker.reset();
        self.step = 0;
    }

    fn act(&mut self) -> ActionId {
        if let Some(moments) = self.tracker.held().and_then(Held::moments) {
            let n = moments.mean.len();
            let deviation = |i: usize| moments.feature(Feature::Deviation(i));
            let deviations: Vec<f64> = (0..n).map(deviation).collect();
            let weights = match moments.weights.len() {
                1 => &[][..],
                _ => &moments.weights,
            };
            return self
                .rule
                .action(&moments.mean, &deviations, weights, self.step);
        }
        let belief = self.tracker.belief();
        let told = &self.told[belief.stratum];
        let believed;
        let weights = match (&told.weights, told.modes) {
            (_, 1) => &[][..],
            (Some(weights), _) => weights,
            (None, modes) => {
                believed = one_hot(belief.mode, modes);
                &believed
            }
        };
        self.rule
            .action(&belief.mean, &told.deviations, weights, self.step)
    }

    fn observe(&mut self, action: ActionId, reading: Reading<'_>) {
        self.tracker.update(action, reading);
        self.step += 1;
    }

    fn belief(&self) -> Option<&Belief> {
        Some(self.tracker.belief())
    }

    fn held(&self) -> Option<&Held> {
        self.tracker.held()
    }
}

fn one_hot(mode: usize, modes: usize) -> Vec<f64> {
    (0..modes).map(|other| f64::from(other == mode)).collect()
}
