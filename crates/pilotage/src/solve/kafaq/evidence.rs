//! Evidence for one action over another: temporal-difference targets by neighbourhood and action, and what they prove.

use serde::{Deserialize, Serialize};

use crate::model::ActionId;

/// Fewer targets than this say nothing about their variance.
const ENOUGH: f64 = 4.0;

/// Count, sum and sum of squares of a sample whose older part may have faded.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(from = "[f64; 3]", into = "[f64; 3]")]
struct Sample {
    count: f64,
    sum: f64,
    squares: f64,
}

impl From<[f64; 3]> for Sample {
    fn from([count, sum, squares]: [f64; 3]) -> Self {
        Self {
            count,
            sum,
            squares,
        }
    }
}

impl From<Sample> for [f64; 3] {
    fn from(sample: Sample) -> Self {
        [sample.count, sample.sum, sample.squares]
    }
}

impl Sample {
    fn mean(&self) -> f64 {
        self.sum / self.count
    }

    fn variance_of_mean(&self) -> f64 {
        let spread = (self.squares / self.count - self.mean().powi(2)).max(0.0);
        spread / (self.count - 1.0)
    }
}

/// A gain in return, summed over visits, with its variance.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Gain {
    pub sum: f64,
    pub variance: f64,
}

impl Gain {
    /// Standard error.
    pub(super) fn error(&self) -> f64 {
        self.variance.max(0.0).sqrt()
    }

    /// Lower confidence limit, `z` standard errors below.
    pub(super) fn surely(&self, z: f64) -> f64 {
        self.sum - z * self.error()
    }
}

/// Targets of one memory by cell and action, and the visits of its cells.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Evidence {
    actions: usize,
    targets: Vec<Sample>,
    visits: Vec<f64>,
}

impl Evidence {
    pub(super) fn new(cells: usize, actions: usize) -> Self {
        Self {
            actions,
            targets: vec![Sample::default(); cells * actions],
            visits: vec![0.0; cells],
        }
    }

    fn fits(&self, cells: usize, actions: usize) -> bool {
        let counted = |count: f64| count >= 0.0;
        self.actions == actions
            && self.targets.len() == cells * actions
            && self.visits.len() == cells
            && self.targets.iter().all(|sample| counted(sample.count))
            && self.visits.iter().copied().all(counted)
    }

    fn add(&mut self, cell: usize, action: ActionId, target: f64) {
        let sample = &mut self.targets[cell * self.actions + action];
        sample.count += 1.0;
        sample.sum += target;
        sample.squares += target * target;
        self.visits[cell] += 1.0;
    }

    fn fade(&mut self, factor: f64) {
        for sample in &mut self.targets {
            sample.count *= factor;
            sample.sum *= factor;
            sample.squares *= factor;
        }
        self.visits.iter_mut().for_each(|visits| *visits *= factor);
    }

    pub(super) fn actions(&self) -> usize {
        self.actions
    }

    /// Visits of a cell.
    pub(super) fn visits(&self, cell: usize) -> f64 {
        self.visits[cell]
    }

    /// Visits of all cells.
    pub(super) fn total(&self) -> f64 {
        self.visits.iter().sum()
    }

    /// Mean target of an action in a cell, where there are enough.
    pub(super) fn mean(&self, cell: usize, action: ActionId) -> Option<f64> {
        let sample = &self.targets[cell * self.actions + action];
        (sample.count >= ENOUGH).then(|| sample.mean())
    }

    /// What taking `new` for `old` in a cell gains over all visits there. Nothing is claimed without enough targets of both.
    pub(super) fn gain(&self, cell: usize, new: ActionId, old: ActionId) -> Gain {
        let [better, worse] = [new, old].map(|action| &self.targets[cell * self.actions + action]);
        if new == old || better.count < ENOUGH || worse.count < ENOUGH {
            return Gain::default();
        }
        let weight = self.visits[cell];
        Gain {
            sum: weight * (better.mean() - worse.mean()),
            variance: weight * weight * (better.variance_of_mean() + worse.variance_of_mean()),
        }
    }

    /// What one assignment of actions to cells gains over another.
    pub(super) fn compare(&self, new: &[ActionId], old: &[ActionId]) -> Gain {
        let changed = (0..new.len()).filter(|&cell| new[cell] != old[cell]);
        changed.fold(Gain::default(), |total, cell| {
            let gain = self.gain(cell, new[cell], old[cell]);
            Gain {
                sum: total.sum + gain.sum,
                variance: total.variance + gain.variance,
            }
        })
    }
}

/// Evidence in two halves that share no target, each by the toss of a coin: what one proposes, the other tests, so that the test
/// knows nothing of the search that led to the proposal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Halves {
    pub all: Evidence,
    pub half: [Evidence; 2],
}

impl Halves {
    pub(super) fn new(cells: usize, actions: usize) -> Self {
        let none = Evidence::new(cells, actions);
        Self {
            all: none.clone(),
            half: [none.clone(), none],
        }
    }

    /// Whether it is evidence of so many cells and actions.
    pub(super) fn fits(&self, cells: usize, actions: usize) -> bool {
        let [first, second] = &self.half;
        [&self.all, first, second]
            .iter()
            .all(|evidence| evidence.fits(cells, actions))
    }

    pub(super) fn add(&mut self, coin: bool, cell: usize, action: ActionId, target: f64) {
        self.all.add(cell, action, target);
        self.half[usize::from(coin)].add(cell, action, target);
    }

    pub(super) fn fade(&mut self, factor: f64) {
        let [first, second] = &mut self.half;
        for evidence in [&mut self.all, first, second] {
            evidence.fade(factor);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gain_is_the_weighted_difference_of_means_with_welch_variance() {
        let mut evidence = Evidence::new(1, 2);
        for target in [1.0, 2.0, 3.0, 4.0] {
            evidence.add(0, 0, target);
        }
        for target in [5.0, 5.0, 9.0] {
            evidence.add(0, 1, target);
        }
        assert_eq!(
            evidence.gain(0, 1, 0),
            Gain::default(),
            "three targets are too few"
        );
        evidence.add(0, 1, 9.0);
        let gain = evidence.gain(0, 1, 0);
        assert_eq!(gain.sum, 8.0 * (7.0 - 2.5));
        // Sample variances 5/3 and 16/3, four of each.
        assert!((gain.variance - 64.0 * (5.0 / 3.0 + 16.0 / 3.0) / 4.0).abs() < 1e-9);
        assert_eq!(evidence.gain(0, 0, 1).sum, -gain.sum);
    }

    #[test]
    fn halves_share_no_target_and_fade_alike() {
        let mut halves = Halves::new(2, 1);
        for i in 0..10 {
            halves.add(i % 3 == 0, i % 2, 0, i as f64);
        }
        let total = |evidence: &Evidence| evidence.total();
        assert_eq!(
            (
                total(&halves.all),
                total(&halves.half[0]),
                total(&halves.half[1])
            ),
            (10.0, 6.0, 4.0)
        );
        halves.fade(0.5);
        assert_eq!(
            (
                total(&halves.all),
                total(&halves.half[0]),
                total(&halves.half[1])
            ),
            (5.0, 3.0, 2.0)
        );
        assert_eq!(halves.all.mean(0, 0), None);
    }
}
