//! Where the cells of a model lie.

use super::grid::{Axis, Grid};
use super::unsupported;
use crate::error::Result;
use crate::model::{Doing, Dynamics, Interval, Model, VariableKind};

/// Cells along a variable where the model does not say, for one and for two variables.
const CELLS: [usize; 2] = [200, 40];

/// Most cells in all, modes apart.
const MOST: usize = 100_000;

/// Where a variable has no bound, cells go so many standard deviations beyond every start.
const SPREAD: f64 = 5.0;

/// And as far as the strongest control leads in so many steps, with as much of its noise.
const STEPS: f64 = 10.0;

/// The cells of a model: between the bounds of each variable. Where there is no bound they reach from the starts (5 standard
/// deviations) and the places of which rewards and events speak as far as the controls lead from the starts in ten steps, three
/// standard deviations of that many steps' noise included. Whole numbers have a cell each, and the cells of a map's squares are whole.
pub(super) fn grid(model: &Model, dynamics: &Dynamics) -> Result<Grid> {
    let n = model.state_dim();
    let Some(usual) = n.checked_sub(1).and_then(|i| CELLS.get(i)) else {
        return Err(unsupported(
            model,
            format!(
                "it has {n} state variables, and cells are kept of one or two; set `tracker = \"sum\"` in [belief]"
            ),
        ));
    };
    let count = model.belief.cells.unwrap_or(*usual).max(2);
    let axes: Vec<Axis> = (0..n)
        .map(|i| axis(model, i, extent(model, dynamics, i), count))
        .collect();
    let all = axes.iter().map(|axis| axis.count as f64).product::<f64>();
    if all > MOST as f64 || all.is_nan() {
        return Err(unsupported(
            model,
            format!(
                "its bounds hold {all} cells, and at most {MOST} are kept; narrow the bounds, or set `tracker = \"sum\"` in [belief]"
            ),
        ));
    }
    Ok(Grid { axes })
}

fn axis(model: &Model, variable: usize, extent: Interval, count: usize) -> Axis {
    let kind = model.state[variable].kind;
    let (low, high, count) = match kind {
        VariableKind::Integer => {
            let (low, high) = (
                extent.low.ceil(),
                extent.high.floor().max(extent.low.ceil()),
            );
            (low - 0.5, high + 0.5, (high - low) as usize + 1)
        }
        VariableKind::Angle => (-std::f64::consts::PI, std::f64::consts::PI, count),
        VariableKind::Real => (
            extent.low,
            extent.high,
            whole_squares(model, variable, count),
        ),
    };
    Axis {
        low,
        width: (high - low) / count as f64,
        count,
        kind,
    }
}

/// The least number of cells, at least `count`, of which a square of the map has a whole number.
fn whole_squares(model: &Model, variable: usize, count: usize) -> usize {
    let side = model.map.as_ref().and_then(|map| {
        let extent = map.extent();
        extent.get(variable).map(|side| side.width() / map.cell)
    });
    side.map_or(count, |squares| {
        count.next_multiple_of((squares.round() as usize).max(1))
    })
}

fn extent(model: &Model, dynamics: &Dynamics, variable: usize) -> Interval {
    let bounds = model.state[variable].bounds;
    if bounds.low.is_finite() && bounds.high.is_finite() {
        return bounds;
    }
    let starts = model.start.iter().flat_map(|start| {
        let reach = SPREAD * start.covariance[(variable, variable)].max(0.0).sqrt();
        [start.mean[variable] - reach, start.mean[variable] + reach]
    });
    let rewards = model.rewards.iter().map(|reward| &reward.region);
    let regions = rewards.chain(model.events.iter().map(|event| &event.region));
    let sides = regions.map(|region| region.side(variable));
    let ends = sides.flat_map(|side| [side.low, side.high]);
    let places = starts.chain(ends).filter(|place| place.is_finite());
    let (low, high) = places.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), place| {
        (low.min(place), high.max(place))
    });
    let reach = reach(model, dynamics, variable);
    let end = |bound: f64, else_: f64| if bound.is_finite() { bound } else { else_ };
    let low = end(bounds.low, low - reach);
    // Starts that are known exactly, and do not move, still need a cell.
    let high = end(bounds.high, high + reach).max(low + 1e-6 * low.abs().max(1.0));
    Interval::new(low, high)
}

/// How far the controls lead along a variable from the starts within reason.
fn reach(model: &Model, dynamics: &Dynamics, variable: usize) -> f64 {
    let n = model.state_dim();
    let (mut to, mut noise) = (vec![0.0; n], vec![0.0; n * n]);
    let mut farthest = 0.0f64;
    for start in &model.start {
        for action in 0..model.actions.len() {
            let doing = Doing {
                mode: start.mode,
                action,
                step: 0,
            };
            let from = start.mean.as_slice();
            dynamics.transition(doing, from, &mut to);
            dynamics.transition_noise(doing, from, &mut noise);
            let variance = noise[variable * (n + 1)].max(0.0);
            let step = (to[variable] - from[variable]).abs();
            farthest = farthest.max(STEPS * step + 3.0 * (STEPS * variance).sqrt());
        }
    }
    farthest
}
