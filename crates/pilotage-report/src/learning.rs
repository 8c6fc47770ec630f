//! How learning went: returns and action values over the steps of experience.

use super::curve::{Series, curves_svg};
use pilotage::error::Result;
use pilotage::policy::Automaton;
use pilotage::solve::{Learning, Line};

const STEPS: &str = "steps of experience";

/// Draws the reward a step, exploration included, one line for each attempt of the learner.
///
/// # Errors
/// As [`curves_svg`].
pub fn returns_svg(automaton: &Automaton, learning: &Learning) -> Result<String> {
    let title = format!("{}: return while learning", automaton.problem);
    curves_svg(&title, STEPS, "reward a step", &series(&learning.returns))
}

/// Draws `Q` of the best action, one line for each place or state that the learner tells apart.
///
/// # Errors
/// As [`curves_svg`].
pub fn values_svg(automaton: &Automaton, learning: &Learning) -> Result<String> {
    let title = format!("{}: action values while learning", automaton.problem);
    curves_svg(&title, STEPS, learning.valued, &series(&learning.values))
}

fn series(lines: &[Line]) -> Vec<Series> {
    let series = |line: &Line| Series {
        name: line.name.clone(),
        points: line.points.clone(),
        band: None,
    };
    lines.iter().map(series).collect()
}
