//! Where the grid of closed-loop KBVI lies, how fine it is and how much memory it takes.

use super::closed::Settings;
use crate::belief::{BeliefMdp, LevelId};
use crate::error::{Error, Result};
use crate::model::{Model, WallBelief};
use crate::solve::grid::Axis;
use crate::solve::walled::WalledSmoother;

/// The grid covers the bounds and as far beyond as the mean can stray. Where the belief knows of walls it ends at them.
pub(super) fn axes(mdp: &BeliefMdp, settings: &Settings) -> Result<Vec<Axis>> {
    let model = mdp.model();
    let n = model.state_dim();
    let points = match (settings.points, n) {
        (Some(points), _) => points,
        (None, 1) => 1601,
        (None, 2) if knows_map(mdp) => points_of_map(model),
        (None, 2) => 241,
        (None, 3) => 61,
        (None, _) => {
            return Err(Error::Unsupported {
                solver: "kbvi-closed",
                model: model.name.clone(),
                reason: format!(
                    "a grid in {n} variables is too coarse to be right; state the problem in at most 3, add failure limits (`alive` in [episode]), which are planned for without a grid, or set the points of the grid (--grid)"
                ),
            });
        }
    };
    let total = (points as u64).saturating_pow(n as u32);
    let mebibytes = mebibytes(mdp, total);
    if mebibytes > settings.memory {
        return Err(Error::TooLarge {
            model: model.name.clone(),
            points: total.saturating_mul(functions(mdp)),
            mebibytes,
            limit: settings.memory,
        });
    }
    let axes = (0..n).map(|variable| {
        let bounds = model.state[variable].bounds;
        if model.belief.walls == WallBelief::Clip {
            return Axis::new(bounds.low, bounds.high, points);
        }
        let largest = |level: LevelId, class: usize| mdp.spread(level, class)[(variable, variable)];
        let levels = 0..mdp.levels().len();
        let classes = mdp.levels().classes().len();
        let variance = levels
            .flat_map(|level| (0..classes).map(move |class| (level, class)))
            .map(|(l, c)| largest(l, c))
            .fold(0.0, f64::max);
        Axis::around(bounds, variance.sqrt(), points)
    });
    Ok(axes.collect())
}

/// Functions kept on the grid: values, expectations and probabilities of failing.
fn functions(mdp: &BeliefMdp) -> u64 {
    let (levels, classes) = (mdp.levels().len(), mdp.levels().classes().len());
    let limits = usize::from(!mdp.model().episode.alive.sides.is_empty());
    (levels * (mdp.model().modes.len() * (1 + classes) + limits)) as u64
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
