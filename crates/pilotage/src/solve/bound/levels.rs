//! Uncertainty levels for a bound: never larger than what the filter is left with.
//!
//! [`crate::belief::LevelGraph`] takes covariances within a tolerance for one, and cuts chains that do not end; both may make an
//! agent look better or worse than it is. Here a covariance is only ever replaced by a smaller one: what it lacks is told to the
//! agent, and the mean moves by that much more. An agent that is told more earns no less, so that the bound stays one.

use super::frame::Noise;

/// Variances along both axes.
pub(super) type Variances = [f64; 2];

/// Numbers this close are the same but for rounding.
const ROUNDING: f64 = 1e-12;

/// What a step of a class does at a level.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Step {
    /// Variances after the move, before anything is sensed.
    pub predicted: Variances,
    /// The level it leads to; `None` where there are too many levels to follow.
    pub next: Option<usize>,
}

/// The levels, with what leads where.
#[derive(Debug, Clone)]
pub(super) struct Levels {
    pub variances: Vec<Variances>,
    /// By level, then class.
    pub steps: Vec<Vec<Step>>,
    /// Levels of the start hypotheses.
    pub starts: Vec<usize>,
}

impl Levels {
    /// At most so many levels, as far as an episode of a length reaches: the closer two may be and still be two, the fewer are needed.
    pub(super) fn new(
        a: [f64; 2],
        classes: &[[Noise; 2]],
        starts: &[Variances],
        limit: usize,
        length: usize,
    ) -> Self {
        let mut tolerance = 1e-6;
        loop {
            let (levels, cut) = Self::within(a, classes, starts, (limit, length), tolerance);
            tolerance *= 4.0;
            if !cut || tolerance > 0.1 {
                return levels;
            }
        }
    }

    fn within(
        a: [f64; 2],
        classes: &[[Noise; 2]],
        starts: &[Variances],
        (limit, length): (usize, usize),
        tolerance: f64,
    ) -> (Self, bool) {
        let mut cut = false;
        let mut levels = Self {
            variances: Vec::new(),
            steps: Vec::new(),
            starts: Vec::new(),
        };
        for start in starts {
            let known = levels.variances.iter().position(|known| known == start);
            let level = known.unwrap_or_else(|| {
                levels.variances.push(*start);
                levels.variances.len() - 1
            });
            levels.starts.push(level);
        }
        // Levels are found in the order of the steps it takes to reach them.
        let (mut level, mut depth, mut deeper) = (0, 0, levels.variances.len());
        while level < levels.variances.len() {
            if level == deeper {
                (depth, deeper) = (depth + 1, levels.variances.len());
            }
            let from = levels.variances[level];
            let limit = if depth + 1 < length { limit } else { 0 };
            let steps = classes.iter().map(|class| {
                let (predicted, left) = advance(a, class, from);
                let next = levels.place(left, tolerance, limit, |from| advance(a, class, from).1);
                cut |= next.is_none() && limit > 0;
                Step { predicted, next }
            });
            let steps = steps.collect();
            levels.steps.push(steps);
            level += 1;
        }
        (levels, cut)
    }

    /// A level just below the variances: a known one, that at which they come to rest, or a new one.
    fn place(
        &mut self,
        left: Variances,
        tolerance: f64,
        limit: usize,
        advance: impl Fn(Variances) -> Variances,
    ) -> Option<usize> {
        let below = |known: &Variances| {
            (0..2).all(|i| {
                known[i] <= left[i] * (1.0 + ROUNDING) && left[i] - known[i] <= tolerance * left[i]
            })
        };
        let largest = |variances: &[Variances]| {
            let found = (0..variances.len()).filter(|&level| below(&variances[level]));
            found.max_by(|&x, &y| {
                let sum = |level: usize| variances[level].iter().sum::<f64>();
                sum(x).total_cmp(&sum(y))
            })
        };
        if let Some(known) = largest(&self.variances) {
            return Some(known);
        }
        if self.variances.len() >= limit {
            return None;
        }
        let rest = (0..1000).fold(left, |variances, _| advance(variances));
        self.variances.push(match below(&rest) {
            true => rest,
            false => left,
        });
        Some(self.variances.len() - 1)
    }

    /// The levels that a step leads to from any of these, without the classes that no action has.
    pub(super) fn after(&self, from: &[usize]) -> Vec<usize> {
        let steps = from.iter().flat_map(|&level| &self.steps[level]);
        let mut next: Vec<usize> = steps.filter_map(|step| step.next).collect();
        next.sort_unstable();
        next.dedup();
        next
    }

    /// Everything that can be reached from these, themselves included.
    pub(super) fn closure(&self, from: &[usize]) -> Vec<usize> {
        let mut all = from.to_vec();
        loop {
            let mut more = all.clone();
            more.extend(self.after(&all));
            more.sort_unstable();
            more.dedup();
            if more.len() == all.len() {
                return more;
            }
            all = more;
        }
    }
}

/// One step of the Riccati recursion along each axis: before and after the reading.
fn advance(a: [f64; 2], class: &[Noise; 2], from: Variances) -> (Variances, Variances) {
    let predicted: Variances = std::array::from_fn(|i| a[i] * a[i] * from[i] + class[i].motion);
    let left = std::array::from_fn(|i| {
        // Also where nothing is left to be told, so that an endless precision is none.
        match predicted[i] > 0.0 {
            true => 1.0 / (1.0 / predicted[i] + class[i].precision),
            false => 0.0,
        }
    });
    (predicted, left)
}
