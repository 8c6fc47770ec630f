//! Belief regions (thesis 4.2.4): boxes of neighbourhoods with an action each, and how evidence extends, splits and merges them.

use serde::{Deserialize, Serialize};

use super::evidence::{Evidence, Gain, Halves};
use super::lattice::{CellBox, Lattice};
use super::settings::Settings;
use crate::model::ActionId;
use crate::solve::learn::critical;

/// Rounds of revision at most; each only changes what evidence calls for.
const ROUNDS: usize = 20;

/// A belief region.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Region {
    pub cells: CellBox,
    pub action: ActionId,
}

impl Region {
    /// Whether it is one of this lattice and so many actions.
    pub(super) fn fits(&self, lattice: &Lattice, actions: usize) -> bool {
        lattice.holds(&self.cells) && self.action < actions
    }
}

/// The action that regions give every cell (FindCurrentSegment): that of the smallest box, or else of the nearest.
pub(super) fn actions_by_cell(lattice: &Lattice, regions: &[Region]) -> Vec<ActionId> {
    let mut order: Vec<&Region> = regions.iter().collect();
    order.sort_by_key(|region| std::cmp::Reverse(region.cells.volume()));
    let mut actions = vec![None; lattice.len()];
    for region in order {
        for cell in lattice.cells(&region.cells) {
            actions[cell] = Some(region.action);
        }
    }
    let nearest = |cell: usize| {
        let distance = |region: &&Region| lattice.distance(cell, &region.cells);
        let nearest = regions
            .iter()
            .min_by(|a, b| distance(a).total_cmp(&distance(b)));
        nearest.map_or(0, |region| region.action)
    };
    let actions = actions.into_iter().enumerate();
    actions
        .map(|(cell, action)| action.unwrap_or_else(|| nearest(cell)))
        .collect()
}

/// Revises regions on evidence.
#[derive(Debug)]
pub(super) struct Reviser<'a> {
    lattice: &'a Lattice,
    /// Standard errors that a proposed split has to be confirmed by.
    split: f64,
    /// Standard errors that other changes rest on.
    merge: f64,
    /// What a region has to gain per visit of the whole memory.
    worth: f64,
}

impl<'a> Reviser<'a> {
    /// A reviser to whom a region has to be worth `worth` a visit.
    pub(super) fn new(lattice: &'a Lattice, settings: &Settings, worth: f64) -> Self {
        Self {
            lattice,
            split: critical(settings.split_error),
            merge: critical(settings.merge_error),
            worth,
        }
    }

    /// Best action, split, extend and merge until nothing changes; returns the visits whose action has changed.
    pub(super) fn revise(&self, evidence: &Halves, regions: &mut Vec<Region>) -> f64 {
        if evidence.all.total() == 0.0 {
            return 0.0;
        }
        let before = self.actions(regions);
        for _ in 0..ROUNDS {
            let mut changed = self.take_best_actions(&evidence.all, regions);
            changed |= self.split_region(evidence, regions);
            changed |= self.extend_regions(&evidence.all, regions);
            changed |= self.merge_regions(&evidence.all, regions);
            if !changed {
                break;
            }
        }
        let after = self.actions(regions);
        let changed = (0..after.len()).filter(|&cell| after[cell] != before[cell]);
        changed.map(|cell| evidence.all.visits(cell)).sum()
    }

    /// Splits until no split is confirmed, then merges; returns whether anything changed. For levels that inherit their regions.
    pub(super) fn refine(&self, evidence: &Halves, regions: &mut Vec<Region>) -> bool {
        let splits = (0..ROUNDS)
            .take_while(|_| self.split_region(evidence, regions))
            .count();
        if splits > 0 {
            self.merge_regions(&evidence.all, regions);
        }
        splits > 0
    }

    fn actions(&self, regions: &[Region]) -> Vec<ActionId> {
        actions_by_cell(self.lattice, regions)
    }

    fn gain(&self, evidence: &Evidence, new: &[Region], old: &[ActionId]) -> Gain {
        evidence.compare(&self.actions(new), old)
    }

    /// Gives every region the action that is surely the best for it as a whole.
    fn take_best_actions(&self, evidence: &Evidence, regions: &mut [Region]) -> bool {
        let mut changed = false;
        for i in 0..regions.len() {
            let old = self.actions(regions);
            let current = regions[i].action;
            let mut best = (0.0, current);
            for action in (0..evidence.actions()).filter(|&action| action != current) {
                regions[i].action = action;
                let surely = self.gain(evidence, regions, &old).surely(self.merge);
                if surely > best.0 {
                    best = (surely, action);
                }
            }
            regions[i].action = best.1;
            changed |= best.1 != current;
        }
        changed
    }

    /// Splits off the box that surely gains most on one half of the evidence, if the other half confirms it.
    fn split_region(&self, evidence: &Halves, regions: &mut Vec<Region>) -> bool {
        let old = self.actions(regions);
        let [first, second] = &evidence.half;
        for (proposer, tester) in [(first, second), (second, first)] {
            let Some(part) = self.propose_split(proposer, regions, &old) else {
                continue;
            };
            regions.push(part);
            let gain = self.gain(tester, regions, &old);
            if gain.sum > self.split * gain.error() && gain.sum > self.worth * tester.total() {
                return true;
            }
            regions.pop();
        }
        false
    }

    /// The box and action with the largest sure gain. A new box only rules cells that no smaller one holds.
    fn propose_split(
        &self,
        evidence: &Evidence,
        regions: &[Region],
        old: &[ActionId],
    ) -> Option<Region> {
        let mut holder = vec![usize::MAX; old.len()];
        for region in regions {
            let volume = region.cells.volume();
            for cell in self.lattice.cells(&region.cells) {
                holder[cell] = holder[cell].min(volume);
            }
        }
        let mut volumes = holder.clone();
        volumes.sort_unstable();
        volumes.dedup();
        let mut best: (f64, Option<Region>) = (0.0, None);
        for action in 0..evidence.actions() {
            let gains: Vec<Gain> = (0..old.len())
                .map(|cell| evidence.gain(cell, action, old[cell]))
                .collect();
            // By the smallest holder that a box may overrule: sums of gain and of variance.
            let sums: Vec<_> = volumes
                .iter()
                .map(|&least| {
                    let rules = |cell: usize| f64::from(holder[cell] >= least);
                    (
                        self.lattice.sums(|cell| rules(cell) * gains[cell].sum),
                        self.lattice.sums(|cell| rules(cell) * gains[cell].variance),
                    )
                })
                .collect();
            for (cells, volume) in self.lattice.boxes() {
                let Some(least) = volumes.iter().position(|holder| holder > volume) else {
                    continue;
                };
                let gain = Gain {
                    sum: sums[least].0.over(cells),
                    variance: sums[least].1.over(cells),
                };
                let surely = gain.surely(self.merge);
                // Boxes that differ by cells without evidence are equal but for rounding; the first is kept.
                if surely > best.0 * (1.0 + 1e-9) + 1e-12 {
                    best = (
                        surely,
                        Some(Region {
                            cells: cells.clone(),
                            action,
                        }),
                    );
                }
            }
        }
        best.1
    }

    /// Moves the faces of a region, a neighbourhood at a time, where its action surely beats what rules there. A region of all
    /// cells stays, so that everything has an action.
    fn extend_regions(&self, evidence: &Evidence, regions: &mut [Region]) -> bool {
        let mut changed = false;
        for i in 0..regions.len() {
            for variable in 0..regions[i].cells.low.len() {
                for face in [Face::LowOut, Face::LowIn, Face::HighOut, Face::HighIn] {
                    let old = self.actions(regions);
                    let kept = regions[i].cells.clone();
                    let count = self.lattice.count(variable);
                    if !face.shift(&mut regions[i].cells, variable, count) {
                        continue;
                    }
                    let gain = self.gain(evidence, regions, &old);
                    if self.holds_all(regions) && gain.surely(self.merge) > 0.0 {
                        changed = true;
                    } else {
                        regions[i].cells = kept;
                    }
                }
            }
        }
        changed
    }

    fn holds_all(&self, regions: &[Region]) -> bool {
        regions
            .iter()
            .any(|region| region.cells.volume() == self.lattice.len())
    }

    /// Drops a region, or joins two of the same action, as long as there is no evidence that this loses more than it is worth; the
    /// smallest loss first.
    fn merge_regions(&self, evidence: &Evidence, regions: &mut Vec<Region>) -> bool {
        let floor = self.worth * evidence.total();
        let mut changed = false;
        loop {
            let old = self.actions(regions);
            let candidates = self.simpler(regions).into_iter().filter_map(|simpler| {
                let gain = self.gain(evidence, &simpler, &old);
                let loss = -gain.sum;
                (loss <= self.merge * gain.error() || loss <= 0.5 * floor)
                    .then_some((loss, simpler))
            });
            let Some((_, simpler)) = candidates.min_by(|a, b| a.0.total_cmp(&b.0)) else {
                return changed;
            };
            *regions = simpler;
            changed = true;
        }
    }

    /// All ways to have one region less.
    fn simpler(&self, regions: &[Region]) -> Vec<Vec<Region>> {
        let mut simpler = Vec::new();
        for (i, region) in regions.iter().enumerate() {
            let mut dropped = regions.to_vec();
            dropped.remove(i);
            for (j, other) in regions[..i].iter().enumerate() {
                if other.action == region.action {
                    let mut joined = dropped.clone();
                    joined[j].cells = region.cells.hull(&other.cells);
                    simpler.push(joined);
                }
            }
            simpler.push(dropped);
        }
        simpler.retain(|regions| self.holds_all(regions));
        simpler
    }
}

/// A way to move a face of a box by one cell.
#[derive(Debug, Clone, Copy)]
enum Face {
    LowOut,
    LowIn,
    HighOut,
    HighIn,
}

impl Face {
    /// Moves the face if there is room.
    fn shift(self, cells: &mut CellBox, variable: usize, count: usize) -> bool {
        let (low, high) = (&mut cells.low[variable], &mut cells.high[variable]);
        match self {
            Self::LowOut if *low > 0 => *low -= 1,
            Self::LowIn if low < high => *low += 1,
            Self::HighOut if *high + 1 < count => *high += 1,
            Self::HighIn if low < high => *high -= 1,
            _ => return false,
        }
        true
    }
}
