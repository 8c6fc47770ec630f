//! Tests, and where they cost least: along a feature, or along a slanted line, the sum of a feature and a multiple of another.

use super::collected::{Collected, Members};
use crate::parallel;

/// What a test asks for: a feature, and where it is slanted a multiple of another that is added.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Along {
    pub(super) feature: usize,
    pub(super) plus: Option<(f64, usize)>,
}

/// A test.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cut {
    pub(super) along: Along,
    pub(super) less_than: f64,
}

/// Multiples that a second feature is first tried in, once both are brought to the same spread, either way.
const SLANTS: [f64; 7] = [0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0];

/// By so much are the best of them changed, either way, one change after the other.
const FINER: [f64; 5] = [1.414, 1.19, 1.09, 1.04, 1.02];

/// Beliefs that slants are compared on, and bins along each of them.
const COMPARED: usize = 4_000;
const BINS: usize = 200;

/// Two features that a test may ask for together.
pub(super) type Pair = [usize; 2];

/// Lines along a pair to be tried for beliefs. Of probabilities only the sum and the difference say something.
fn slants([feature, other]: Pair, collected: &Collected, members: &[u32]) -> Vec<Along> {
    let line = |times: f64| Along {
        feature,
        plus: Some((rounded(times), other)),
    };
    if collected.is_probability(feature) {
        return [1.0, -1.0].map(line).to_vec();
    }
    let spread = |feature| collected.spread(feature, members);
    let (own, others) = (spread(feature), spread(other));
    if own <= 0.0 || others <= 0.0 {
        return Vec::new();
    }
    let either = |slant: &f64| [*slant, -slant].map(|slant| line(slant * own / others));
    SLANTS.iter().flat_map(either).collect()
}

impl Along {
    /// The same features, more and less slanted; probabilities stay as they are.
    fn turned(self, collected: &Collected, factor: f64) -> Vec<Self> {
        let turned = |factor: f64| Self {
            plus: self
                .plus
                .map(|(times, other)| (rounded(times * factor), other)),
            ..self
        };
        match collected.is_probability(self.feature) {
            true => Vec::new(),
            false => [factor, 1.0 / factor].map(turned).to_vec(),
        }
    }

    /// A feature by itself.
    pub(super) fn feature(feature: usize) -> Self {
        Self {
            feature,
            plus: None,
        }
    }

    /// What a belief answers.
    pub(super) fn of(self, collected: &Collected, member: u32) -> f64 {
        self.at(&collected.columns, member as usize)
    }

    /// What is answered where the features, in a column each, are at a place.
    fn at(self, columns: &[Vec<f64>], place: usize) -> f64 {
        let value = |feature: usize| columns[feature][place];
        match self.plus {
            None => value(self.feature),
            Some((times, other)) => value(self.feature) + times * value(other),
        }
    }
}

impl Cut {
    /// Whether it asks for more than one feature.
    pub(super) fn is_slanted(self) -> bool {
        self.along.plus.is_some()
    }

    /// Whether a belief is less.
    pub(super) fn is_below(self, collected: &Collected, member: u32) -> bool {
        self.along.of(collected, member) < self.less_than
    }
}

/// What it costs beliefs to be on either side of a test.
pub(super) struct Stakes<'a, C> {
    pub(super) collected: &'a Collected,
    pub(super) members: &'a Members,
    /// By belief, so many numbers that are summed.
    pub(super) rows: &'a [f64],
    pub(super) width: usize,
    /// What it costs if the numbers of those that are less come to so much, and those of all members to so much.
    pub(super) cost: C,
    /// How much members count on either side, at least.
    pub(super) least: f64,
}

/// Members on whom lines are compared, what is known of them side by side.
struct Compared {
    members: Vec<u32>,
    /// By feature and member.
    columns: Vec<Vec<f64>>,
    /// By member, the numbers that are summed, and how much it counts.
    rows: Vec<f64>,
    counts: Vec<f64>,
    /// These summed.
    sums: (Vec<f64>, f64),
    /// How much of them counts on either side, at least.
    least: f64,
}

impl<C: Fn(&[f64], &[f64]) -> f64 + Sync> Stakes<'_, C> {
    fn row(&self, member: u32) -> &[f64] {
        &self.rows[member as usize * self.width..][..self.width]
    }

    /// The numbers of members summed, and how much they count.
    fn sums(&self, members: &[u32]) -> (Vec<f64>, f64) {
        let mut sums = vec![0.0; self.width];
        for member in members {
            add(&mut sums, self.row(*member));
        }
        (sums, self.collected.counted(members))
    }

    /// The best test of a feature by itself, with what it costs.
    pub(super) fn straight(&self, feature: usize) -> Option<(f64, Cut)> {
        self.swept(Along::feature(feature), &self.members[feature])
    }

    /// The best test along a line, on which members are in this order.
    fn swept(&self, along: Along, order: &[u32]) -> Option<(f64, Cut)> {
        let (all, counted) = self.sums(order);
        let (mut below, mut count) = (vec![0.0; self.width], 0.0);
        let mut best: Option<(f64, Cut)> = None;
        for pair in order.windows(2) {
            add(&mut below, self.row(pair[0]));
            count += self.collected.counts[pair[0] as usize];
            let [here, next] = [pair[0], pair[1]].map(|member| along.of(self.collected, member));
            if here >= next || count < self.least || counted - count < self.least {
                continue;
            }
            let cost = (self.cost)(&below, &all);
            if best.is_none_or(|(least, _)| cost < least) {
                let less_than = 0.5 * (here + next);
                best = Some((cost, Cut { along, less_than }));
            }
        }
        best
    }

    /// Every so many-th of the members.
    fn compared(&self, stride: usize) -> Compared {
        let members: Vec<u32> = self.members[0].iter().copied().step_by(stride).collect();
        let of = |column: &Vec<f64>| members.iter().map(|m| column[*m as usize]).collect();
        Compared {
            columns: self.collected.columns.iter().map(of).collect(),
            rows: members.iter().flat_map(|m| self.row(*m)).copied().collect(),
            counts: of(&self.collected.counts),
            sums: self.sums(&members),
            least: self.least / stride as f64,
            members,
        }
    }

    /// The best slanted test that is found, also near a line that is known, with what it costs.
    pub(super) fn slanted(&self, known: Option<Along>) -> Option<(f64, Cut)> {
        if self.collected.pairs.is_empty() {
            return None;
        }
        let members = &self.members[0];
        let stride = members.len().div_ceil(COMPARED).max(1);
        let some = self.compared(stride);
        let pairs = self.collected.pairs.iter();
        let slants = pairs.flat_map(|pair| slants(*pair, self.collected, &some.members));
        let slants = slants.chain(known.filter(|along| along.plus.is_some()));
        let mut best = self.best_of(None, slants.collect(), &some)?;
        for factor in FINER {
            let turned = best.1.turned(self.collected, factor);
            best = self.best_of(Some(best), turned, &some)?;
        }
        let along = best.1;
        let mut order: Vec<(f64, u32)> = members
            .iter()
            .map(|&member| (along.of(self.collected, member), member))
            .collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let order: Vec<u32> = order.into_iter().map(|(_, member)| member).collect();
        self.swept(along, &order)
    }

    /// The line along which a test costs least for some of the members, the best so far unless another is better.
    fn best_of(
        &self,
        best: Option<(f64, Along)>,
        lines: Vec<Along>,
        some: &Compared,
    ) -> Option<(f64, Along)> {
        let costs = parallel::map(lines.len(), |i| self.roughly(lines[i], some));
        costs.into_iter().zip(lines).fold(best, |best, next| {
            let better = best.is_none_or(|best| next.0 < best.0);
            if better { Some(next) } else { best }
        })
    }

    /// About what the best test along a line costs some of the members.
    fn roughly(&self, along: Along, some: &Compared) -> f64 {
        let places = 0..some.members.len();
        let values: Vec<f64> = places.map(|i| along.at(&some.columns, i)).collect();
        let (low, high) = range(&values);
        let per_unit = BINS as f64 / (high - low).max(f64::MIN_POSITIVE);
        let mut bins = vec![0.0; BINS * self.width];
        let mut counts = [0.0; BINS];
        let known = some.rows.chunks_exact(self.width).zip(&some.counts);
        for (value, (row, count)) in values.iter().zip(known) {
            let bin = (((value - low) * per_unit) as usize).min(BINS - 1);
            add(&mut bins[bin * self.width..][..self.width], row);
            counts[bin] += count;
        }
        let (all, counted) = &some.sums;
        let (mut below, mut count) = (vec![0.0; self.width], 0.0);
        let mut best = f64::INFINITY;
        for (row, more) in bins.chunks_exact(self.width).zip(counts) {
            add(&mut below, row);
            count += more;
            if count >= some.least && counted - count >= some.least {
                best = best.min((self.cost)(&below, all));
            }
        }
        best
    }
}

/// Adds numbers to sums of them.
pub(super) fn add(sums: &mut [f64], row: &[f64]) {
    sums.iter_mut().zip(row).for_each(|(sum, x)| *sum += x);
}

fn range(values: &[f64]) -> (f64, f64) {
    let first = (f64::INFINITY, f64::NEG_INFINITY);
    values
        .iter()
        .fold(first, |(low, high), x| (low.min(*x), high.max(*x)))
}

/// Three significant digits, so that a slant is what a person reads.
fn rounded(times: f64) -> f64 {
    format!("{times:.2e}").parse().unwrap_or(times)
}
