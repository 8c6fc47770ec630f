//! The shape of a tree: tests and leaves, which are made better in turn, and cut back.
//!
//! With all other tests as they are, what each belief costs on either side of a test is known, and the best place for the test is found by
//! going along each feature once (tree alternating optimisation: M. Carreira-Perpiñán and P. Tavallali, 2018).

use super::collected::{Collected, Members};
use super::cuts::{Cut, Stakes};
use super::growth::LEAST;
use crate::model::ActionId;
use crate::parallel;

/// Times that all tests are gone through, at most.
const PASSES: usize = 8;

/// A pass that saves less than this share of the cost is the last one.
const LITTLE: f64 = 1e-4;

/// A test becomes slanted if that saves this share of all that is at stake in it.
const SLANTED: f64 = 0.02;

/// A place in a tree.
#[derive(Debug, Clone, Copy)]
pub(super) enum Spot {
    /// What to do.
    Leaf(ActionId),
    /// Where to go on: at the first if the feature is less, else at the second.
    Test(Cut, [usize; 2]),
}

/// A tree. It begins at the first spot; spots to which nothing leads any more may be left over.
#[derive(Debug, Clone)]
pub(super) struct Shape {
    pub(super) spots: Vec<Spot>,
    /// Spots at and below which all is where it costs least, each test with the others as they are.
    settled: Vec<bool>,
}

impl Shape {
    pub(super) fn leaf(action: ActionId) -> Self {
        Self {
            spots: vec![Spot::Leaf(action)],
            settled: vec![false],
        }
    }

    /// Makes a leaf a test with two leaves, and says where they are.
    pub(super) fn split(&mut self, spot: usize, cut: Cut, actions: [ActionId; 2]) -> [usize; 2] {
        let ends = [self.spots.len(), self.spots.len() + 1];
        self.spots.extend(actions.map(Spot::Leaf));
        self.spots[spot] = Spot::Test(cut, ends);
        self.settled.extend([false; 2]);
        self.unsettle_above(0, spot);
        ends
    }

    /// What lies below a spot may no longer be where it costs least, other beliefs coming there.
    pub(super) fn unsettle_below(&mut self, spot: usize) {
        self.settled[spot] = false;
        if let Spot::Test(_, ends) = self.spots[spot] {
            ends.into_iter().for_each(|end| self.unsettle_below(end));
        }
    }

    /// Neither may what leads from one spot to another, since it costs something else to go there.
    fn unsettle_above(&mut self, from: usize, spot: usize) -> bool {
        let leads = from == spot
            || match self.spots[from] {
                Spot::Leaf(_) => false,
                Spot::Test(_, ends) => ends.into_iter().any(|end| self.unsettle_above(end, spot)),
            };
        self.settled[from] &= !leads;
        leads
    }

    /// Leaves below a spot.
    pub(super) fn leaves(&self, spot: usize) -> usize {
        match self.spots[spot] {
            Spot::Leaf(_) => 1,
            Spot::Test(_, ends) => ends.iter().map(|end| self.leaves(*end)).sum(),
        }
    }

    /// The leaf of a belief that comes to a spot, and what is done there.
    fn end(&self, collected: &Collected, mut spot: usize, member: u32) -> (usize, ActionId) {
        loop {
            match self.spots[spot] {
                Spot::Leaf(action) => return (spot, action),
                Spot::Test(cut, ends) => {
                    spot = ends[usize::from(!cut.is_below(collected, member))];
                }
            }
        }
    }

    /// What a belief costs that comes to a spot.
    fn cost_of(&self, collected: &Collected, spot: usize, member: u32) -> f64 {
        collected.costs_of(member)[self.end(collected, spot, member).1]
    }

    /// What all beliefs cost.
    pub(super) fn cost(&self, collected: &Collected) -> f64 {
        let members = 0..collected.beliefs.len() as u32;
        members
            .map(|member| self.cost_of(collected, 0, member))
            .sum()
    }

    /// Puts tests and actions where they cost least, one after the other, until little is saved.
    pub(super) fn refine(&mut self, collected: &Collected, all: &Members) {
        let mut cost = self.cost(collected);
        for _ in 0..PASSES {
            self.pass(collected, all);
            let now = self.cost(collected);
            if cost - now <= LITTLE * cost {
                break;
            }
            cost = now;
        }
    }

    /// Puts every test and action once where it costs least.
    pub(super) fn pass(&mut self, collected: &Collected, all: &Members) {
        let least = LEAST * collected.counted(&all[0]);
        if !self.settled[0] {
            self.settle(collected, 0, all.clone(), least);
        }
    }

    /// Puts tests and actions at and below a spot where they cost least, and says whether any was elsewhere.
    fn settle(&mut self, collected: &Collected, spot: usize, members: Members, least: f64) -> bool {
        if members[0].is_empty() || self.settled[spot] {
            return false;
        }
        let is_other = match self.spots[spot] {
            Spot::Leaf(action) => {
                let best = cheapest(&collected.sums(&members[0]));
                self.spots[spot] = Spot::Leaf(best);
                best != action
            }
            Spot::Test(cut, ends) => {
                let best = self.moved(collected, (cut, ends), &members, least);
                if best != cut {
                    self.spots[spot] = Spot::Test(best, ends);
                    self.unsettle_below(spot);
                }
                let parts = collected.parted(members, best);
                let below = ends
                    .into_iter()
                    .zip(parts)
                    .fold(false, |below, (end, members)| {
                        self.settle(collected, end, members, least) | below
                    });
                best != cut || below
            }
        };
        self.settled[spot] = !is_other;
        is_other
    }

    /// The best test with what lies below it as it is: the old one, unless another saves something.
    fn moved(
        &self,
        collected: &Collected,
        (cut, ends): (Cut, [usize; 2]),
        members: &Members,
        least: f64,
    ) -> Cut {
        let mut worse = vec![0.0; collected.beliefs.len()];
        for member in &members[0] {
            let [yes, no] = ends.map(|end| self.cost_of(collected, end, *member));
            worse[*member as usize] = yes - no;
        }
        let below = |member: &&u32| cut.is_below(collected, **member);
        let worse_at = |member: &u32| worse[*member as usize];
        let now: f64 = members[0].iter().filter(below).map(worse_at).sum();
        let all: f64 = members[0].iter().map(|member| worse_at(member).abs()).sum();
        if all <= 0.0 {
            return cut;
        }
        let stakes = Stakes {
            collected,
            members,
            rows: &worse,
            width: 1,
            cost: |below: &[f64], _: &[f64]| below[0],
            least,
        };
        let straight = parallel::map(members.len(), |feature| stakes.straight(feature));
        let mut best = (now - 1e-9 * all, cut);
        for found in straight.into_iter().flatten() {
            if found.0 < best.0 {
                best = found;
            }
        }
        let price = if cut.is_slanted() { 0.0 } else { SLANTED * all };
        match stakes.slanted(Some(cut.along), best.0 - price) {
            Some((sum, slanted)) if sum < best.0 - price => slanted,
            _ => best.1,
        }
    }

    /// Takes away tests until no more leaves than so many are left, and those that save nothing; what is left is put where it costs least.
    pub(super) fn cut_back(&mut self, collected: &Collected, all: &Members, leaves: usize) {
        while self.cut(collected, all, leaves) {
            self.refine(collected, all);
        }
    }

    /// Takes away the test of which a leaf less costs least, if there are more leaves than so many, or it saves nothing.
    pub(super) fn cut(&mut self, collected: &Collected, all: &Members, leaves: usize) -> bool {
        let mut best: Option<(f64, usize, usize)> = None;
        let costs = |&member: &u32| (member, self.cost_of(collected, 0, member));
        let all: Vec<(u32, f64)> = all[0].iter().map(costs).collect();
        self.weigh(collected, 0, &all, &mut |ratio, spot, end| {
            if best.is_none_or(|(least, _, _)| ratio < least) {
                best = Some((ratio, spot, end));
            }
        });
        let gone = best.filter(|(ratio, _, _)| self.leaves(0) > leaves || *ratio <= 0.0);
        if let Some((_, spot, end)) = gone {
            self.spots[spot] = self.spots[end];
            self.unsettle_above(0, spot);
            self.unsettle_below(spot);
        }
        gone.is_some()
    }

    /// Tells of every test what each leaf less would cost if all went on at one of its ends; of beliefs it is known what they cost now.
    fn weigh(
        &self,
        collected: &Collected,
        spot: usize,
        members: &[(u32, f64)],
        tell: &mut dyn FnMut(f64, usize, usize),
    ) {
        let Spot::Test(cut, ends) = self.spots[spot] else {
            return;
        };
        let (yes, no): (Vec<_>, Vec<_>) = members
            .iter()
            .partition(|(member, _)| cut.is_below(collected, *member));
        for (gone, kept, stray) in [(ends[1], ends[0], &no), (ends[0], ends[1], &yes)] {
            let more = |&(member, now): &(u32, f64)| self.cost_of(collected, kept, member) - now;
            let more: f64 = stray.iter().map(more).sum();
            tell(more / self.leaves(gone) as f64, spot, kept);
        }
        self.weigh(collected, ends[0], &yes, tell);
        self.weigh(collected, ends[1], &no, tell);
    }

    /// Beliefs at each leaf, by spot.
    pub(super) fn members(&self, collected: &Collected) -> Vec<Vec<u32>> {
        let mut members = vec![Vec::new(); self.spots.len()];
        for member in 0..collected.beliefs.len() as u32 {
            members[self.end(collected, 0, member).0].push(member);
        }
        members
    }
}

/// The first of the least.
pub(super) fn cheapest(sums: &[f64]) -> ActionId {
    let cheaper = |best: usize, action: usize| match sums[action] < sums[best] {
        true => action,
        false => best,
    };
    (0..sums.len()).fold(0, cheaper)
}
