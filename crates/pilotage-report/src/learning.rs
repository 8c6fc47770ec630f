//! How learning went: returns and action values over the steps of experience.

use super::curve::{Series, curves_svg};
use pilotage::error::Result;
use pilotage::policy::Automaton;
use pilotage::solve::kafaq::{Point, RegionValue};
use pilotage::solve::{Learning, arkaq, kafaq};

const STEPS: &str = "steps of experience";

/// Draws the reward a step, exploration included, one line for each memory or vigilance that was tried.
///
/// # Errors
/// As [`curves_svg`].
pub fn returns_svg(automaton: &Automaton, learning: &Learning) -> Result<String> {
    let series = match learning {
        Learning::Kafaq(learning) => by_memory(learning),
        Learning::Arkaq(learning) => by_vigilance(learning),
    };
    let title = format!("{}: return while learning", automaton.problem);
    curves_svg(&title, STEPS, "reward a step", &series)
}

/// Draws `Q` of the best action: one line for the middle of every region learned last, or for every state.
///
/// # Errors
/// As [`curves_svg`].
pub fn values_svg(automaton: &Automaton, learning: &Learning) -> Result<String> {
    let (series, label) = match learning {
        Learning::Kafaq(learning) => (of_regions(automaton, learning), "Q of the region's action"),
        Learning::Arkaq(learning) => (of_states(automaton, learning), "Q of the state's action"),
    };
    let title = format!("{}: action values while learning", automaton.problem);
    curves_svg(&title, STEPS, label, &series)
}

fn by_memory(learning: &kafaq::Learning) -> Vec<Series> {
    let tried = learning.curve.iter().map(|point| point.memory + 1).max();
    (0..tried.unwrap_or(0))
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
        .collect()
}

fn by_vigilance(learning: &arkaq::Learning) -> Vec<Series> {
    let mut series: Vec<Series> = Vec::new();
    for point in &learning.curve {
        let name = format!("vigilance {}", point.vigilance);
        if series.last().is_none_or(|last| last.name != name) {
            series.push(Series {
                name,
                ..Series::default()
            });
        }
        if let Some(last) = series.last_mut() {
            last.points.push((point.samples as f64, point.reward));
        }
    }
    series
}

fn of_regions(automaton: &Automaton, learning: &kafaq::Learning) -> Vec<Series> {
    let regions = epochs(learning, learning.adopted)
        .last()
        .map_or([].as_slice(), |last| &last.regions);
    let line = |region: &RegionValue| {
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
    };
    regions.iter().map(line).collect()
}

/// Most states whose values are drawn: those met first.
const MOST_STATES: usize = 12;

fn of_states(automaton: &Automaton, learning: &arkaq::Learning) -> Vec<Series> {
    let epochs = || {
        let kept = |point: &&arkaq::Point| point.vigilance == learning.vigilance;
        learning.curve.iter().filter(kept)
    };
    let last = epochs()
        .next_back()
        .map_or([].as_slice(), |last| &last.states);
    let line = |(id, &(action, _)): (usize, &(usize, f64))| {
        let action = automaton.actions.get(action).map_or("?", String::as_str);
        let value = |point: &arkaq::Point| point.states.get(id).map_or(f64::NAN, |one| one.1);
        Series {
            name: format!("state {id}, {action}"),
            points: epochs()
                .map(|point| (point.samples as f64, value(point)))
                .collect(),
            band: None,
        }
    };
    last.iter()
        .enumerate()
        .take(MOST_STATES)
        .map(line)
        .collect()
}

fn epochs(learning: &kafaq::Learning, memory: usize) -> impl Iterator<Item = &Point> {
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
