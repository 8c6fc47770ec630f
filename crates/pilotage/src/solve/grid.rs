//! Functions on a regular grid of means: interpolation, and averaging over a Gaussian.

use nalgebra::DMatrix;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::belief::gaussian::normal_density;
use crate::belief::kalman::square_root;
use crate::error::Result;
use crate::model::Interval;
use crate::solve::settings::ensure;

/// Settings of value iteration on a grid.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Settings {
    /// Points of the grid along each variable; at least 2, or `auto` for what suits the number of variables.
    pub points: Option<usize>,
    /// Largest error of the fixed point, in units of reward; more than 0.
    pub tolerance: f64,
    /// Most sweeps, over one group of levels where there are levels; at least 1.
    pub sweeps: usize,
    /// Most memory for the grid, MiB; at least 0.
    pub memory: u64,
}

impl Settings {
    /// Checks every setting against its range.
    ///
    /// # Errors
    /// [`crate::Error::Setting`] for the first that is out of range.
    pub fn validate(&self) -> Result<()> {
        let points = self.points.unwrap_or(2);
        ensure("points", points, points >= 2, "at least 2")?;
        let tolerance = self.tolerance;
        ensure("tolerance", tolerance, tolerance > 0.0, "above 0")?;
        ensure("sweeps", self.sweeps, self.sweeps >= 1, "at least 1")
    }
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            points: None,
            tolerance: 1e-7,
            sweeps: 20_000,
            memory: 1024,
        }
    }
}

/// Evenly spaced points along one variable.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Axis {
    /// First point.
    pub low: f64,
    /// Distance between points.
    pub step: f64,
    /// Number of points, at least 2.
    pub count: usize,
    /// Where points must be met to the last digit: a coordinate among them, its number, a length, and how many steps that is.
    lattice: Option<(f64, usize, f64, usize)>,
}

impl Axis {
    /// `count` points from `low` to `high`, both included.
    pub(crate) fn new(low: f64, high: f64, count: usize) -> Self {
        Self::stepped(low, (high - low) / (count - 1) as f64, count)
    }

    /// `count` points, a step apart, the first of them `low`.
    pub(crate) const fn stepped(low: f64, step: f64, count: usize) -> Self {
        Self {
            low,
            step,
            count,
            lattice: None,
        }
    }

    /// The same points, with so many times as many steps between them.
    pub(crate) fn finer(&self, factor: usize) -> Self {
        let lattice = self
            .lattice
            .map(|(place, number, length, parts)| (place, number * factor, length, parts * factor));
        Self {
            low: self.low,
            step: self.step / factor as f64,
            count: (self.count - 1) * factor + 1,
            lattice,
        }
    }

    /// The same stretch, with points at `place` and at every multiple of `length` (above 0) from it; no fewer than before.
    pub(crate) fn through(&self, place: f64, length: f64) -> Self {
        let parts = (length / self.step).ceil().max(1.0);
        let step = length / parts;
        let before = ((place - self.low) / step).ceil().max(0.0);
        let after = ((self.at(self.count - 1) - place) / step).ceil().max(0.0);
        Self {
            low: place - before * step,
            step,
            count: (before + after) as usize + 1,
            lattice: Some((place, before as usize, length, parts as usize)),
        }
    }

    /// `count` points that cover the bounds and as far beyond as what moves by `sd` a step can stray: one width and four standard
    /// deviations.
    pub(crate) fn around(bounds: Interval, sd: f64, count: usize) -> Self {
        let margin = bounds.width() + 4.0 * sd;
        Self::new(bounds.low - margin, bounds.high + margin, count)
    }

    /// Coordinate of a point.
    pub(crate) fn at(&self, index: usize) -> f64 {
        match self.lattice {
            None => self.low + self.step * index as f64,
            Some((place, number, length, parts)) => {
                place + length * (index as f64 - number as f64) / parts as f64
            }
        }
    }
}

/// How values between points are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Interpolation {
    /// Straight lines: two points a variable.
    Linear,
    /// Cubic convolution (R. G. Keys, 1981): four points a variable, error of third order.
    Cubic,
}

/// A regular grid; a function on it is a slice of [`Grid::len`] values, the last variable running fastest.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Grid {
    axes: Vec<Axis>,
    strides: Vec<usize>,
    len: usize,
    interpolation: Interpolation,
}

/// Weights of the points around a coordinate, along one axis; at most four.
#[derive(Debug, Clone, Copy)]
struct Taps {
    first: isize,
    weights: [f64; 4],
    count: usize,
}

impl Taps {
    fn new(position: f64, interpolation: Interpolation) -> Self {
        let cell = position.floor();
        let t = position - cell;
        if t == 0.0 {
            return Self {
                first: cell as isize,
                weights: [1.0, 0.0, 0.0, 0.0],
                count: 1,
            };
        }
        match interpolation {
            Interpolation::Linear => Self {
                first: cell as isize,
                weights: [1.0 - t, t, 0.0, 0.0],
                count: 2,
            },
            Interpolation::Cubic => {
                let (t2, t3) = (t * t, t * t * t);
                let weights = [
                    -0.5 * t3 + t2 - 0.5 * t,
                    1.5 * t3 - 2.5 * t2 + 1.0,
                    -1.5 * t3 + 2.0 * t2 + 0.5 * t,
                    0.5 * t3 - 0.5 * t2,
                ];
                Self {
                    first: cell as isize - 1,
                    weights,
                    count: 4,
                }
            }
        }
    }
}

impl Grid {
    /// A grid over the axes, first variable first.
    pub(crate) fn new(axes: Vec<Axis>, interpolation: Interpolation) -> Self {
        let mut strides = vec![1; axes.len()];
        for i in (0..axes.len().saturating_sub(1)).rev() {
            strides[i] = strides[i + 1] * axes[i + 1].count;
        }
        let len = axes.iter().map(|axis| axis.count).product();
        Self {
            axes,
            strides,
            len,
            interpolation,
        }
    }

    /// Number of points.
    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// The axes.
    pub(crate) fn axes(&self) -> &[Axis] {
        &self.axes
    }

    /// Whether a place is on it.
    pub(crate) fn contains(&self, at: &[f64]) -> bool {
        self.axes.iter().zip(at).all(|(axis, x)| {
            let (low, high) = (axis.at(0), axis.at(axis.count - 1));
            let slack = 1e-9 * (high - low);
            (low - slack..=high + slack).contains(x)
        })
    }

    /// Coordinates of a point.
    pub(crate) fn point(&self, index: usize) -> Vec<f64> {
        self.axes
            .iter()
            .zip(&self.strides)
            .map(|(axis, stride)| axis.at(index / stride % axis.count))
            .collect()
    }

    /// The function between the points; outside the grid it keeps the value at the edge.
    pub(crate) fn interpolate(&self, values: &[f64], at: &[f64]) -> f64 {
        self.interpolate_from(values, at, 0, 0)
    }

    fn interpolate_from(&self, values: &[f64], at: &[f64], variable: usize, offset: usize) -> f64 {
        if variable == self.axes.len() {
            return values[offset];
        }
        let axis = self.axes[variable];
        let last = (axis.count - 1) as f64;
        let taps = Taps::new(
            ((at[variable] - axis.low) / axis.step).clamp(0.0, last),
            self.interpolation,
        );
        let mut sum = 0.0;
        for k in 0..taps.count {
            let index = (taps.first + k as isize).clamp(0, axis.count as isize - 1) as usize;
            sum += taps.weights[k]
                * self.interpolate_from(
                    values,
                    at,
                    variable + 1,
                    offset + index * self.strides[variable],
                );
        }
        sum
    }

    /// The points around a place with their weights, which sum to 1; beyond the edge, those of the edge.
    pub(crate) fn around(&self, at: &[f64]) -> Vec<(usize, f64)> {
        let mut around = vec![(0, 1.0)];
        for ((axis, stride), x) in self.axes.iter().zip(&self.strides).zip(at) {
            let last = (axis.count - 1) as f64;
            let position = ((x - axis.low) / axis.step).clamp(0.0, last);
            let taps = Taps::new(position, self.interpolation);
            let before = std::mem::take(&mut around);
            for (offset, weight) in before {
                for k in 0..taps.count {
                    let index = (taps.first + k as isize).clamp(0, axis.count as isize - 1);
                    around.push((offset + index as usize * stride, weight * taps.weights[k]));
                }
            }
        }
        around
    }

    /// The points before and after a point along an axis; `None` at its ends.
    pub(crate) fn beside(&self, point: usize, axis: usize) -> Option<[usize; 2]> {
        let (count, stride) = (self.axes[axis].count, self.strides[axis]);
        let number = point / stride % count;
        let inside = 0 < number && number + 1 < count;
        inside.then(|| [point - stride, point + stride])
    }

    /// The average of a function around every point: `W(x) = E V(x + e)`, `e ~ N(0, covariance)`.
    pub(crate) fn smoother(&self, covariance: &DMatrix<f64>) -> Smoother {
        let directions = square_root(covariance);
        let rule = normal_trapezoid();
        let passes = directions.column_iter().map(|direction| {
            let mut kernel: Vec<(Vec<isize>, f64)> = Vec::new();
            for &(x, weight) in &rule {
                let taps: Vec<Taps> = self
                    .axes
                    .iter()
                    .zip(direction.iter())
                    .map(|(axis, d)| Taps::new(snap(x * d / axis.step), self.interpolation))
                    .collect();
                add_product(&taps, weight, &mut Vec::new(), &mut kernel);
            }
            kernel
        });
        Smoother {
            passes: passes.collect(),
        }
    }
}

/// Evenly spaced nodes and weights for expectations under N(0, 1). Values have kinks where the best action changes, which a rule
/// of high order handles badly; this one loses nothing on a kink and is as good as exact on smooth parts.
fn normal_trapezoid() -> Vec<(f64, f64)> {
    const REACH: f64 = 6.0;
    const STEP: f64 = 1.0 / 16.0;
    let half = (REACH / STEP) as i32;
    let nodes = (-half..=half).map(|k| f64::from(k) * STEP);
    let total: f64 = nodes.clone().map(normal_density).sum();
    nodes.map(|x| (x, normal_density(x) / total)).collect()
}

/// Offsets that are whole numbers but for rounding need one point and not four.
fn snap(offset: f64) -> f64 {
    if (offset - offset.round()).abs() < 1e-9 {
        offset.round()
    } else {
        offset
    }
}

fn add_product(
    taps: &[Taps],
    weight: f64,
    prefix: &mut Vec<isize>,
    kernel: &mut Vec<(Vec<isize>, f64)>,
) {
    let Some((first, rest)) = taps.split_first() else {
        match kernel.iter_mut().find(|(offset, _)| offset == prefix) {
            Some((_, total)) => *total += weight,
            None => kernel.push((prefix.clone(), weight)),
        }
        return;
    };
    for k in 0..first.count {
        prefix.push(first.first + k as isize);
        add_product(rest, weight * first.weights[k], prefix, kernel);
        prefix.pop();
    }
}

/// Averages functions on a grid over a Gaussian. A Gaussian is a sum of independent ones along the columns of a square root of
/// its covariance, so it is done one column at a time, each with a fixed pattern of neighbours and weights.
#[derive(Debug, Clone)]
pub(crate) struct Smoother {
    passes: Vec<Vec<(Vec<isize>, f64)>>,
}

impl Smoother {
    /// Applies the average to `values`, which has [`Grid::len`] entries.
    pub(crate) fn apply(&self, grid: &Grid, values: &[f64]) -> Vec<f64> {
        let mut current = values.to_vec();
        for kernel in &self.passes {
            current = convolve(grid, &current, kernel);
        }
        current
    }
}

fn convolve(grid: &Grid, values: &[f64], kernel: &[(Vec<isize>, f64)]) -> Vec<f64> {
    let dims = grid.axes.len();
    let row = grid.axes[dims - 1].count;
    let rows = grid.len / row;
    let mut result = vec![0.0; grid.len];
    for r in 0..rows {
        let target = &mut result[r * row..(r + 1) * row];
        for (offset, weight) in kernel {
            let shifts = offset
                .iter()
                .zip(&grid.axes)
                .zip(&grid.strides)
                .take(dims - 1);
            let source: usize = shifts
                .map(|((shift, axis), stride)| {
                    let index = (r * row / stride % axis.count) as isize + shift;
                    index.clamp(0, axis.count as isize - 1) as usize * stride
                })
                .sum();
            add_shifted(
                target,
                &values[source..source + row],
                offset[dims - 1],
                *weight,
            );
        }
    }
    result
}

/// `target[i] += weight * source[i + shift]`, the ends of `source` repeated.
fn add_shifted(target: &mut [f64], source: &[f64], shift: isize, weight: f64) {
    let n = target.len();
    let below = (-shift).clamp(0, n as isize) as usize;
    let inside_end = (n as isize - shift).clamp(below as isize, n as isize) as usize;
    for value in &mut target[..below] {
        *value += weight * source[0];
    }
    if inside_end > below {
        let start = (below as isize + shift) as usize;
        for (value, x) in target[below..inside_end].iter_mut().zip(&source[start..]) {
            *value += weight * x;
        }
    }
    for value in &mut target[inside_end..] {
        *value += weight * source[n - 1];
    }
}
