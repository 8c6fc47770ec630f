//! A tree grows, a test at a time, where that saves most for each leaf it adds.
//!
//! One test alone may save nothing where two of them save much: to stop only where one is near *and* sure, no question about either is
//! of use by itself. So growth looks two tests ahead, at coarse cuts; where exactly a test lies is found afterwards ([`super::shape`]).

use super::collected::{Collected, Members};
use super::cuts::{Along, Cut, Stakes, add};
use super::shape::{Shape, cheapest};
use crate::parallel;

/// Cuts along a feature at which two tests are looked at together.
const CUTS: usize = 24;

/// Either side of a test has at least this share of all weight.
pub(super) const LEAST: f64 = 1e-3;

/// What saves less than this share of a leaf's cost saves nothing.
const NOTHING: f64 = 1e-9;

/// A slanted test saves so many times as much as another, since it takes longer to read.
const SLANTED: f64 = 1.1;

/// A leaf of a tree as it grows, with the test that it would be given.
struct Bud {
    spot: usize,
    members: Members,
    best: Option<(Cut, f64)>,
}

/// A tree as it grows.
pub(super) struct Growth<'a> {
    collected: &'a Collected,
    least: f64,
    /// Whether tests may be slanted.
    slanted: bool,
    buds: Vec<Bud>,
    shape: Shape,
}

impl<'a> Growth<'a> {
    /// Trees of one leaf, to which all beliefs come: one that grows straight tests alone, and one that grows slanted ones too. What saves most
    /// at first is not always what saves most in the end.
    pub(super) fn straight_and_slanted(collected: &'a Collected, members: &Members) -> [Self; 2] {
        [false, true].map(|slanted| Self::new(collected, members.clone(), slanted))
    }

    fn new(collected: &'a Collected, members: Members, slanted: bool) -> Self {
        let first = members.first().map_or(&[][..], Vec::as_slice);
        let shape = Shape::leaf(cheapest(&collected.sums(first)));
        let mut growth = Self {
            least: LEAST * collected.counted(first),
            collected,
            slanted,
            buds: Vec::new(),
            shape,
        };
        growth.sprout(0, members);
        growth
    }

    /// The tree, grown until it has so many leaves, or nothing is saved by more.
    pub(super) fn to(&mut self, leaves: usize) -> &Shape {
        while self.buds.len() < leaves {
            let promise = |bud: &Bud| bud.best.map_or(0.0, |(_, saved)| saved);
            let most = (0..self.buds.len()).max_by(|&a, &b| {
                promise(&self.buds[a])
                    .total_cmp(&promise(&self.buds[b]))
                    .then(b.cmp(&a))
            });
            let Some((most, (cut, _))) = most.and_then(|bud| Some((bud, self.buds[bud].best?)))
            else {
                break;
            };
            let bud = self.buds.swap_remove(most);
            let parts = self.collected.parted(bud.members, cut);
            let actions = [0, 1].map(|side: usize| cheapest(&self.collected.sums(&parts[side][0])));
            let ends = self.shape.split(bud.spot, cut, actions);
            for (end, members) in ends.into_iter().zip(parts) {
                self.sprout(end, members);
            }
        }
        &self.shape
    }

    fn sprout(&mut self, spot: usize, members: Members) {
        let best = self.best(&members);
        self.buds.push(Bud {
            spot,
            members,
            best,
        });
    }

    /// The test to begin with, and what it saves for each leaf that is added.
    fn best(&self, members: &Members) -> Option<(Cut, f64)> {
        let first = members.first()?;
        let sums = self.collected.sums(first);
        let cost = sums[cheapest(&sums)];
        if cost <= 0.0 || first.len() < 2 {
            return None;
        }
        let stakes = Stakes {
            collected: self.collected,
            members,
            rows: &self.collected.costs,
            width: self.collected.actions,
            cost: |below: &[f64], all: &[f64]| {
                let above = all.iter().zip(below).map(|(all, below)| all - below);
                least(below.iter().copied()) + least(above)
            },
            least: self.least,
        };
        let features = self.collected.features.len();
        let straight = parallel::map(features, |feature| stakes.straight(feature));
        let straight = straight
            .into_iter()
            .flatten()
            .map(|(left, cut)| (cut, cost - left));
        let bins: Vec<Bins> = (0..features)
            .map(|feature| Bins::new(self.collected, feature, &members[feature]))
            .collect();
        let two = parallel::map(features, |feature| self.two(feature, &bins, first, &sums));
        let straight = straight.chain(two.into_iter().flatten());
        let best = straight.filter(|(_, saved)| *saved > NOTHING * cost).fold(
            None,
            |best: Option<(Cut, f64)>, next| match best {
                Some(best) if best.1 >= next.1 => Some(best),
                _ => Some(next),
            },
        );
        if !self.slanted {
            return best;
        }
        let enough = SLANTED * best.map_or(NOTHING * cost, |(_, saved)| saved);
        let slanted = stakes.slanted(None, cost - enough);
        let slanted = slanted.map(|(left, cut)| (cut, (cost - left) / SLANTED));
        slanted
            .filter(|(_, saved)| SLANTED * saved > enough)
            .or(best)
    }

    /// The test of a feature that saves most for each leaf together with one more on either side, or on both.
    fn two(
        &self,
        feature: usize,
        bins: &[Bins],
        members: &[u32],
        sums: &[f64],
    ) -> Option<(Cut, f64)> {
        let actions = self.collected.actions;
        let firsts = &bins[feature].edges;
        let cost = least(sums.iter().copied());
        // By cut and side: the cost of a leaf, and the least cost with one more test.
        let mut leaf = vec![[f64::INFINITY; 2]; firsts.len()];
        let mut tested = vec![[f64::INFINITY; 2]; firsts.len()];
        for second in bins {
            let table = Table::new(self.collected, (&bins[feature], second), members);
            let mut below = vec![0.0; table.columns * actions];
            for cut in 0..firsts.len() {
                table.add_row(cut, &mut below);
                let above: Vec<f64> = table
                    .all
                    .iter()
                    .zip(&below)
                    .map(|(all, x)| all - x)
                    .collect();
                for (side, columns) in [&below, &above].into_iter().enumerate() {
                    let (plain, split) = split_along(columns, actions);
                    leaf[cut][side] = plain;
                    tested[cut][side] = tested[cut][side].min(split);
                }
            }
        }
        let mut best: Option<(Cut, f64)> = None;
        for (cut, less_than) in firsts.iter().enumerate() {
            let ([a, b], [c, d]) = (leaf[cut], tested[cut]);
            let saved = [(a + d, 2.0), (c + b, 2.0), (c + d, 3.0)]
                .into_iter()
                .map(|(left, leaves)| (cost - left) / leaves)
                .fold(f64::NEG_INFINITY, f64::max);
            if saved > best.map_or(0.0, |(_, saved)| saved) {
                let cut = Cut {
                    along: Along::feature(feature),
                    less_than: *less_than,
                };
                best = Some((cut, saved));
            }
        }
        best
    }
}

/// The tree of at most so many leaves that costs least: each grown to so many, made better, and cut back.
pub(super) fn cheapest_of(
    growths: &mut [Growth<'_>; 2],
    (collected, all): (&Collected, &Members),
    grown: usize,
    leaves: usize,
) -> Shape {
    let [straight, slanted] = growths.each_mut().map(|growth| {
        let mut shape = growth.to(grown).clone();
        shape.refine(collected, all);
        shape.cut_back(collected, all, leaves);
        shape
    });
    match slanted.cost(collected) < straight.cost(collected) {
        true => slanted,
        false => straight,
    }
}

/// Where a feature is cut, so that about as many members lie in each bin.
struct Bins {
    feature: usize,
    edges: Vec<f64>,
}

impl Bins {
    fn new(collected: &Collected, feature: usize, order: &[u32]) -> Self {
        let column = &collected.columns[feature];
        let at = |i: usize| column[order[i] as usize];
        let mut edges: Vec<f64> = Vec::with_capacity(CUTS);
        for cut in 1..=CUTS {
            let i = cut * order.len() / (CUTS + 1);
            // Between this value and the last one that is less.
            let first = order.partition_point(|member| column[*member as usize] < at(i));
            if first > 0 {
                let edge = 0.5 * (at(first - 1) + at(first));
                if edges.last().is_none_or(|last| *last < edge) {
                    edges.push(edge);
                }
            }
        }
        Self { feature, edges }
    }

    fn bin(&self, collected: &Collected, member: u32) -> usize {
        let value = collected.columns[self.feature][member as usize];
        self.edges.partition_point(|edge| *edge <= value)
    }
}

/// Costs by action in the bins of two features.
struct Table {
    columns: usize,
    actions: usize,
    /// By bin of the first feature, bin of the second, and action.
    costs: Vec<f64>,
    /// By bin of the second feature, and action.
    all: Vec<f64>,
}

impl Table {
    fn new(collected: &Collected, (first, second): (&Bins, &Bins), members: &[u32]) -> Self {
        let (columns, actions) = (second.edges.len() + 1, collected.actions);
        let row = columns * actions;
        let mut costs = vec![0.0; (first.edges.len() + 1) * row];
        for member in members {
            let (i, j) = (
                first.bin(collected, *member),
                second.bin(collected, *member),
            );
            let cell = &mut costs[i * row + j * actions..][..actions];
            add(cell, collected.costs_of(*member));
        }
        let mut all = vec![0.0; row];
        for of_row in costs.chunks_exact(row) {
            add(&mut all, of_row);
        }
        Self {
            columns,
            actions,
            costs,
            all,
        }
    }

    fn add_row(&self, row: usize, sums: &mut [f64]) {
        let size = self.columns * self.actions;
        add(sums, &self.costs[row * size..][..size]);
    }
}

/// The cost of one leaf for all bins, and the least cost of two, split between bins.
fn split_along(columns: &[f64], actions: usize) -> (f64, f64) {
    let mut all = vec![0.0; actions];
    for column in columns.chunks_exact(actions) {
        add(&mut all, column);
    }
    let plain = least(all.iter().copied());
    let mut below = vec![0.0; actions];
    let mut best = plain;
    for column in columns.chunks_exact(actions) {
        add(&mut below, column);
        let above = all.iter().zip(&below).map(|(all, below)| all - below);
        best = best.min(least(below.iter().copied()) + least(above));
    }
    (plain, best)
}

fn least(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(f64::INFINITY, f64::min)
}
