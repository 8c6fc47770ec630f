//! How learning went: returns and action values over the steps of experience.

use super::curve::{Series, curves_svg};
use crate::error::Result;
use crate::policy::Automaton;
use crate::solve::kafaq::{Learning, Point, RegionValue};

const STEPS: &str = "steps of experience";

/// Draws the reward a step, exploration included, one line for each memory that was tried.
///
/// # Errors
/// As [`curves_svg`].
pub fn returns_svg(automaton: &Automaton, learning: &Learning) -> Result<String> {
    let tried = learning
        .curve
        .iter()
        .map(|point| point.memory + 1)
        .max()
        .unwrap_or(0);
    let series: Vec<Series> = (0..tried)
        .map(|memory| Series {
            name: if memory == learning.adopted {
                learning.memory.clone()
            } else {
                format!("memory {memory}, not adopted")
            },
            points: epochs(learning, memory)
                .map(|point| (point.samples as f64, point.reward))
                .collect(),
            band: None,
        })
        .collect();
    let title = format!("{}: return while learning", automaton.problem);
    curves_svg(&title, STEPS, "reward a step", &series)
}

/// Draws `Q` of the region that held a place, one line for the middle of every region learned last.
///
/// # Errors
/// As [`curves_svg`].
pub fn values_svg(automaton: &Automaton, learning: &Learning) -> Result<String> {
    let regions = epochs(learning, learning.adopted)
        .last()
        .map_or([].as_slice(), |last| &last.regions);
    let series: Vec<Series> = regions
        .iter()
        .map(|region| {
            let middle = middle(region);
            let points = epochs(learning, learning.adopted).map(|point| {
                let value =
                    holder(point, region.memory, &middle).map_or(f64::NAN, |region| region.value);
                (point.samples as f64, value)
            });
            Series {
                name: name(automaton, region, &middle),
                points: points.collect(),
                band: None,
            }
        })
        .collect();
    let title = format!("{}: action values while learning", automaton.problem);
    curves_svg(&title, STEPS, "Q of the region's action", &series)
}

fn epochs(learning: &Learning, memory: usize) -> impl Iterator<Item = &Point> {
    let of = move |point: &&Point| point.memory == memory;
    learning.curve.iter().filter(of)
}

fn middle(region: &RegionValue) -> Vec<f64> {
    let sides = region.lower.iter().zip(&region.upper);
    sides.map(|(low, high)| 0.5 * (low + high)).collect()
}

fn volume(region: &RegionValue) -> f64 {
    let sides = region.lower.iter().zip(&region.upper);
    sides.map(|(low, high)| high - low).product()
}

/// The smallest region of a memory that holds a place.
fn holder<'a>(point: &'a Point, memory: usize, place: &[f64]) -> Option<&'a RegionValue> {
    let holds = |region: &&RegionValue| {
        region.memory == memory
            && (0..place.len()).all(|i| region.lower[i] <= place[i] && place[i] <= region.upper[i])
    };
    let holders = point.regions.iter().filter(holds);
    holders.min_by(|a, b| volume(a).total_cmp(&volume(b)))
}

fn name(automaton: &Automaton, region: &RegionValue, middle: &[f64]) -> String {
    let place: Vec<String> = middle.iter().map(|x| format!("{x:.1}")).collect();
    let action = automaton.actions.get(region.action);
    let action = action.map_or("?", String::as_str);
    let place = format!("{action} at {}", place.join(", "));
    match automaton.modes.get(region.memory).map(String::as_str) {
        None | Some("") => place,
        Some(memory) => format!("{place}, {memory}"),
    }
}
