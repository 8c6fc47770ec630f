//! Where the grid of value iteration lies, how fine it is and how much memory it takes.

use super::SOLVER;
use crate::belief::{BeliefMdp, StratumId};
use crate::error::{Error, Result};
use crate::memory;
use crate::model::{Map, Model, Region, WallBelief};
use crate::solve::grid::{Axis, Settings};
use crate::solve::walled::WalledSmoother;

/// The grid covers the bounds and as far beyond as the mean can stray. Where the belief knows of walls it ends at them. Along a variable
/// without any noise it has points at all the means that the controls lead to.
///
/// # Errors
/// [`Error::Unsupported`] for too many variables, for rewards or events that lie where the grid does not reach or that are too narrow for
/// the points asked for; [`Error::TooLarge`] and [`Error::OutOfMemory`] where it does not fit the memory.
pub(super) fn axes(mdp: &BeliefMdp, settings: &Settings) -> Result<Vec<Axis>> {
    let model = mdp.model();
    let n = model.state_dim();
    let points = match (settings.points, n) {
        (Some(points), _) => points,
        (None, 1) => 1601,
        (None, 2) if knows_map(mdp) => points_of_map(model),
        (None, 2) => 241,
        (None, 3) => 61,
        (None, _) => return Err(unsupported(model, too_many_variables(n))),
    };
    let axes: Vec<Axis> = (0..n).map(|variable| axis(mdp, variable, points)).collect();
    within_reach(model, &axes)?;
    let size = |axes: &[Axis]| {
        let count = |total: u64, axis: &Axis| total.saturating_mul(axis.count as u64);
        axes.iter().fold(1, count)
    };
    let wanted = match settings.points {
        Some(_) => axes.clone(),
        None => (axes.iter().enumerate())
            .map(|(variable, axis)| refined(axis, scale(mdp, variable, FINE)))
            .collect(),
    };
    let axes = match mebibytes(mdp, size(&wanted)) <= settings.memory {
        true => wanted,
        false => axes,
    };
    let total = size(&axes);
    let mebibytes = mebibytes(mdp, total);
    let all = total.saturating_mul(functions(mdp));
    memory::check(&model.name, all, mebibytes, settings.memory)?;
    resolves(mdp, &axes)?;
    Ok(axes)
}

/// Most variables in which a grid is fine enough unless it is said how fine it shall be.
pub(super) const MOST_VARIABLES: usize = 3;

/// Why a grid in so many variables is refused, and what would do.
pub(super) fn too_many_variables(n: usize) -> String {
    format!(
        "a grid in {n} variables is too coarse to be right; use policy-search, which needs none, state the problem in at most {MOST_VARIABLES}, or set the points of the grid (--grid)"
    )
}

fn unsupported(model: &Model, reason: String) -> Error {
    Error::Unsupported {
        solver: SOLVER,
        model: model.name.clone(),
        reason,
    }
}

fn axis(mdp: &BeliefMdp, variable: usize, points: usize) -> Axis {
    let model = mdp.model();
    let bounds = model.state[variable].bounds;
    if model.belief.walls == WallBelief::Clip {
        return Axis::new(bounds.low, bounds.high, points);
    }
    let largest = |stratum: StratumId, class: usize| {
        mdp.mean_covariance(stratum, class)[(variable, variable)]
    };
    let strata = 0..mdp.strata();
    let classes = mdp.classes();
    let variance = strata
        .flat_map(|stratum| (0..classes).map(move |class| (stratum, class)))
        .map(|(l, c)| largest(l, c))
        .fold(0.0, f64::max);
    let axis = Axis::around(bounds, variance.sqrt(), points);
    match stride(model, variable) {
        Some(length) if variance == 0.0 => axis.through(mdp.start().mean[variable], length),
        _ => axis,
    }
}

/// The length of which all ways that actions take along a variable are multiples, where it moves by them alone.
fn stride(model: &Model, variable: usize) -> Option<f64> {
    const FINEST: f64 = 1e-6;
    let stays = model.phases().all(|step| {
        let row = model.motion_at(step).a.row(variable);
        let mut entries = row.iter().enumerate();
        entries.all(|(i, a)| *a == f64::from(i == variable))
    });
    let actions = 0..model.actions.len();
    let ways = model.phases().flat_map(|step| {
        let way = move |action| model.displacement(action, step)[variable].abs();
        actions.clone().map(way)
    });
    let ways: Vec<f64> = ways.filter(|way| *way > 0.0).collect();
    let largest = ways.iter().copied().fold(0.0, f64::max);
    let common = ways.iter().fold(0.0, |mut a: f64, &b| {
        let mut b = b;
        while b > FINEST * largest {
            let rest = a % b;
            // What is left but for rounding is nothing, or all of it.
            let rest = if b - rest < FINEST * largest {
                0.0
            } else {
                rest
            };
            (a, b) = (b, rest);
        }
        a
    });
    (stays && common > FINEST * largest).then_some(common)
}

/// What lies in places that the belief or the world rules out is not paid by anybody; what lies where the grid does not reach would be
/// paid, and not planned for.
fn within_reach(model: &Model, axes: &[Axis]) -> Result<()> {
    let solid = model.map.as_ref().map(Map::solid).unwrap_or_default();
    for (what, region) in paid_places(model) {
        if solid.contains(region) {
            continue;
        }
        for &(variable, side) in &region.sides {
            let (low, high) = (
                axes[variable].low,
                axes[variable].at(axes[variable].count - 1),
            );
            if side.high <= low || side.low >= high {
                return Err(unsupported(
                    model,
                    format!(
                        "{what} lies in {} = [{}, {}], and its bounds let planners look from {low} to {high} only; widen `state.bounds`, or delete it",
                        model.state[variable].name, side.low, side.high
                    ),
                ));
            }
        }
    }
    Ok(())
}

/// Places where something is paid or changed, with their names.
fn paid_places(model: &Model) -> impl Iterator<Item = (String, &Region)> {
    let rewards = model.rewards.iter().enumerate();
    let rewards = rewards.map(|(i, term)| (format!("reward {}", i + 1), &term.region));
    let events = model.events.iter().enumerate();
    rewards.chain(events.map(|(i, event)| (format!("event {}", i + 1), &event.region)))
}

/// Points to a place where something is paid, where the default of the grid can be chosen; and the least that will do.
const FINE: f64 = 20.0;
const COARSE: f64 = 1.0;

/// How far apart points may be along a variable: the expected reward of a belief changes over a length of the narrowest place where
/// something is paid, which `points` of them resolve, or over the belief's own width where that is more, which two do.
fn scale(mdp: &BeliefMdp, variable: usize, points: f64) -> f64 {
    let variance = |stratum| mdp.covariance(stratum)[(variable, variable)];
    let least = (0..mdp.strata())
        .map(variance)
        .fold(f64::INFINITY, f64::min);
    let widths = paid_places(mdp.model()).map(|(_, region)| region.side(variable).width());
    let narrowest = widths.fold(f64::INFINITY, f64::min);
    (narrowest / points).max(0.5 * least.max(0.0).sqrt())
}

/// The axis with points no farther apart than that.
fn refined(axis: &Axis, apart: f64) -> Axis {
    const MOST: f64 = 1e7;
    let factor = (axis.step / apart).ceil().min(MOST / axis.count as f64);
    match factor > 1.0 {
        true => axis.finer(factor as usize),
        false => *axis,
    }
}

/// Without the last digits of a difference.
fn rounded(length: f64) -> f64 {
    (length * 1e9).round() / 1e9
}

/// Whether nothing that is paid falls between two points.
fn resolves(mdp: &BeliefMdp, axes: &[Axis]) -> Result<()> {
    let model = mdp.model();
    for (variable, axis) in axes.iter().enumerate() {
        let apart = scale(mdp, variable, COARSE);
        if axis.step <= apart {
            continue;
        }
        let width = |region: &Region| region.side(variable).width();
        let narrowest = paid_places(model).min_by(|a, b| width(a.1).total_cmp(&width(b.1)));
        let what = narrowest.map_or_else(String::new, |(what, region)| {
            format!("{what} is {} wide", rounded(width(region)))
        });
        return Err(unsupported(
            model,
            format!(
                "{what} along {}, and the points of the grid are {} apart; give at least {} points (--grid), more memory, or narrower bounds",
                model.state[variable].name,
                rounded(axis.step),
                ((axis.count - 1) as f64 * axis.step / apart).ceil() + 1.0
            ),
        ));
    }
    Ok(())
}

/// Kinds of expectations: after a reading, and after none where one may be missing.
pub(super) fn kinds(mdp: &BeliefMdp) -> usize {
    if mdp.model().misses_readings() { 2 } else { 1 }
}

/// Functions kept on the grid: values, expectations and probabilities of failing.
fn functions(mdp: &BeliefMdp) -> u64 {
    let (strata, classes) = (mdp.strata(), mdp.classes());
    let limits = usize::from(!mdp.model().episode.alive.sides.is_empty());
    let expectations = classes * kinds(mdp);
    (strata * (mdp.model().modes.len() * (1 + expectations) + limits)) as u64
}

/// Memory for the functions on a grid of so many points.
pub(super) fn mebibytes(mdp: &BeliefMdp, points: u64) -> u64 {
    let walled = match knows_map(mdp) {
        true => WalledSmoother::bytes(points, mdp.model().state_dim()),
        false => 0,
    };
    let each = points.saturating_mul(8).saturating_add(walled);
    each.saturating_mul(functions(mdp)) >> 20
}

/// Bytes of what one action looks up at a point, about.
pub(super) const LOOK_UP: usize = 200;

/// Whether there is room for the functions on a grid of so many points, and for what a sweep over so many levels looks up there.
///
/// # Errors
/// [`Error::OutOfMemory`] where more is needed than is free.
pub(super) fn sweep_fits(mdp: &BeliefMdp, points: usize, levels: usize) -> Result<()> {
    let (model, points) = (mdp.model(), points as u64);
    let looked_up = [levels, model.modes.len(), model.actions.len(), LOOK_UP];
    let bytes = looked_up
        .iter()
        .fold(points, |bytes, &count| bytes.saturating_mul(count as u64));
    let needed = mebibytes(mdp, points).saturating_add(bytes >> 20);
    let all = points.saturating_mul(functions(mdp));
    memory::check(&model.name, all, needed, u64::MAX)
}

/// Four points a cell, so that the sides of cells are among them, and at least 41.
fn points_of_map(model: &Model) -> usize {
    let cells = model.map.as_ref().map_or(0, |map| {
        let [east, north] = map.extent();
        (east.width().max(north.width()) / map.cell).round() as usize
    });
    (4 * cells + 1).max(41)
}

/// Whether the belief knows of walls inside its bounds.
pub(super) fn knows_map(mdp: &BeliefMdp) -> bool {
    mdp.model().map.is_some() && mdp.model().belief.walls == WallBelief::Clip
}
