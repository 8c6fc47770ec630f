//! Beliefs kept in full: whatever it takes, not only a stratum and a mean. What planners ask of those who keep them.

use crate::model::ActionId;

use super::Reading;

/// What a belief kept in full is read as.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Moments {
    /// Mean of the state, length `n`.
    pub mean: Vec<f64>,
    /// Covariance of the state, row by row, `n x n`.
    pub covariance: Vec<f64>,
    /// Probability of each mode; they sum to 1.
    pub weights: Vec<f64>,
    /// Step of the episode at which it is held, from 0. Who writes the other moments does not know it, and leaves it.
    pub step: usize,
}

/// What an action is expected to pay and to do to an episode.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Acted {
    /// Expected reward, of failing included.
    pub reward: f64,
    /// Probability that the episode is over.
    pub ended: f64,
    /// Probability that it starts afresh. The episode goes on with what is left.
    pub restarted: f64,
}

/// One reading that may come.
#[derive(Debug, Clone, PartialEq)]
pub enum Sensed {
    /// Numbers, length `m`; where modes are seen, the number of the mode beside them.
    Values(Vec<f64>),
    /// A signal.
    Symbol(u32),
    /// Nothing.
    Nothing,
}

impl Sensed {
    /// As trackers take it.
    pub fn reading(&self) -> Reading<'_> {
        match self {
            Self::Values(values) => Reading::Values(values),
            Self::Symbol(symbol) => Reading::Symbol(*symbol),
            Self::Nothing => Reading::Nothing,
        }
    }
}

/// Keeps beliefs of some kind in full. Everything about it is the same for the same arguments, whatever was asked before.
pub trait Keeping: Send + Sync {
    /// A belief in full.
    type Full: Clone + Send + Sync;

    /// The same way of keeping beliefs, and coarser: what becomes of a belief of which little more than its moments is known is found faster
    /// by it. `None` where it is as fast already.
    fn coarse(&self) -> Option<Self>
    where
        Self: Sized,
    {
        None
    }

    /// Whether a step of a belief takes little time: some ten microseconds.
    fn is_light(&self) -> bool {
        false
    }

    /// Number of actions.
    fn actions(&self) -> usize;

    /// What is believed at the start.
    fn start(&self) -> Self::Full;

    /// Takes an action at a step of the episode: the belief becomes what is believed of state and mode once it has moved and events
    /// have happened, given that the episode goes on, before anything is sensed. If it is certain not to go on, the belief is of no use.
    fn act(&self, full: &mut Self::Full, action: ActionId, step: usize) -> Acted;

    /// The same for who does not ask what it pays or ends.
    fn go_on(&self, full: &mut Self::Full, action: ActionId, step: usize) {
        self.act(full, action, step);
    }

    /// Readings that may come after an action at a step, of which `full` is the result, with probabilities that sum to 1: every signal of
    /// a discrete sensor, about `most` evenly spread readings otherwise, and that there is none where it may be missing.
    fn readings(
        &self,
        full: &Self::Full,
        action: ActionId,
        step: usize,
        most: usize,
    ) -> Vec<(f64, Sensed)>;

    /// Takes in what was sensed after an action at a step, of which `full` is the result. A reading that could not come leaves what was
    /// believed.
    fn sense(&self, full: &mut Self::Full, action: ActionId, step: usize, reading: Reading<'_>);

    /// Writes what a belief is read as.
    fn moments(&self, full: &Self::Full, moments: &mut Moments);

    /// A belief with these moments: one Gaussian a mode, all with that mean and covariance.
    fn with_moments(&self, moments: &Moments) -> Self::Full;

    /// The same belief with its mean elsewhere (length `n`), as far as a state can be there, and as far as beliefs are kept as fine as it.
    fn moved_to(&self, full: &Self::Full, mean: &[f64]) -> Self::Full;
}
