//! What the length of an episode has to do with a plan.
//!
//! Value iteration plans for ever. Where what comes after the end of an episode counts for next to nothing, that is all there is to it.
//! Otherwise the plan is looked at over one episode, backwards from its end: what its own actions earn, and what the best would. If the
//! difference matters, the plan is made anew with strata that tell the time, so that it may do something else near the end; if not, the
//! actions stay as they are and only the promise is that of the episode.

use super::SOLVER;
use super::grid_policy::{Average, Backup, GridPolicy, iterate};
use crate::belief::BeliefMdp;
use crate::error::{Error, Result};
use crate::model::validate::MOST_LEVELS;
use crate::policy::first_best;
use crate::progress::Progress;
use crate::solve::grid::Settings;

/// Less than this share of the value at the start is nothing, wherever it is lost or forgotten.
const NOTHING: f64 = 1e-3;

/// What acting as if there were no end may cost, as a share of what can be earned.
const MATTERS: f64 = 5e-3;

/// Plans for episodes of the model's length.
pub(super) fn plan(
    mdp: &BeliefMdp,
    settings: &Settings,
    observer: &dyn Progress,
) -> Result<GridPolicy> {
    let (model, length) = (mdp.model(), mdp.model().episode.length);
    if model.discount >= 1.0 {
        return iterate(&telling_time(mdp)?, settings, observer);
    }
    let mut policy = iterate(mdp, settings, observer)?;
    let scale = policy.start_value.abs().max(f64::MIN_POSITIVE);
    if policy.beyond(length) <= NOTHING * scale {
        return Ok(policy);
    }
    let Some((own, best)) = policy.over_episode(length, settings) else {
        policy.remarks.push(format!(
            "horizon: the plan is for ever and an episode has {length} steps; looking at that takes more than the {} MiB allowed (memory)",
            settings.memory
        ));
        return Ok(policy);
    };
    let scale = best.abs().max(own.abs());
    if best - own <= MATTERS * scale || model.restarts() {
        if best - own > MATTERS * scale {
            policy.remarks.push(format!(
                "horizon: acts as if an episode of {length} steps had no end, which earns {own:.4} where {best:.4} can be had; \
                 it starts anew now and then, so that how much is left is not known"
            ));
        }
        policy.promised = Some(own);
        return Ok(policy);
    }
    let why = match telling_time(mdp).and_then(|told| iterate(&told, settings, observer)) {
        Err(Error::Unsupported { .. }) if length > MOST_LEVELS => {
            format!("no plan tells the time of more than {MOST_LEVELS} steps")
        }
        Err(Error::TooManyLevels { levels, .. }) => {
            format!("levels that tell the time are more than the {levels} there is room for")
        }
        Err(Error::TooLarge { mebibytes, .. } | Error::OutOfMemory { mebibytes, .. }) => format!(
            "telling the time takes {mebibytes} MiB, more than the {} MiB allowed (memory)",
            settings.memory
        ),
        told => return told,
    };
    policy.remarks.push(format!(
        "horizon: acts as if an episode of {length} steps had no end, which earns {own:.4} where {best:.4} can be had; {why}"
    ));
    policy.promised = Some(own);
    Ok(policy)
}

/// The decision process whose levels tell the time up to the end of an episode.
fn telling_time(mdp: &BeliefMdp) -> Result<BeliefMdp> {
    let length = mdp.model().episode.length;
    if length > MOST_LEVELS {
        return Err(Error::Unsupported {
            solver: SOLVER,
            model: mdp.model().name.clone(),
            reason: format!(
                "its plan has to tell the time of an episode of {length} steps, and can up to {MOST_LEVELS}; give a shorter `episode.length`, or a discount below 1"
            ),
        });
    }
    let told = BeliefMdp::with_horizon(mdp.model(), length);
    told.check()?;
    Ok(told)
}

impl GridPolicy {
    /// What can come after so many steps, at most, seen from the start.
    fn beyond(&self, length: usize) -> f64 {
        let values = self.values.iter().flatten();
        let largest = values.fold(0.0_f64, |largest, value| largest.max(value.abs()));
        let ending = match self.mdp().model().cost {
            None => 0.0,
            Some(_) => (0..self.mdp().strata())
                .flat_map(|stratum| self.ending(stratum))
                .fold(0.0_f64, |largest, value| largest.max(value.abs())),
        };
        let discount = self.mdp().model().discount;
        discount.powi(length.min(i32::MAX as usize) as i32) * (largest + ending)
    }

    /// What the plan's own actions earn in an episode of so many steps from the start, and what the best earn; `None` where that takes
    /// more memory than allowed.
    fn over_episode(&mut self, length: usize, settings: &Settings) -> Option<(f64, f64)> {
        let actions = self.mdp().model().actions.len();
        let bytes = self.values.len() * self.grid().len() * actions * super::extent::LOOK_UP;
        if (bytes >> 20) as u64 > settings.memory {
            return None;
        }
        let strata: Vec<usize> = (0..self.mdp().strata()).collect();
        let (smoothers, backups) = (self.smoothers(&strata), self.backups(&strata));
        let q = |policy: &Self, backup: &Backup, point: usize| -> Vec<f64> {
            let entries = backup.entries[point].iter();
            entries.map(|entry| policy.q(entry)).collect()
        };
        let chosen: Vec<Vec<usize>> = backups
            .iter()
            .map(|backup| {
                crate::parallel::map(backup.entries.len(), |point| {
                    first_best(&q(self, backup, point))
                })
            })
            .collect();
        let kept = (self.values.clone(), self.expected.clone(), self.start_value);
        let target = settings.tolerance * (1.0 - self.mdp().model().discount);
        let own = self.sweep_back(length, target, &smoothers, |policy| {
            let pairs = backups.iter().zip(&chosen);
            let follow = |(backup, chosen): (&Backup, &Vec<usize>)| {
                crate::parallel::map(chosen.len(), |point| {
                    policy.q(&backup.entries[point][chosen[point]])
                })
            };
            pairs.map(|pair| (pair.0, follow(pair))).collect()
        });
        let best = self.sweep_back(length, target, &smoothers, |policy| {
            let back_up = |backup| (backup, policy.back_up(backup));
            backups.iter().map(back_up).collect()
        });
        (self.values, self.expected, self.start_value) = kept;
        Some((own, best))
    }

    /// Value of the start, so many steps before the end, or as soon as a step changes no value by more than `target`.
    fn sweep_back<'a>(
        &mut self,
        steps: usize,
        target: f64,
        smoothers: &[Vec<Average>],
        step: impl Fn(&Self) -> Vec<(&'a Backup, Vec<f64>)>,
    ) -> f64 {
        let strata = self.mdp().strata();
        for stratum in 0..strata {
            let worth = self.ending(stratum);
            for mode in 0..self.mdp().model().modes.len() {
                let index = self.value_index(mode, stratum);
                self.values[index].clone_from(&worth);
            }
        }
        for _ in 0..steps {
            self.start_value = self.value_at_start();
            for (stratum, smoothers) in smoothers.iter().enumerate() {
                self.smooth(stratum, smoothers);
            }
            let mut change = 0.0_f64;
            for (backup, fresh) in step(self) {
                let values = &mut self.values[backup.mode * strata + backup.stratum];
                let pairs = fresh.iter().zip(values.iter());
                change = pairs.fold(change, |change, (new, old)| change.max((new - old).abs()));
                *values = fresh;
            }
            if change <= target {
                break;
            }
        }
        self.value_at_start()
    }
}
