//! What the mode of a belief is, where it is what an agent remembers rather than what its belief says.

use super::filter::Belief;
use super::recall::Recall;
use crate::model::{ActionId, ModeId, Switch, When};

/// How the mode of a belief follows from what was done and where that has led.
#[derive(Debug, Clone, PartialEq)]
pub enum Memory {
    /// By the first of these changes that happens; without any it stays as it is.
    Switches(Vec<Switch>),
    /// By the clusters that beliefs come through.
    Recall(Recall),
}

impl Memory {
    /// The mode afterwards of a change that happens before a step, at the belief as it is then.
    pub(super) fn before(&self, belief: &Belief, action: ActionId, time: usize) -> Option<ModeId> {
        self.switch(When::Before, belief, action, time)
    }

    /// The mode after a step: what [`Memory::before`] has found, or else what follows from the belief, which still has the old mode, and
    /// its [place](super::Updater::place) among clusters.
    pub(super) fn after(
        &self,
        before: Option<ModeId>,
        belief: &Belief,
        (action, time): (ActionId, usize),
        place: &[f64],
    ) -> ModeId {
        if let Self::Recall(recall) = self {
            return recall.next(belief.mode, action, place);
        }
        let becomes = before.or_else(|| self.switch(When::After, belief, action, time));
        becomes.unwrap_or(belief.mode)
    }

    /// The mode afterwards of the first change that happens.
    fn switch(&self, when: When, belief: &Belief, action: ActionId, time: usize) -> Option<ModeId> {
        let Self::Switches(switches) = self else {
            return None;
        };
        let doing = (belief.mode, action);
        let mut switches = switches.iter();
        let switch = switches.find(|switch| switch.happens(when, doing, time, &belief.mean));
        switch.map(|switch| switch.becomes)
    }
}
