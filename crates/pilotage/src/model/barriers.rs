//! What stops motion: the bounds of the world, and the walls of its map where there is one.

use super::{Effect, Interval, Map, Model, Region};

/// The walls of a world. The true state stops at them, and so does a belief that knows of them.
///
/// Without a map they are the bounds, taken one variable at a time. With one, the first two variables are stopped by its edges,
/// blocked cells and thin walls, and the others by their bounds.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Barriers {
    pub(crate) bounds: Vec<Interval>,
    pub(crate) map: Option<Map>,
}

/// A place along a variable where the way is stopped.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Stop {
    pub(crate) place: f64,
    /// Whether it is the way up that ends there, or the way down.
    pub(crate) upwards: bool,
}

impl Barriers {
    /// The walls of a model's world.
    pub(crate) fn new(model: &Model) -> Self {
        Self {
            bounds: model.state.iter().map(|variable| variable.bounds).collect(),
            map: model.map.clone(),
        }
    }

    /// Moves `to` back to where the straight way from `from` to it is stopped. Both have length `n`.
    pub(crate) fn stop(&self, from: &[f64], to: &mut [f64]) {
        let drawn = self.on_map(to, |map, to| map.travel([from[0], from[1]], to));
        self.clamp(to, drawn);
    }

    /// Moves a point, of length `n`, to the nearest one where a state can be.
    pub(crate) fn confine(&self, point: &mut [f64]) {
        let drawn = self.on_map(point, Map::nearest_free);
        self.clamp(point, drawn);
    }

    /// Where the way along a variable is stopped, somewhere in the world, each once.
    pub(crate) fn stops(&self, variable: usize) -> Vec<Stop> {
        match &self.map {
            Some(map) if variable < 2 => map.stops(variable),
            _ => {
                let bounds = self.bounds[variable];
                let ends = [(bounds.low, false), (bounds.high, true)].into_iter();
                let finite = ends.filter(|(place, _)| place.is_finite());
                finite
                    .map(|(place, upwards)| Stop { place, upwards })
                    .collect()
            }
        }
    }

    /// A region as a Gaussian is asked about it: sides that touch the bounds are pushed outwards for ever, since what a Gaussian has beyond a
    /// bound sits at the bound. `None` where no state can be in the region.
    pub(crate) fn reached(&self, region: &Region) -> Option<Region> {
        let blocked = |map: &Map| map.blocked.contains(region);
        if self.map.as_ref().is_some_and(blocked) {
            return None;
        }
        let pushed = |&(variable, side): &(usize, Interval)| {
            let bounds = self.bounds[variable];
            let low = match side.low <= bounds.low {
                true => f64::NEG_INFINITY,
                false => side.low,
            };
            let high = match side.high >= bounds.high {
                true => f64::INFINITY,
                false => side.high,
            };
            let inside = side.low < bounds.high && side.high > bounds.low;
            inside.then(|| (variable, Interval::new(low, high)))
        };
        let sides: Option<_> = region.sides.iter().map(pushed).collect();
        Some(Region::new(sides?))
    }

    /// An effect whose region is [`Barriers::reached`].
    pub(crate) fn felt(&self, effect: Effect) -> Option<Effect> {
        let region = self.reached(&effect.region)?;
        Some(Effect { region, ..effect })
    }

    /// Replaces what the map draws; returns how many variables that are.
    fn on_map(&self, point: &mut [f64], place: impl Fn(&Map, [f64; 2]) -> [f64; 2]) -> usize {
        let Some(map) = &self.map else { return 0 };
        let placed = place(map, [point[0], point[1]]);
        point[..2].copy_from_slice(&placed);
        2
    }

    fn clamp(&self, point: &mut [f64], first: usize) {
        for (value, bounds) in point.iter_mut().zip(&self.bounds).skip(first) {
            *value = bounds.clamp(*value);
        }
    }
}
