//! Points of means, between which values are read, though never through a wall.

use std::sync::Arc;

use crate::model::{Barriers, Dynamics, Model};
use crate::solve::grid::Grid;

/// A grid of means in a world that may have walls.
#[derive(Debug, Clone)]
pub(super) struct Means {
    pub grid: Grid,
    /// The walls of a map that beliefs know of.
    walls: Option<Arc<Barriers>>,
}

/// Who stands at a wall is this share of the distance between points away from it at most.
const AT: f64 = 1e-3;

impl Means {
    pub(super) fn new(model: &Model, grid: Grid) -> Self {
        let dynamics = Dynamics::new(model);
        let walls = dynamics.walls().filter(|walls| walls.map.is_some());
        Self {
            grid,
            walls: walls.map(|walls| Arc::new(walls.clone())),
        }
    }

    /// The points around a mean with their weights, which sum to 1: of those that a wall hides, none, unless it hides all.
    pub(super) fn around(&self, mean: &[f64]) -> Vec<(usize, f64)> {
        let around = self.grid.around(mean);
        let Some(walls) = &self.walls else {
            return around;
        };
        let is_seen = |(point, _): &&(usize, f64)| {
            let there = self.grid.point(*point);
            let mut stopped = there.clone();
            walls.stop(mean, &mut stopped);
            let axes = self.grid.axes().iter();
            let apart = stopped.iter().zip(&there).map(|(a, b)| (a - b).abs());
            axes.zip(apart).all(|(axis, apart)| apart <= AT * axis.step)
        };
        let mut seen: Vec<(usize, f64)> = around.iter().filter(is_seen).copied().collect();
        let total: f64 = seen.iter().map(|(_, weight)| weight).sum();
        if total <= 0.0 {
            return around;
        }
        for (_, weight) in &mut seen {
            *weight /= total;
        }
        seen
    }
}

#[cfg(test)]
mod tests {
    use super::Means;
    use crate::scenario::find;
    use crate::solve::grid::{Axis, Grid, Interpolation};

    /// In `rooms`, walls run from side to side at y = 3, but for the doors in the middle.
    #[test]
    fn no_value_is_read_through_a_wall() {
        let model = find("rooms").expect("a built-in problem").model;
        let axes = vec![Axis::new(0.25, 5.75, 12); 2];
        let means = Means::new(&model, Grid::new(axes, Interpolation::Linear));
        let rows = |mean: [f64; 2]| -> Vec<f64> {
            let around = means.around(&mean);
            let total: f64 = around.iter().map(|(_, weight)| weight).sum();
            assert!((total - 1.0).abs() < 1e-12);
            around
                .into_iter()
                .filter(|(_, weight)| *weight > 0.0)
                .map(|(point, _)| means.grid.point(point)[1])
                .collect()
        };
        assert_eq!(rows([0.5, 2.9]), [2.75, 2.75]);
        assert_eq!(rows([0.5, 3.1]), [3.25, 3.25]);
        assert!(rows([2.5, 2.9]).contains(&3.25));
    }
}
