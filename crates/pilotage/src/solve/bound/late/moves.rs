//! Where moves end and what is sensed of it, along one axis.

use super::super::cells::Cells;
use super::super::frame::{Frame, Noise};
use super::super::law::Law;
use crate::belief::gaussian::normal_density;
use crate::parallel;

/// The second derivative of a Gaussian density of variance 1 has this integral where it is positive.
const CURVATURE: f64 = 0.483_941_45;

/// One place along an axis from which the noise carries on, and what can be sensed of where it ends.
#[derive(Debug)]
pub(super) struct Place {
    /// Weights of the ends of all cells in an expectation.
    pub flat: Vec<f64>,
    /// The same, weighted by the density of a reading: a share of `flat` for each reading. From which end on, and the weights.
    pub readings: Vec<(usize, Vec<f64>)>,
}

/// Where the actions of a class lead along an axis.
#[derive(Debug)]
pub(super) struct Moves {
    pub places: Vec<Place>,
    /// By action of the model and end of a cell; open cells and actions of other classes have none.
    pub from: Vec<Vec<usize>>,
    /// What the sum over readings may exceed the integral by, for what is at stake.
    pub loss: f64,
    /// What a chord may lie below the function, by cell, for its range.
    pub gap: Vec<f64>,
}

/// The moves of a class along an axis.
pub(super) fn moves(
    frame: &Frame,
    cells: &Cells,
    class: usize,
    axis: usize,
) -> Result<Moves, String> {
    let noise = frame.classes[class][axis];
    let of = &frame.axes[axis];
    let resolution = cells.resolution();
    let mut keys: Vec<f64> = Vec::new();
    let mut from = Vec::new();
    for action in 0..frame.class_of.len() {
        let mut places = vec![usize::MAX; cells.places()];
        if frame.class_of[action] == class {
            for (end, place) in places.iter_mut().enumerate() {
                let (cell, side) = (end / 2, end % 2);
                if cells.open_side(cell).is_some() {
                    continue;
                }
                let key = match noise.motion > 0.0 {
                    true => {
                        let (low, high) = cells.span(cell);
                        of.a * [low, high][side] + of.displacement[action]
                    }
                    false => cells.shifted(cell, side, of.displacement[action])? as f64,
                };
                let near = |known: &f64| (known - key).abs() <= 1e-7 * resolution.min(1.0);
                *place = keys.iter().position(near).unwrap_or_else(|| {
                    keys.push(key);
                    keys.len() - 1
                });
            }
        }
        from.push(places);
    }
    let step = match frame.is_real(1) {
        true => 0.5,
        false => 1.0 / 6.0,
    };
    let places = parallel::map(keys.len(), |key| {
        place(cells, noise, keys[key], resolution, step)
    });
    let weighs_readings = noise.motion > 0.0
        && noise.precision > 0.0
        && 1.0 / noise.precision > resolution * resolution;
    let gap = |cell: usize| match cells.open_side(cell) {
        None if noise.motion > 0.0 => {
            let (low, high) = cells.span(cell);
            let width = of.a * (high - low);
            (CURVATURE * width * width / (8.0 * noise.motion)).min(1.0)
        }
        _ => 0.0,
    };
    Ok(Moves {
        places,
        from,
        loss: match weighs_readings {
            // The integral of where a Gaussian density curves upwards, and what a sum of the largest values in each step may add.
            true => step * step / 12.0 * (CURVATURE + 0.72 * step),
            false => 0.0,
        },
        gap: (0..cells.count()).map(gap).collect(),
    })
}

/// Where the noise carries on to from a place, and what readings say of it, a `step` apart in units of their noise. Those too exact
/// for the grid are taken for exact.
fn place(cells: &Cells, noise: Noise, key: f64, resolution: f64, step: f64) -> Place {
    let unit = |place: usize, weight: f64| (place, vec![weight]);
    if noise.motion <= 0.0 {
        let mut flat = vec![0.0; cells.places()];
        flat[key as usize] = 1.0;
        return Place {
            readings: vec![unit(key as usize, 1.0)],
            flat,
        };
    }
    let law = Law::normal(key, noise.motion.sqrt());
    let flat = cells.weights(&law, true);
    if noise.precision <= 0.0 {
        return Place {
            readings: vec![(0, flat.clone())],
            flat,
        };
    }
    let variance = 1.0 / noise.precision;
    if variance <= resolution * resolution {
        let seen = flat
            .iter()
            .enumerate()
            .filter(|(_, weight)| **weight > 1e-12);
        return Place {
            readings: seen.map(|(place, &weight)| unit(place, weight)).collect(),
            flat,
        };
    }
    let sd = variance.sqrt();
    let [low, high] = cells.stops();
    let within = |x: f64| {
        x.max(low.unwrap_or(f64::NEG_INFINITY))
            .min(high.unwrap_or(f64::INFINITY))
    };
    let from = within(key - 5.0 * law.sd) - 5.0 * sd;
    let to = within(key + 5.0 * law.sd) + 5.0 * sd;
    let total = (noise.motion + variance).sqrt();
    let share = noise.motion / (noise.motion + variance);
    let density = |o: f64, mean: f64, sd: f64| normal_density((o - mean) / sd) / sd;
    let count = ((to - from) / (step * sd)).ceil() as usize;
    let reading = |k: usize| {
        let o = from + k as f64 * step * sd;
        let held = Law::normal(key + share * (o - key), (share * variance).sqrt());
        let weigh = density(o, key, total) * step * sd;
        let mut weights = cells.weights(&held, false);
        weights.iter_mut().for_each(|weight| *weight *= weigh);
        let last = weights.len() - 1;
        for (side, wall) in [low, high].into_iter().enumerate() {
            if let Some(wall) = wall {
                let stopped = match side {
                    0 => law.below(wall),
                    _ => 1.0 - law.below(wall),
                };
                weights[side * last] += stopped * density(o, wall, sd) * step * sd;
            }
        }
        // Left out, a weight only lowers the price.
        let first = weights.iter().position(|weight| *weight > 1e-9);
        let end = weights.iter().rposition(|weight| *weight > 1e-9);
        match (first, end) {
            (Some(first), Some(end)) => Some((first, weights[first..=end].to_vec())),
            _ => None,
        }
    };
    Place {
        readings: (0..=count).filter_map(reading).collect(),
        flat,
    }
}
