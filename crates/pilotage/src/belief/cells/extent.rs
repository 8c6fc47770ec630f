//! Where the cells of a model lie.

use super::grid::{Axis, Grid};
use super::unsupported;
use crate::error::Result;
use crate::model::{Dynamics, Interval, Model, StartHypothesis, VariableKind};

/// Cells along a variable where the model does not say, for one and for two variables.
const CELLS: [usize; 2] = [200, 40];

/// Most cells in all, modes apart.
const MOST: usize = 100_000;

/// Fewest cells along a variable where the model does not say, and how many lie at least in a standard deviation of all noise, and in the
/// narrowest place where something is paid or happens, for one and for two variables: finer ones say little more.
const FEWEST: [f64; 2] = [40.0, 16.0];
const WITHIN: [f64; 2] = [8.0, 2.0];

/// Where a variable has no bound, cells go so many standard deviations beyond every start.
const SPREAD: f64 = 5.0;

/// A bound so many times farther from the middle of all that is within reach than the end of that is far: cells of one width out to it would
/// be coarse where it matters, and so they grow.
const FAR: f64 = 3.0;

/// Where bounds are no walls, cells go on beyond them for at most this share of their width, for one and for two variables.
const BEYOND: [f64; 2] = [0.5, 0.25];

/// And as far as the strongest control leads in so many steps, with as much of its noise.
const STEPS: f64 = 10.0;

/// The cells of a model: between the bounds of each variable, and beyond them as far as the controls lead in ten steps if they are no
/// walls to the belief, at most half of their width for one variable and a quarter for two. Where there is no bound, or one three times
/// farther out than anything else, they reach from the starts (5 standard deviations) and the places of which rewards and events speak as
/// far as actions lead from the starts in ten steps, three standard deviations of that many steps' noise included; from there to the
/// bound each is a tenth wider than the one before. Walls have a thin cell of their own on the side on which one stands. Whole numbers have
/// a cell each, squares of a map whole cells, and up to a quarter more cells are taken if controls then lead across whole ones.
pub(super) fn grid(model: &Model, dynamics: &Dynamics) -> Result<Grid> {
    let n = model.state_dim();
    if !(1..=CELLS.len()).contains(&n) {
        return Err(unsupported(
            model,
            format!(
                "it has {n} state variables, and cells are kept of one or two; set `tracker = \"sum\"` in [belief]"
            ),
        ));
    }
    let count = |variable: usize| match model.belief.cells {
        Some(cells) => cells.max(2),
        None => enough(model, dynamics, variable),
    };
    let axes: Vec<Axis> = (0..n).map(|i| axis(model, dynamics, i, count(i))).collect();
    let all = axes.iter().map(|axis| axis.count() as f64).product::<f64>();
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

fn axis(model: &Model, dynamics: &Dynamics, variable: usize, count: usize) -> Axis {
    let kind = model.state[variable].kind;
    let extent = extent(model, dynamics, variable);
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
            match model.map {
                Some(_) => whole_squares(model, variable, count),
                None => whole_steps(model, dynamics, variable, extent.width(), count),
            },
        ),
    };
    let width = (high - low) / count as f64;
    let beyond = match kind {
        VariableKind::Angle => [0, 0],
        _ => beyond(model, dynamics, variable, extent).map(|by| (by / width).ceil() as usize),
    };
    let axis = Axis::new(
        low - beyond[0] as f64 * width,
        width,
        count + beyond[0] + beyond[1],
        kind,
    );
    if kind != VariableKind::Real {
        return axis;
    }
    let axis = axis.grown_to(model.state[variable].bounds);
    match dynamics.walls() {
        Some(walls) => axis.with_stops(&walls.stops(variable)),
        None => axis,
    }
}

/// How many cells it takes, and no more than usual.
fn enough(model: &Model, dynamics: &Dynamics, variable: usize) -> usize {
    let more = model.state_dim() - 1;
    let width = extent(model, dynamics, variable).width();
    match narrowest(model, dynamics, variable) {
        Some(narrowest) => {
            let count = (WITHIN[more] * width / narrowest).ceil();
            count.max(FEWEST[more]).min(CELLS[more] as f64) as usize
        }
        None => CELLS[more],
    }
}

/// The least standard deviation of all noise, in units of a variable, and side of all places where something is paid or happens; `None` if
/// there is motion or sensing without noise, or if noise or what is sensed depends on the state.
fn narrowest(model: &Model, dynamics: &Dynamics, variable: usize) -> Option<f64> {
    let (n, m) = (model.state_dim(), dynamics.readings());
    let rewards = model.rewards.iter().map(|reward| &reward.region);
    let regions = rewards.chain(model.events.iter().map(|event| &event.region));
    let sides = regions.map(|region| region.side(variable).width());
    let mut least = sides.fold(f64::INFINITY, f64::min);
    for doing in dynamics.doings() {
        let moved = dynamics.constant_transition_noise(doing)?[variable * (n + 1)];
        least = least.min(moved.max(0.0).sqrt());
        let (rows, noise) = (
            dynamics.linear_observation(doing)?,
            dynamics.constant_observation_noise(doing)?,
        );
        for k in 0..m {
            let slope = rows[k * n + variable].abs();
            if slope > 0.0 {
                least = least.min(noise[k * (m + 1)].max(0.0).sqrt() / slope);
            }
        }
    }
    (least > 0.0 && least.is_finite()).then_some(least)
}

/// How far cells go on beyond bounds that are no walls to the belief, on either side. Who goes there is as lost as before; were it the
/// border, one would know where one is.
fn beyond(model: &Model, dynamics: &Dynamics, variable: usize, extent: Interval) -> [f64; 2] {
    let bounds = model.state[variable].bounds;
    let most = extent.width() * BEYOND[model.state_dim() - 1];
    let by = match dynamics.walls() {
        Some(_) => 0.0,
        None => reach(model, dynamics, variable).min(most),
    };
    let ends = [(extent.low, bounds.low), (extent.high, bounds.high)];
    ends.map(|(end, bound)| if end == bound { by } else { 0.0 })
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

/// A number of cells, at least `count` and not many more, of which every control leads from the starts across a whole number; `count` if
/// there is none. Without noise, mass would otherwise blur with every step.
fn whole_steps(
    model: &Model,
    dynamics: &Dynamics,
    variable: usize,
    width: f64,
    count: usize,
) -> usize {
    let steps: Vec<f64> = moves(model, dynamics)
        .map(|(from, to, _)| to[variable] - from[variable])
        .collect();
    let whole = |cells: &usize| {
        steps.iter().all(|step| {
            let across = step / width * *cells as f64;
            (across - across.round()).abs() < 1e-6
        })
    };
    (count..=count + count / 4).find(whole).unwrap_or(count)
}

fn extent(model: &Model, dynamics: &Dynamics, variable: usize) -> Interval {
    let bounds = model.state[variable].bounds;
    let met = within_reach(model, dynamics, variable);
    let (middle, half) = (0.5 * (met.low + met.high), 0.5 * met.width());
    let near = |bound: f64| (bound - middle).abs() <= FAR * half;
    let end = |bound: f64, else_: f64| if near(bound) { bound } else { else_ };
    // Starts that are known exactly, and do not move, still need a cell.
    let low = end(bounds.low, met.low);
    let high = end(bounds.high, met.high).max(low + 1e-6 * low.abs().max(1.0));
    Interval::new(low, high)
}

/// The starts and the places of which rewards and events speak, and as far from there as the controls lead, bounds or not.
fn within_reach(model: &Model, dynamics: &Dynamics, variable: usize) -> Interval {
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
    Interval::new(low - reach, high + reach)
}

/// How far the controls lead along a variable from the starts within reason.
fn reach(model: &Model, dynamics: &Dynamics, variable: usize) -> f64 {
    let reach = |(from, to, noise): (Vec<f64>, Vec<f64>, Vec<f64>)| {
        let variance = noise[variable * (from.len() + 1)].max(0.0);
        STEPS * (to[variable] - from[variable]).abs() + 3.0 * (STEPS * variance).sqrt()
    };
    moves(model, dynamics).map(reach).fold(0.0, f64::max)
}

/// Where every action leads from the mean of every start, in every mode, and with which noise.
fn moves<'a>(
    model: &'a Model,
    dynamics: &'a Dynamics,
) -> impl Iterator<Item = (Vec<f64>, Vec<f64>, Vec<f64>)> + 'a {
    let n = model.state_dim();
    let of = move |start: &'a StartHypothesis| {
        dynamics.doings().map(move |doing| {
            let from = start.mean.as_slice();
            let (mut to, mut noise) = (vec![0.0; n], vec![0.0; n * n]);
            dynamics.transition(doing, from, &mut to);
            dynamics.transition_noise(doing, from, &mut noise);
            (from.to_vec(), to, noise)
        })
    };
    model.start.iter().flat_map(of)
}
