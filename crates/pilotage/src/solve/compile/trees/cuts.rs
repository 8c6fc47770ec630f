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
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Cut {
    pub(super) along: Along,
    pub(super) less_than: f64,
}

/// Multiples that a second feature is first tried in, once both are brought to the same spread, either way.
const SLANTS: [f64; 7] = [0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0];

/// By so much are the best of them changed, either way and as often as that helps, one change after the other.
const FINER: [f64; 5] = [1.414, 1.19, 1.09, 1.04, 1.02];

/// Beliefs that slants are compared on, and bins along each of them; of more beliefs, they are first tried on every fourth of these.
const COMPARED: usize = 4_000;
const FOURTH: usize = 4;
const BINS: usize = 200;

/// Bins on either side of the border found in which its exact place is looked for.
const NEAR: usize = 4;

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

/// Numbers of members summed, and how much they count.
type Sums = (Vec<f64>, f64);

/// Members on whom lines are compared, what is known of them side by side.
struct Compared {
    members: Vec<u32>,
    /// By feature and member.
    columns: Vec<Vec<f64>>,
    /// By member, the numbers that are summed, and how much it counts.
    rows: Vec<f64>,
    counts: Vec<f64>,
    /// These summed.
    sums: Sums,
    /// How much of them counts on either side, at least.
    least: f64,
}

impl<C: Fn(&[f64], &[f64]) -> f64 + Sync> Stakes<'_, C> {
    fn row(&self, member: u32) -> &[f64] {
        &self.rows[member as usize * self.width..][..self.width]
    }

    /// The numbers of members summed, and how much they count.
    fn sums(&self, members: &[u32]) -> Sums {
        let mut sums = vec![0.0; self.width];
        for member in members {
            add(&mut sums, self.row(*member));
        }
        (sums, self.collected.counted(members))
    }

    /// The best test of a feature by itself, with what it costs.
    pub(super) fn straight(&self, feature: usize) -> Option<(f64, Cut)> {
        let members = &self.members[feature];
        let value = |member: u32| self.collected.columns[feature][member as usize];
        let order = members.iter().map(|&member| (value(member), member));
        let none = (vec![0.0; self.width], 0.0);
        let all = (&self.sums(members), self.least);
        self.swept(Along::feature(feature), none, order, all)
    }

    /// The best test along a line among members that are on it in this order, where those before them come to `below` and all to `all`, of whom
    /// at least so much counts on either side.
    fn swept(
        &self,
        along: Along,
        (mut below, mut count): Sums,
        order: impl IntoIterator<Item = (f64, u32)>,
        ((all, counted), least): (&Sums, f64),
    ) -> Option<(f64, Cut)> {
        let mut best: Option<(f64, Cut)> = None;
        let mut last: Option<f64> = None;
        for (here, member) in order {
            let between = last.filter(|last| *last < here);
            let is_enough = count >= least && counted - count >= least;
            if let Some(last) = between.filter(|_| is_enough) {
                let cost = (self.cost)(&below, all);
                if best.is_none_or(|(least, _)| cost < least) {
                    let less_than = 0.5 * (last + here);
                    best = Some((cost, Cut { along, less_than }));
                }
            }
            add(&mut below, self.row(member));
            count += self.collected.counts[member as usize];
            last = Some(here);
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

    /// The best slanted test that is found, also near a line that is known, with what it costs; none where that seems to be no less than so
    /// much.
    pub(super) fn slanted(&self, known: Option<Along>, less_than: f64) -> Option<(f64, Cut)> {
        if self.collected.pairs.is_empty() {
            return None;
        }
        let stride = self.members[0].len().div_ceil(COMPARED).max(1);
        let some = self.compared(stride);
        let few = (stride > 1).then(|| self.compared(FOURTH * stride));
        let few = few.as_ref().unwrap_or(&some);
        let pairs = self.collected.pairs.iter();
        let slants = pairs.flat_map(|pair| slants(*pair, self.collected, &few.members));
        let known = known.filter(|along| along.plus.is_some());
        let lines = self.likeliest(slants.collect(), few).into_iter();
        let mut best = self.best_of(None, lines.chain(known).collect(), &some)?;
        for factor in FINER {
            loop {
                let along = best.1.along;
                let turned = along.turned(self.collected, factor);
                best = self.best_of(Some(best), turned, &some)?;
                if best.1.along == along {
                    break;
                }
            }
        }
        let (cost, cut) = best;
        match stride as f64 * cost < less_than {
            true if stride > 1 => self.placed(cut.along, &self.compared(1)),
            true => Some(best),
            false => None,
        }
    }

    /// The line along which a test seems to cost some of the members least.
    fn likeliest(&self, lines: Vec<Along>, some: &Compared) -> Option<Along> {
        let costs = parallel::map(lines.len(), |i| {
            let binned = Binned::new(self, lines[i], some);
            binned.edge(self, some).map(|(cost, _)| cost)
        });
        let known = costs.into_iter().zip(lines);
        let costs = known.filter_map(|(cost, along)| Some((cost?, along)));
        let least = costs.min_by(|a, b| a.0.total_cmp(&b.0));
        least.map(|(_, along)| along)
    }

    /// The test that costs some of the members least: the best so far, unless one along these lines is better.
    fn best_of(
        &self,
        best: Option<(f64, Cut)>,
        lines: Vec<Along>,
        some: &Compared,
    ) -> Option<(f64, Cut)> {
        let found = parallel::map(lines.len(), |i| self.placed(lines[i], some));
        found.into_iter().flatten().fold(best, |best, next| {
            let better = best.is_none_or(|best| next.0 < best.0);
            if better { Some(next) } else { best }
        })
    }

    /// The best test along a line for some of the members, with what it costs them: its exact place near the edge of a bin that is best.
    fn placed(&self, along: Along, some: &Compared) -> Option<(f64, Cut)> {
        let binned = Binned::new(self, along, some);
        let (_, last) = binned.edge(self, some)?;
        let near = binned.near(last)?;
        let before = binned.before(*near.start());
        let valued = binned.values.iter().zip(&some.members);
        let mut order: Vec<(f64, u32)> = valued
            .filter(|(value, _)| near.contains(&binned.bin(**value)))
            .map(|(value, member)| (*value, *member))
            .collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        self.swept(along, before, order, (&some.sums, some.least))
    }
}

/// Members in bins along a line.
struct Binned {
    /// By member.
    values: Vec<f64>,
    low: f64,
    per_unit: f64,
    /// By bin, the numbers that are summed, and how much members count.
    rows: Vec<f64>,
    counts: [f64; BINS],
}

impl Binned {
    fn new<C>(stakes: &Stakes<'_, C>, along: Along, some: &Compared) -> Self {
        let places = 0..some.members.len();
        let values: Vec<f64> = places.map(|i| along.at(&some.columns, i)).collect();
        let (low, high) = range(&values);
        let mut binned = Self {
            low,
            per_unit: BINS as f64 / (high - low).max(f64::MIN_POSITIVE),
            rows: vec![0.0; BINS * stakes.width],
            counts: [0.0; BINS],
            values,
        };
        let known = some.rows.chunks_exact(stakes.width).zip(&some.counts);
        for (i, (row, count)) in known.enumerate() {
            let bin = binned.bin(binned.values[i]);
            add(&mut binned.rows[bin * stakes.width..][..stakes.width], row);
            binned.counts[bin] += count;
        }
        binned
    }

    fn bin(&self, value: f64) -> usize {
        (((value - self.low) * self.per_unit) as usize).min(BINS - 1)
    }

    fn add_bin(&self, (below, count): &mut Sums, bin: usize) {
        let width = below.len();
        add(below, &self.rows[bin * width..][..width]);
        *count += self.counts[bin];
    }

    /// What bins before this one come to.
    fn before(&self, bin: usize) -> Sums {
        let mut sums = (vec![0.0; self.rows.len() / BINS], 0.0);
        (0..bin).for_each(|bin| self.add_bin(&mut sums, bin));
        sums
    }

    /// What a test at the best edge of bins costs, and the last bin below it.
    fn edge<C>(&self, stakes: &Stakes<'_, C>, some: &Compared) -> Option<(f64, usize)>
    where
        C: Fn(&[f64], &[f64]) -> f64,
    {
        let (all, counted) = &some.sums;
        let mut sums = self.before(0);
        let mut best: Option<(f64, usize)> = None;
        for last in 0..BINS {
            self.add_bin(&mut sums, last);
            let (below, count) = &sums;
            if *count >= some.least && counted - count >= some.least {
                let cost = (stakes.cost)(below, all);
                if best.is_none_or(|(least, _)| cost < least) {
                    best = Some((cost, last));
                }
            }
        }
        best
    }

    /// Bins near the edge above one, with someone on either side of it.
    fn near(&self, last: usize) -> Option<std::ops::RangeInclusive<usize>> {
        let is_met = |bin: &usize| self.counts[*bin] > 0.0;
        let below = (0..=last).rev().find(is_met)?;
        let above = (last + 1..BINS).find(is_met)?;
        Some(below.min((last + 1).saturating_sub(NEAR))..=above.max((last + NEAR).min(BINS - 1)))
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
