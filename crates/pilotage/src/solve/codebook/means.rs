//! Points of means, between which values are read, though never through a wall.

use std::sync::Arc;

use crate::model::{Barriers, Dynamics, Model};
use crate::solve::grid::{Axis, Grid, Interpolation};

/// Points of means: evenly spaced, but with one on either side of every wall of a map.
#[derive(Debug, Clone)]
pub(super) struct Means {
    /// Of coordinates, or of the numbers of places where there are walls.
    grid: Grid,
    walled: Option<Arc<Walled>>,
}

/// A map that beliefs know of.
#[derive(Debug)]
struct Walled {
    walls: Barriers,
    /// Coordinates of the points along each variable, rising.
    places: Vec<Vec<f64>>,
}

/// Points of which one is nearer to a wall, as a share of the distance between points, give way to those at the wall.
const NEAR: f64 = 0.25;

impl Means {
    /// Points along these axes in the world of a model.
    pub(super) fn new(model: &Model, axes: Vec<Axis>) -> Self {
        let dynamics = Dynamics::new(model);
        let walls = dynamics.walls().filter(|walls| walls.map.is_some());
        let Some(walls) = walls else {
            return Self {
                grid: Grid::new(axes, Interpolation::Linear),
                walled: None,
            };
        };
        let along = axes.iter().enumerate();
        let places: Vec<Vec<f64>> = along.map(|(i, axis)| places(walls, i, axis)).collect();
        let numbers = places
            .iter()
            .map(|places| Axis::stepped(0.0, 1.0, places.len()));
        Self {
            grid: Grid::new(numbers.collect(), Interpolation::Linear),
            walled: Some(Arc::new(Walled {
                walls: walls.clone(),
                places,
            })),
        }
    }

    /// Number of points.
    pub(super) fn len(&self) -> usize {
        self.grid.len()
    }

    /// Number of variables.
    pub(super) fn dim(&self) -> usize {
        self.grid.axes().len()
    }

    /// Coordinates of a point.
    pub(super) fn point(&self, point: usize) -> Vec<f64> {
        let mut at = self.grid.point(point);
        if let Some(walled) = &self.walled {
            for (value, places) in at.iter_mut().zip(&walled.places) {
                *value = places[*value as usize];
            }
        }
        at
    }

    /// Whether a mean is not beyond the outermost points.
    pub(super) fn contains(&self, mean: &[f64]) -> bool {
        match &self.walled {
            None => self.grid.contains(mean),
            Some(walled) => {
                let mut sides = walled.places.iter().zip(mean);
                sides.all(|(places, x)| (places[0]..=places[places.len() - 1]).contains(x))
            }
        }
    }

    /// The points around a mean with their weights, which sum to 1: of those that a wall hides, none, unless it hides all.
    pub(super) fn around(&self, mean: &[f64]) -> Vec<(usize, f64)> {
        let Some(walled) = &self.walled else {
            return self.grid.around(mean);
        };
        let numbers: Vec<f64> = walled
            .places
            .iter()
            .zip(mean)
            .map(|(places, x)| number(places, *x))
            .collect();
        let around = self.grid.around(&numbers);
        let is_seen = |(point, _): &&(usize, f64)| self.sees(walled, mean, *point);
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

    /// The nearest of the points around a mean.
    pub(super) fn nearest(&self, mean: &[f64]) -> usize {
        let mut best = (0, 0.0);
        for (point, weight) in self.around(mean) {
            if weight > best.1 {
                best = (point, weight);
            }
        }
        best.0
    }

    /// The points before and after a point along an axis; `None` at its ends, and where a wall hides one.
    pub(super) fn beside(&self, point: usize, axis: usize) -> Option<[usize; 2]> {
        let beside = self.grid.beside(point, axis)?;
        let seen = self.walled.as_ref().is_none_or(|walled| {
            let here = self.point(point);
            beside.iter().all(|other| self.sees(walled, &here, *other))
        });
        seen.then_some(beside)
    }

    /// Whether the straight way to a point is free.
    fn sees(&self, walled: &Walled, from: &[f64], point: usize) -> bool {
        let there = self.point(point);
        let mut stopped = there.clone();
        walled.walls.stop(from, &mut stopped);
        stopped == there
    }
}

/// Places along an axis, with those at which walls stop the way.
fn places(walls: &Barriers, variable: usize, axis: &Axis) -> Vec<f64> {
    let (low, high) = (axis.at(0), axis.at(axis.count - 1));
    let stops = walls
        .stops(variable)
        .into_iter()
        .map(|stop| match stop.upwards {
            true => stop.place.next_down(),
            false => stop.place,
        });
    let stops: Vec<f64> = stops
        .filter(|place| low < *place && *place < high)
        .collect();
    let is_free = |place: &f64| {
        let mut apart = stops.iter().map(|stop| (stop - place).abs());
        apart.all(|apart| apart > NEAR * axis.step)
    };
    let inner = (1..axis.count - 1).map(|k| axis.at(k)).filter(is_free);
    let mut places: Vec<f64> = inner
        .chain([low, high])
        .chain(stops.iter().copied())
        .collect();
    places.sort_by(f64::total_cmp);
    places.dedup();
    places
}

/// Where a coordinate lies among rising places, as a number of steps from the first.
fn number(places: &[f64], x: f64) -> f64 {
    let after = places.partition_point(|place| *place <= x);
    if after == 0 || after == places.len() {
        return after.saturating_sub(1) as f64;
    }
    let (low, high) = (places[after - 1], places[after]);
    (after - 1) as f64 + (x - low) / (high - low)
}

#[cfg(test)]
mod tests {
    use super::{Means, number};
    use crate::scenario::find;
    use crate::solve::grid::Axis;

    /// In `rooms`, walls run from side to side at y = 3, but for the doors in the middle.
    #[test]
    fn no_value_is_read_through_a_wall() {
        let model = find("rooms").expect("a built-in problem").model;
        let means = Means::new(&model, vec![Axis::new(0.25, 5.75, 12); 2]);
        let rows = |mean: [f64; 2]| -> Vec<f64> {
            let around = means.around(&mean);
            let total: f64 = around.iter().map(|(_, weight)| weight).sum();
            assert!((total - 1.0).abs() < 1e-12);
            around
                .into_iter()
                .filter(|(_, weight)| *weight > 0.0)
                .map(|(point, _)| means.point(point)[1])
                .collect()
        };
        let below = 3.0_f64.next_down();
        let all = |rows: Vec<f64>, of: &[f64]| {
            assert!(rows.iter().all(|row| of.contains(row)), "{rows:?}");
        };
        all(rows([0.5, 2.9]), &[2.75, below]);
        all(rows([0.5, 3.1]), &[3.0, 3.25]);
        // Who stands at a wall is on one side of it.
        all(rows([0.5, below]), &[below]);
        all(rows([0.5, 3.0]), &[3.0]);
        assert!(rows([2.5, 2.9]).iter().all(|row| *row <= 3.0));
        assert_eq!(means.point(means.nearest(&[0.5, below]))[1], below);
    }

    #[test]
    fn a_place_lies_between_those_around_it() {
        let places = [0.0, 1.0, 3.0];
        let numbers = [-1.0, 0.0, 0.25, 1.0, 2.0, 3.0, 4.0].map(|x| number(&places, x));
        assert_eq!(numbers, [0.0, 0.0, 0.25, 1.0, 1.5, 2.0, 2.0]);
    }
}
