//! A box of state space cut into cells along each of one or two variables, and how a Gaussian lies over them.

use std::ops::Range;

use crate::belief::gaussian::{normal_cdf, normal_density};
use crate::model::{Interval, Stop, VariableKind};

/// A point of one or two variables; the second counts only where there is one.
pub(crate) type Spot = [f64; 2];

/// So many standard deviations from its mean a Gaussian is taken to be nowhere: 4e-11 of it is farther.
const NEVER: f64 = 6.5;

/// Of two correlated variables the first is cut into at most so many strips a cell, each with its own law of the second.
const STRIPS: f64 = 8.0;

/// Where cells grow, each is so many times as wide as the one before.
const GROWTH: f64 = 1.1;

/// Where walls stop what moves, a cell of its own is this share of the usual width: who stands at a wall is neither somewhere beside it nor
/// does he get along it.
const THIN: f64 = 0.01;

/// One variable, cut into cells of one width; thin ones are at walls, wider ones far out.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Axis {
    /// Ends of the cells, one after the other: one more than there are cells.
    edges: Vec<f64>,
    /// Of a usual cell, and of those that one may think of beyond all.
    pub(super) width: f64,
    pub(super) kind: VariableKind,
}

/// Ends of cells that grow from a width until they have come so far; none if that is not far, or for ever.
fn growing(width: f64, far: f64) -> Vec<f64> {
    if far <= 1e-9 * width || far.is_infinite() {
        return Vec::new();
    }
    let ends = |reach: &f64| Some(GROWTH * reach + width);
    let mut ends: Vec<f64> = std::iter::successors(Some(width), ends)
        .take_while(|reach| *reach < far - 0.5 * width)
        .collect();
    ends.push(far);
    ends
}

/// The sum of a uniform number between two ends and Gaussian noise: where the points of a cell are after a step, or what they make a
/// sensor read. Ends in units of the variable, `low <= high`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ramp {
    low: f64,
    high: f64,
    sd: f64,
}

impl Ramp {
    /// Between two ends, in any order, with noise of this variance.
    pub(super) fn new(one: f64, other: f64, variance: f64) -> Self {
        Self {
            low: one.min(other),
            high: one.max(other),
            sd: variance.max(0.0).sqrt(),
        }
    }

    /// A Gaussian.
    pub(super) fn gaussian(mean: f64, variance: f64) -> Self {
        Self::new(mean, mean, variance)
    }

    fn moved(self, by: f64) -> Self {
        Self {
            low: self.low + by,
            high: self.high + by,
            ..self
        }
    }

    fn middle(&self) -> f64 {
        0.5 * (self.low + self.high)
    }

    /// Probability of being below `x`: the integral of the normal cdf is `z cdf(z) + density(z)`.
    fn below(&self, x: f64) -> f64 {
        if x.is_infinite() {
            return f64::from(x > 0.0);
        }
        let width = self.high - self.low;
        // Where one of the two spreads is far smaller than the other, the difference of integrals would lose its digits.
        if width <= 0.05 * self.sd {
            let sd = (self.sd * self.sd + width * width / 12.0).sqrt();
            return match sd > 0.0 {
                true => normal_cdf((x - self.middle()) / sd),
                false => f64::from(self.low < x),
            };
        }
        if self.sd <= 1e-9 * width {
            return ((x - self.low) / width).clamp(0.0, 1.0);
        }
        let integral = |end: f64| {
            let z = (x - end) / self.sd;
            z * normal_cdf(z) + normal_density(z)
        };
        let below = (integral(self.low) - integral(self.high)) * self.sd / width;
        below.clamp(0.0, 1.0)
    }
}

/// A part of a cell: its middle, and half of its width along each variable (0 for whole numbers).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Part {
    pub(crate) middle: Spot,
    pub(crate) half: Spot,
}

impl Axis {
    pub(super) fn new(low: f64, width: f64, count: usize, kind: VariableKind) -> Self {
        let edges = (0..=count).map(|k| low + k as f64 * width).collect();
        Self { edges, width, kind }
    }

    /// With cells that reach to far bounds, each wider than the one before.
    pub(super) fn grown_to(mut self, bounds: Interval) -> Self {
        let (low, high) = (self.edges[0], self.edges[self.count()]);
        let upwards = growing(self.width, bounds.high - high);
        self.edges.extend(upwards.into_iter().map(|by| high + by));
        let downwards = growing(self.width, low - bounds.low);
        let below = downwards.into_iter().rev().map(|by| low - by);
        self.edges.splice(0..0, below);
        self
    }

    /// With a thin cell on that side of each of these places from which one comes to it.
    pub(super) fn with_stops(mut self, stops: &[Stop]) -> Self {
        let thin = THIN * self.width;
        let (low, high) = (self.edges[0], self.edges[self.count()]);
        for stop in stops {
            let beside = if stop.upwards { -thin } else { thin };
            let ends = [stop.place, stop.place + beside];
            let inside = ends.into_iter().filter(|end| (low..=high).contains(end));
            self.edges.extend(inside);
        }
        self.edges.sort_by(f64::total_cmp);
        self.edges.dedup_by(|a, b| *a - *b < 0.5 * thin);
        self
    }

    /// Number of cells.
    pub(super) fn count(&self) -> usize {
        self.edges.len() - 1
    }

    fn edge(&self, index: i64) -> f64 {
        let last = self.count() as i64;
        let inside = index.clamp(0, last);
        self.edges[inside as usize] + (index - inside) as f64 * self.width
    }

    /// The cell of a value, which may lie beyond the axis.
    fn index(&self, value: f64) -> i64 {
        let last = self.count();
        let beyond = |end: f64| ((value - end) / self.width).floor() as i64;
        match self.edges.partition_point(|edge| *edge <= value) {
            0 => beyond(self.edges[0]),
            passed if passed > last => last as i64 + beyond(self.edges[last]),
            passed => passed as i64 - 1,
        }
    }

    /// The middle of a cell, which may lie beyond the axis.
    pub(super) fn middle(&self, index: i64) -> f64 {
        0.5 * (self.edge(index) + self.edge(index + 1))
    }

    /// The cell of a value, one of those at the ends for a value beyond them.
    pub(super) fn cell_of(&self, value: f64) -> usize {
        (self.index(value).max(0) as usize).min(self.count() - 1)
    }

    /// Whether values are whole numbers, one for each cell.
    pub(super) fn is_integer(&self) -> bool {
        self.kind == VariableKind::Integer
    }

    fn half(&self, index: i64) -> f64 {
        if self.is_integer() {
            0.0
        } else {
            0.5 * (self.edge(index + 1) - self.edge(index))
        }
    }

    /// How much of a ramp lies in each cell of a range, as far as it lies in `kept`. The cells at the ends of the range have
    /// everything beyond them.
    pub(super) fn masses(&self, ramp: Ramp, kept: Interval, range: Range<i64>) -> Vec<(i64, f64)> {
        if self.kind == VariableKind::Angle {
            return self.masses_around(ramp, kept);
        }
        let index = |value: f64| self.index(value).clamp(range.start, range.end - 1);
        let reach = NEVER * ramp.sd;
        let (first, last) = (index(ramp.low - reach), index(ramp.high + reach));
        let edge = |k: i64| match k {
            k if k == range.start => f64::NEG_INFINITY,
            k if k == range.end => f64::INFINITY,
            k => self.edge(k),
        };
        let below = |k: i64| ramp.below(edge(k).clamp(kept.low, kept.high));
        let mut before = below(first);
        let mass = |k| {
            let after = below(k + 1);
            let mass = after - before;
            before = after;
            (k, mass)
        };
        let masses = (first..=last).map(mass);
        masses.filter(|(_, mass)| *mass > 0.0).collect()
    }

    /// The same on a circle.
    fn masses_around(&self, ramp: Ramp, kept: Interval) -> Vec<(i64, f64)> {
        use std::f64::consts::TAU;
        let ramp = ramp.moved(crate::model::wrapped(ramp.middle()) - ramp.middle());
        let mut masses = vec![0.0; self.count()];
        for turns in [-1.0, 0.0, 1.0] {
            let ramp = ramp.moved(turns * TAU);
            let below = |k: i64| ramp.below(self.edge(k).clamp(kept.low, kept.high));
            for (k, mass) in masses.iter_mut().enumerate() {
                *mass += below(k as i64 + 1) - below(k as i64);
            }
        }
        let masses = masses.into_iter().enumerate();
        let masses = masses.map(|(k, mass)| (k as i64, mass));
        masses.filter(|(_, mass)| *mass > 0.0).collect()
    }

    fn strips(&self, per: usize) -> Self {
        let fine = |k: usize| {
            let (low, high) = (self.edges[k], self.edges[k + 1]);
            (0..per).map(move |i| low + i as f64 / per as f64 * (high - low))
        };
        let mut edges: Vec<f64> = (0..self.count()).flat_map(fine).collect();
        edges.push(self.edges[self.count()]);
        Self {
            edges,
            width: self.width / per as f64,
            kind: self.kind,
        }
    }
}

/// Cells of one or two variables, those of the last side by side.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Grid {
    pub(super) axes: Vec<Axis>,
}

impl Grid {
    /// Number of cells.
    pub(crate) fn count(&self) -> usize {
        self.axes.iter().map(Axis::count).product()
    }

    pub(super) fn dim(&self) -> usize {
        self.axes.len()
    }

    fn indices(&self, cell: usize) -> [usize; 2] {
        match self.axes.get(1) {
            Some(axis) => [cell / axis.count(), cell % axis.count()],
            None => [cell, 0],
        }
    }

    fn index(&self, [first, second]: [usize; 2]) -> usize {
        self.axes
            .get(1)
            .map_or(first, |axis| first * axis.count() + second)
    }

    /// The middle of a cell.
    pub(crate) fn middle(&self, cell: usize) -> Spot {
        let indices = self.indices(cell);
        let mut middle = [0.0; 2];
        for (i, axis) in self.axes.iter().enumerate() {
            middle[i] = axis.middle(indices[i] as i64);
        }
        middle
    }

    /// The cell of a state, the nearest for one beyond the grid.
    pub(crate) fn cell_of(&self, state: &[f64]) -> usize {
        let mut indices = [0; 2];
        for (i, axis) in self.axes.iter().enumerate() {
            indices[i] = axis.cell_of(state[i]);
        }
        self.index(indices)
    }

    /// A whole cell.
    pub(crate) fn whole(&self, cell: usize) -> Part {
        let indices = self.indices(cell);
        let mut half = [0.0; 2];
        for (i, axis) in self.axes.iter().enumerate() {
            half[i] = axis.half(indices[i] as i64);
        }
        Part {
            middle: self.middle(cell),
            half,
        }
    }

    /// A cell cut into `per` equal parts along every variable that is not a whole number.
    pub(super) fn parts(&self, cell: usize, per: usize) -> Vec<Part> {
        self.cut(&self.whole(cell), per)
    }

    /// A part cut once more.
    pub(super) fn cut(&self, part: &Part, per: usize) -> Vec<Part> {
        let even = |half: f64| match half > 0.0 {
            true => (1..per)
                .map(|k| half * (2.0 * k as f64 / per as f64 - 1.0))
                .collect(),
            false => Vec::new(),
        };
        let mut cuts = [even(part.half[0]), even(part.half[1])];
        for (cuts, middle) in cuts.iter_mut().zip(part.middle) {
            cuts.iter_mut().for_each(|cut| *cut += middle);
        }
        let parts = cut_at(part, &cuts);
        parts.into_iter().map(|(_, part)| part).collect()
    }

    /// How a Gaussian that is smeared along each variable lies over the cells (`covariance` row by row, `n x n`): indices along the
    /// variables, which stay in the ranges, and mass. What is not in `kept` is left out.
    pub(super) fn spread(
        &self,
        ramps: &[Ramp],
        covariance: &[f64],
        kept: &[Interval],
        ranges: &[Range<i64>],
        to: &mut dyn FnMut([i64; 2], f64),
    ) {
        let along = |i: usize, ramp: Ramp| self.axes[i].masses(ramp, kept[i], ranges[i].clone());
        if self.dim() == 1 {
            for (k, mass) in along(0, ramps[0]) {
                to([k, 0], mass);
            }
            return;
        }
        let (shared, variance) = (covariance[1], covariance[0]);
        if shared * shared <= 1e-24 * variance * covariance[3] {
            let second = along(1, ramps[1]);
            for (k, mass) in along(0, ramps[0]) {
                for (l, part) in &second {
                    to([k, *l], mass * part);
                }
            }
            return;
        }
        // Given the first variable, the second has another mean, and what is left of its variance.
        let (slope, centre) = (shared / variance, ramps[0].middle());
        let rest = (covariance[3] - slope * shared).max(0.0);
        let shear = (slope * self.axes[0].width).abs() / rest.sqrt();
        let per = shear.ceil().clamp(1.0, STRIPS) as usize;
        let strips = self.axes[0].strips(per);
        let sheared = (slope * strips.width).powi(2) / 12.0;
        let (fine, count) = (per as i64, self.axes[0].count() as i64);
        let all = (ranges[0].start - count) * fine..(ranges[0].end + count) * fine;
        for (k, mass) in strips.masses(ramps[0], kept[0], all) {
            let by = slope * (strips.middle(k) - centre);
            let second = Ramp {
                sd: (rest + sheared).sqrt(),
                ..ramps[1].moved(by)
            };
            let cell = k.div_euclid(fine).clamp(ranges[0].start, ranges[0].end - 1);
            for (l, part) in along(1, second) {
                to([cell, l], mass * part);
            }
        }
    }

    /// The ranges of the grid itself.
    pub(super) fn own_ranges(&self) -> Vec<Range<i64>> {
        let ranges = self.axes.iter().map(|axis| 0..axis.count() as i64);
        ranges.collect()
    }

    /// Ranges as wide again on either side, for ways that end beyond the grid.
    pub(super) fn wide_ranges(&self) -> Vec<Range<i64>> {
        let wide = |axis: &Axis| -(axis.count() as i64)..2 * axis.count() as i64;
        self.axes.iter().map(wide).collect()
    }

    /// The cell of indices that lie in the grid.
    pub(super) fn at(&self, [first, second]: [i64; 2]) -> usize {
        self.index([first as usize, second as usize])
    }

    /// The middle of a cell that may lie beyond the grid.
    pub(super) fn middle_at(&self, indices: [i64; 2]) -> Spot {
        let mut middle = [0.0; 2];
        for (i, axis) in self.axes.iter().enumerate() {
            middle[i] = axis.middle(indices[i]);
        }
        middle
    }
}

/// A part cut at places along each variable, those outside it apart; with the share of each piece.
pub(super) fn cut_at(part: &Part, cuts: &[Vec<f64>; 2]) -> Vec<(f64, Part)> {
    let pieces = |i: usize| -> Vec<(f64, f64, f64)> {
        let (low, high) = (part.middle[i] - part.half[i], part.middle[i] + part.half[i]);
        let inside = cuts[i].iter().filter(|cut| low < **cut && **cut < high);
        let mut ends: Vec<f64> = inside.copied().chain([low, high]).collect();
        ends.sort_by(f64::total_cmp);
        ends.dedup();
        if ends.len() < 2 {
            return vec![(1.0, part.middle[i], 0.0)];
        }
        let share = |(a, b): (f64, f64)| ((b - a) / (high - low), 0.5 * (a + b), 0.5 * (b - a));
        ends.windows(2)
            .map(|pair| share((pair[0], pair[1])))
            .collect()
    };
    let second = pieces(1);
    let of = |(share, x, half): (f64, f64, f64)| {
        let second = second.iter();
        second.map(move |&(other, y, wide)| {
            let part = Part {
                middle: [x, y],
                half: [half, wide],
            };
            (share * other, part)
        })
    };
    pieces(0).into_iter().flat_map(of).collect()
}
