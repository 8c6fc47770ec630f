//! How KAFAQ learned, as it is told and drawn.

use super::{Learning, Point, RegionValue};
use crate::policy::Automaton;
use crate::solve::{self, Line};

/// What is told and drawn of a run that made the automaton: returns by memory, values in the middle of every region learned last.
pub fn drawn(automaton: &Automaton, learning: &Learning) -> solve::Learning {
    solve::Learning {
        found: learning.memory.clone(),
        returns: by_memory(learning),
        valued: "Q of the region's action",
        values: of_regions(automaton, learning),
    }
}

fn by_memory(learning: &Learning) -> Vec<Line> {
    let tried = learning.curve.iter().map(|point| point.memory + 1).max();
    (0..tried.unwrap_or(0))
        .map(|memory| Line {
            name: if memory == learning.adopted {
                learning.memory.clone()
            } else {
                format!("memory {memory}, not adopted")
            },
            points: epochs(learning, memory)
                .map(|point| (point.samples as f64, point.reward))
                .collect(),
        })
        .collect()
}

fn of_regions(automaton: &Automaton, learning: &Learning) -> Vec<Line> {
    let regions = epochs(learning, learning.adopted)
        .last()
        .map_or([].as_slice(), |last| &last.regions);
    let line = |region: &RegionValue| {
        let middle = middle(region);
        let points = epochs(learning, learning.adopted).map(|point| {
            let value = holder(point, region, &middle).map_or(f64::NAN, |region| region.value);
            (point.samples as f64, value)
        });
        Line {
            name: name(automaton, region, &middle),
            points: points.collect(),
        }
    };
    regions.iter().map(line).collect()
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

/// The smallest region that holds a place, of the memory and stratum of another.
fn holder<'a>(point: &'a Point, other: &RegionValue, place: &[f64]) -> Option<&'a RegionValue> {
    let holds = |region: &&RegionValue| {
        (region.memory, region.stratum) == (other.memory, other.stratum)
            && (0..place.len()).all(|i| region.lower[i] <= place[i] && place[i] <= region.upper[i])
    };
    let holders = point.regions.iter().filter(holds);
    holders.min_by(|a, b| volume(a).total_cmp(&volume(b)))
}

fn name(automaton: &Automaton, region: &RegionValue, middle: &[f64]) -> String {
    let place: Vec<String> = middle.iter().map(|x| format!("{x:.1}")).collect();
    let action = automaton.actions.get(region.action);
    let action = action.map_or("?", String::as_str);
    let place = match automaton.updater.codebook() {
        None => format!("{action} at {}", place.join(", ")),
        Some(_) => format!(
            "{action} at {}, stratum {}",
            place.join(", "),
            region.stratum
        ),
    };
    match automaton.modes.get(region.memory).map(String::as_str) {
        None | Some("") => place,
        Some(memory) => format!("{place}, {memory}"),
    }
}
