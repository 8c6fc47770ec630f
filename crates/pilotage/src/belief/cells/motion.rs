//! Where an action leads from every cell.

use std::ops::Range;

use super::grid::{Grid, Part, Ramp, Spot};
use crate::model::{Doing, Dynamics, Interval, Model, VariableKind};
use crate::parallel;

/// Parts of a cell along a variable whose points are moved one by one, where noise does not blur them.
const PARTS: usize = 3;

/// Noise whose standard deviation is this many cells blurs them.
const BLURRED: f64 = 1.0;

/// Less than this of a cell's mass is not followed.
const NOTHING: f64 = 1e-11;

/// Masses that go from each cell to others, row by row.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Rows {
    /// First entry of each row, and the number of all.
    starts: Vec<usize>,
    cells: Vec<u32>,
    masses: Vec<f64>,
}

impl Rows {
    fn new(rows: Vec<Vec<(u32, f64)>>) -> Self {
        let mut starts = vec![0];
        for row in &rows {
            starts.push(starts[starts.len() - 1] + row.len());
        }
        let entries = || rows.iter().flatten();
        Self {
            cells: entries().map(|(cell, _)| *cell).collect(),
            masses: entries().map(|(_, mass)| *mass).collect(),
            starts,
        }
    }

    fn row(&self, cell: usize) -> impl Iterator<Item = (usize, f64)> {
        let range = self.starts[cell]..self.starts[cell + 1];
        let masses = self.masses[range.clone()].iter();
        let cells = self.cells[range].iter();
        cells.map(|cell| *cell as usize).zip(masses.copied())
    }

    /// Probability of still being there after a move from a cell.
    pub(super) fn left(&self, cell: usize) -> f64 {
        self.masses[self.starts[cell]..self.starts[cell + 1]]
            .iter()
            .sum()
    }

    /// Adds what each cell's mass becomes.
    pub(super) fn forward(&self, from: &[f64], to: &mut [f64]) {
        for (cell, mass) in from.iter().enumerate().filter(|(_, mass)| **mass != 0.0) {
            for (target, share) in self.row(cell) {
                to[target] += mass * share;
            }
        }
    }

    /// What is expected of a value after a move from a cell.
    pub(super) fn expected(&self, cell: usize, values: &[f64]) -> f64 {
        self.row(cell)
            .map(|(target, share)| share * values[target])
            .sum()
    }
}

/// What it takes to say where cells are moved.
pub(super) struct Mover<'a> {
    model: &'a Model,
    dynamics: &'a Dynamics,
    grid: &'a Grid,
    /// Where a state along each variable is alive, before walls stop it.
    kept: Vec<Interval>,
    /// Whether the way has to be followed, as walls of a map may stop it.
    walled: bool,
}

impl<'a> Mover<'a> {
    pub(super) fn new(model: &'a Model, dynamics: &'a Dynamics, grid: &'a Grid) -> Self {
        let known = dynamics.walls().is_some();
        Self {
            model,
            dynamics,
            grid,
            kept: (0..grid.dim()).map(|i| kept(model, known, i)).collect(),
            walled: known && model.map.is_some(),
        }
    }

    /// The rows of an action in a mode. What fails is in none of them.
    pub(super) fn rows(&self, doing: Doing) -> Rows {
        Rows::new(parallel::map(self.grid.count(), |cell| {
            self.row(doing, cell)
        }))
    }

    fn row(&self, doing: Doing, cell: usize) -> Vec<(u32, f64)> {
        let whole = self.grid.whole(cell);
        let blurred = self.blurred(doing, &whole);
        let parts = match blurred {
            true => vec![whole],
            false => self.grid.cut(&whole, PARTS),
        };
        let share = 1.0 / parts.len() as f64;
        let mut sums = vec![0.0; self.grid.count()];
        for part in &parts {
            self.add(doing, part, &mut |target, mass| {
                sums[target] += share * mass
            });
        }
        let masses = sums.into_iter().enumerate();
        let masses = masses.filter(|(_, mass)| *mass > NOTHING);
        masses.map(|(target, mass)| (target as u32, mass)).collect()
    }

    /// Whether the noise is so wide that a cell may be moved as one.
    fn blurred(&self, doing: Doing, whole: &Part) -> bool {
        let n = self.grid.dim();
        let mut noise = [0.0; 4];
        let state = &whole.middle[..n];
        self.dynamics
            .transition_noise(doing, state, &mut noise[..n * n]);
        let axes = self.grid.axes.iter().enumerate();
        n > 1
            && axes
                .map(|(i, axis)| noise[i * (n + 1)].sqrt() / axis.width)
                .all(|wide| wide >= BLURRED)
    }

    /// Adds where a part of a cell comes to rest.
    fn add(&self, doing: Doing, part: &Part, to: &mut dyn FnMut(usize, f64)) {
        let n = self.grid.dim();
        let mut noise = [0.0; 4];
        let state = &part.middle[..n];
        self.dynamics
            .transition_noise(doing, state, &mut noise[..n * n]);
        let ramps = self.ramps(doing, part, &noise);
        if !self.walled {
            let ranges = self.grid.own_ranges();
            let mut put = |indices, mass| to(self.grid.at(indices), mass);
            let covariance = &noise[..n * n];
            return self
                .grid
                .spread(&ramps, covariance, &self.kept, &ranges, &mut put);
        }
        self.walk(state, &ramps, &noise[..n * n], to);
    }

    /// The same where the straight way to each target may be stopped.
    fn walk(
        &self,
        from: &[f64],
        ramps: &[Ramp],
        covariance: &[f64],
        to: &mut dyn FnMut(usize, f64),
    ) {
        let n = self.grid.dim();
        let ranges: Vec<Range<i64>> = self.grid.wide_ranges();
        let everywhere = vec![Interval::ALL; n];
        let alive = &self.model.episode.alive;
        let mut put = |indices, mass| {
            if mass < 0.01 * NOTHING {
                return;
            }
            let mut target = self.grid.middle_at(indices);
            self.dynamics.settle(from, &mut target[..n]);
            if alive.contains(&target[..n]) {
                to(self.grid.cell_of(&target[..n]), mass);
            }
        };
        self.grid
            .spread(ramps, covariance, &everywhere, &ranges, &mut put);
    }

    /// Where a part is moved along each variable. Its own width along the variable is carried along as far as the motion is even
    /// there; where it is not, as at a jump, its middle stands for it.
    fn ramps(&self, doing: Doing, part: &Part, noise: &[f64; 4]) -> Vec<Ramp> {
        let n = self.grid.dim();
        let moved = |state: Spot| {
            let mut to = [0.0; 2];
            self.dynamics.transition(doing, &state[..n], &mut to[..n]);
            to
        };
        let middle = moved(part.middle);
        let ramp = |i: usize| {
            let variance = noise[i * (n + 1)];
            if part.half[i] == 0.0 {
                return Ramp::gaussian(middle[i], variance);
            }
            let end = |sign: f64| {
                let mut state = part.middle;
                state[i] += sign * part.half[i];
                moved(state)[i]
            };
            let (low, high) = (end(-1.0), end(1.0));
            let bent = (0.5 * (low + high) - middle[i]).abs() > 0.25 * (high - low).abs();
            match bent {
                true => Ramp::gaussian(middle[i], variance),
                false => Ramp::new(low, high, variance),
            }
        };
        (0..n).map(ramp).collect()
    }
}

/// Which values of a variable are alive once walls, where they are known, have stopped what lies beyond the bounds.
fn kept(model: &Model, walls: bool, variable: usize) -> Interval {
    let bounds = model.state[variable].bounds;
    let alive = model.episode.alive.side(variable);
    let mut kept = alive;
    if model.state[variable].kind == VariableKind::Integer {
        // The whole numbers of [low, high) are rounded from these.
        kept = Interval::new(alive.low.ceil() - 0.5, alive.high.ceil() - 0.5);
    }
    if walls && alive.contains(bounds.clamp(f64::NEG_INFINITY)) {
        kept.low = f64::NEG_INFINITY;
    }
    if walls && alive.contains(bounds.clamp(f64::INFINITY)) {
        kept.high = f64::INFINITY;
    }
    Interval::new(kept.low, kept.high.max(kept.low))
}

/// Where the start of a model lies, by mode and cell.
pub(super) fn start(mover: &Mover<'_>) -> Vec<f64> {
    let (model, grid) = (mover.model, mover.grid);
    let mut masses = vec![0.0; model.modes.len() * grid.count()];
    for start in &model.start {
        let mut own = vec![0.0; grid.count()];
        let mean = start.mean.as_slice();
        let covariance = start.covariance.as_slice();
        let n = mean.len();
        let variance = |i: usize| covariance[i * (n + 1)];
        let uniform = start.shape == crate::model::StartShape::Uniform;
        let ramp = |i: usize| match uniform {
            true => {
                let half = (3.0 * variance(i)).max(0.0).sqrt();
                Ramp::new(mean[i] - half, mean[i] + half, 0.0)
            }
            false => Ramp::gaussian(mean[i], variance(i)),
        };
        let ramps: Vec<Ramp> = (0..n).map(ramp).collect();
        let mut put = |cell: usize, mass: f64| own[cell] += mass;
        if mover.walled {
            mover.walk(mean, &ramps, covariance, &mut put);
        } else {
            let mut put = |indices, mass| put(grid.at(indices), mass);
            let ranges = grid.own_ranges();
            grid.spread(&ramps, covariance, &mover.kept, &ranges, &mut put);
        }
        // Who is not alive was never there.
        let alive = own.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        let of_mode = &mut masses[start.mode * grid.count()..][..grid.count()];
        for (sum, mass) in of_mode.iter_mut().zip(own) {
            *sum += start.weight * mass / alive;
        }
    }
    masses
}
