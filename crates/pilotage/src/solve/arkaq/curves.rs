//! How ARKAQ learned, as it is told and drawn.

use super::{Learning, Point};
use crate::policy::Automaton;
use crate::solve::{self, Line};

/// Most states whose values are drawn: those met first.
const MOST_STATES: usize = 12;

/// What is told and drawn of a run that made the automaton: returns by vigilance, values by state.
pub fn drawn(automaton: &Automaton, learning: &Learning) -> solve::Learning {
    solve::Learning {
        found: found(learning),
        returns: by_vigilance(learning),
        valued: "Q of the state's action",
        values: of_states(automaton, learning),
    }
}

fn found(learning: &Learning) -> String {
    let cap = if learning.capped {
        ", stopped by `state_limit`"
    } else {
        ""
    };
    format!(
        "{} clusters at vigilance {}, {} states{cap}",
        learning.clusters.len(),
        learning.vigilance,
        learning.states
    )
}

fn by_vigilance(learning: &Learning) -> Vec<Line> {
    let mut lines: Vec<Line> = Vec::new();
    for point in &learning.curve {
        let name = format!("vigilance {}", point.vigilance);
        if lines.last().is_none_or(|last| last.name != name) {
            lines.push(Line {
                name,
                points: Vec::new(),
            });
        }
        if let Some(last) = lines.last_mut() {
            last.points.push((point.samples as f64, point.reward));
        }
    }
    lines
}

fn of_states(automaton: &Automaton, learning: &Learning) -> Vec<Line> {
    let epochs = || {
        let kept = |point: &&Point| point.vigilance == learning.vigilance;
        learning.curve.iter().filter(kept)
    };
    let last = epochs()
        .next_back()
        .map_or([].as_slice(), |last| &last.states);
    let line = |(id, &(action, _)): (usize, &(usize, f64))| {
        let action = automaton.actions.get(action).map_or("?", String::as_str);
        let value = |point: &Point| point.states.get(id).map_or(f64::NAN, |one| one.1);
        Line {
            name: format!("state {id}, {action}"),
            points: epochs()
                .map(|point| (point.samples as f64, value(point)))
                .collect(),
        }
    };
    last.iter()
        .enumerate()
        .take(MOST_STATES)
        .map(line)
        .collect()
}
