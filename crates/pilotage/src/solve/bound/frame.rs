//! A model taken apart along its axes. One variable is two of which the second never does anything.

use nalgebra::DMatrix;

use super::law::Law;
use crate::model::{ActionId, Interval, Model, Region, StartShape, WallBelief};

/// A model of at most two variables that do not mix.
#[derive(Debug)]
pub(super) struct Frame<'a> {
    pub model: &'a Model,
    pub axes: [AxisModel; 2],
    /// Noise along both axes, by class.
    pub classes: Vec<[Noise; 2]>,
    pub class_of: Vec<usize>,
    pub starts: Vec<Start>,
    /// Whether the state stops at the bounds.
    pub walled: bool,
}

/// Motion and places along one axis.
#[derive(Debug, Clone)]
pub(super) struct AxisModel {
    pub a: f64,
    /// `B u`, by action.
    pub displacement: Vec<f64>,
    /// Ends of the sides of all regions, rising.
    pub cuts: Vec<f64>,
    pub bounds: Interval,
}

/// Noise of an action along one axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Noise {
    /// Variance of the motion.
    pub motion: f64,
    /// What a reading tells, `H' R^-1 H`: infinite where it tells all.
    pub precision: f64,
}

/// A start hypothesis.
#[derive(Debug, Clone)]
pub(super) struct Start {
    pub weight: f64,
    pub mode: usize,
    pub laws: [Law; 2],
    pub uniform: bool,
}

impl<'a> Frame<'a> {
    /// # Errors
    /// Why the model cannot be taken apart.
    pub(super) fn new(model: &'a Model) -> Result<Self, String> {
        let n = model.state_dim();
        if n > 2 {
            return Err(format!(
                "it has {n} state variables, and more than 2 take too fine a grid"
            ));
        }
        if !is_diagonal(&model.motion.a) {
            return Err("its motion mixes the state variables".to_owned());
        }
        let mut classes: Vec<[Noise; 2]> = Vec::new();
        let mut class_of = Vec::new();
        for action in 0..model.actions.len() {
            let noise = noise(model, action)?;
            let known = classes.iter().position(|class| *class == noise);
            class_of.push(known.unwrap_or_else(|| {
                classes.push(noise);
                classes.len() - 1
            }));
        }
        let displacements: Vec<_> = (0..model.actions.len())
            .map(|action| model.displacement(action, 0))
            .collect();
        let axis = |i: usize| match i < n {
            true => AxisModel {
                a: model.motion.a[(i, i)],
                displacement: displacements.iter().map(|d| d[i]).collect(),
                cuts: cuts(model, i),
                bounds: model.state[i].bounds,
            },
            false => AxisModel {
                a: 1.0,
                displacement: vec![0.0; displacements.len()],
                cuts: Vec::new(),
                bounds: Interval::ALL,
            },
        };
        Ok(Self {
            axes: [axis(0), axis(1)],
            classes,
            class_of,
            starts: starts(model)?,
            walled: model.belief.walls == WallBelief::Clip,
            model,
        })
    }

    /// Whether the axis is that of a state variable.
    pub(super) fn is_real(&self, axis: usize) -> bool {
        axis < self.model.state_dim()
    }

    /// A state of the model at two coordinates.
    pub(super) fn state<'b>(&self, at: &'b [f64; 2]) -> &'b [f64] {
        &at[..self.model.state_dim()]
    }

    pub(super) fn noise(&self, action: ActionId, axis: usize) -> Noise {
        self.classes[self.class_of[action]][axis]
    }

    /// A stretch of an axis in which everything happens that matters: bounds, starts and, unless they are far off, regions.
    pub(super) fn core(&self, axis: usize) -> Interval {
        let AxisModel { bounds, cuts, .. } = &self.axes[axis];
        let mut core = Interval::new(f64::INFINITY, f64::NEG_INFINITY);
        let mut hold = |x: f64| {
            if x.is_finite() {
                core = Interval::new(core.low.min(x), core.high.max(x));
            }
        };
        hold(bounds.low);
        hold(bounds.high);
        for start in &self.starts {
            hold(start.laws[axis].low);
            hold(start.laws[axis].high);
        }
        let near = match bounds.width().is_finite() {
            true => Interval::new(core.low - bounds.width(), core.high + bounds.width()),
            false => Interval::ALL,
        };
        for &cut in cuts.iter().filter(|&&cut| near.contains(cut)) {
            core = Interval::new(core.low.min(cut), core.high.max(cut));
        }
        match core.width() > 0.0 {
            true => core,
            false => Interval::new(core.low - 0.5, core.high + 0.5),
        }
    }
}

fn noise(model: &Model, action: ActionId) -> Result<[Noise; 2], String> {
    let motion = model.motion_noise(action, 0);
    if !is_diagonal(motion) {
        return Err("the motion noise of its variables is correlated".to_owned());
    }
    let precision = precision(&model.sensor.h, model.sensor_noise(action, 0))
        .ok_or("its readings mix the state variables")?;
    let along = |i: usize| match i < model.state_dim() {
        true => Noise {
            motion: motion[(i, i)].max(0.0),
            precision: precision[i],
        },
        false => Noise {
            motion: 0.0,
            precision: f64::INFINITY,
        },
    };
    Ok([along(0), along(1)])
}

/// The diagonal of `H' R^-1 H`, where it is one.
fn precision(h: &DMatrix<f64>, r: &DMatrix<f64>) -> Option<Vec<f64>> {
    let of_one = |row: usize| h.row(row).iter().filter(|entry| **entry != 0.0).count() <= 1;
    if is_diagonal(r) && (0..h.nrows()).all(of_one) {
        let told = |row: usize, i: usize| match h[(row, i)] == 0.0 {
            true => 0.0,
            false => h[(row, i)].powi(2) / r[(row, row)].max(0.0),
        };
        let of_variable = |i| (0..h.nrows()).map(|row| told(row, i)).sum();
        return Some((0..h.ncols()).map(of_variable).collect());
    }
    let information = h.transpose() * r.clone().cholesky()?.solve(h);
    is_diagonal(&information).then(|| information.diagonal().iter().copied().collect())
}

fn is_diagonal(matrix: &DMatrix<f64>) -> bool {
    (0..matrix.nrows()).all(|i| {
        (0..matrix.ncols()).all(|j| {
            let scale = (matrix[(i, i)] * matrix[(j, j)]).abs().sqrt();
            i == j || matrix[(i, j)].abs() <= 1e-13 * scale
        })
    })
}

fn starts(model: &Model) -> Result<Vec<Start>, String> {
    let start = |start: &crate::model::StartHypothesis| {
        if !is_diagonal(&start.covariance) {
            return Err("the variables of a start are correlated".to_owned());
        }
        let law = |i: usize| match (i < model.state_dim(), start.shape) {
            (false, _) => Law::normal(0.0, 0.0),
            (true, StartShape::Normal) => {
                Law::normal(start.mean[i], start.covariance[(i, i)].max(0.0).sqrt())
            }
            (true, StartShape::Uniform) => {
                let half = 0.5 * (12.0 * start.covariance[(i, i)]).max(0.0).sqrt();
                Law {
                    low: start.mean[i] - half,
                    high: start.mean[i] + half,
                    sd: 0.0,
                }
            }
        };
        Ok(Start {
            weight: start.weight,
            mode: start.mode,
            laws: [law(0), law(1)],
            uniform: start.shape == StartShape::Uniform,
        })
    };
    model.start.iter().map(start).collect()
}

/// Ends of the sides of all regions along an axis, rising.
pub(super) fn cuts(model: &Model, axis: usize) -> Vec<f64> {
    let rewards = model.rewards.iter().map(|reward| &reward.region);
    let events = model.events.iter().map(|event| &event.region);
    let regions = rewards.chain(events).chain([&model.episode.alive]);
    let ends = |region: &Region| {
        let sides = region
            .sides
            .iter()
            .filter(|(variable, _)| *variable == axis);
        let ends = sides.flat_map(|(_, side)| [side.low, side.high]);
        ends.filter(|end| end.is_finite()).collect::<Vec<_>>()
    };
    let mut cuts: Vec<f64> = regions.flat_map(ends).collect();
    cuts.sort_by(f64::total_cmp);
    cuts.dedup();
    cuts
}

/// A coordinate inside each cell between rising cuts, one more than those.
pub(super) fn inside(cuts: &[f64]) -> Vec<f64> {
    let (Some(&first), Some(&last)) = (cuts.first(), cuts.last()) else {
        return vec![0.0];
    };
    let mut inside = vec![first - first.abs().max(1.0)];
    inside.extend(cuts.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])));
    inside.push(last + last.abs().max(1.0));
    inside
}
