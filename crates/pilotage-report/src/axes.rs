//! Axes: ticks with their figures, grid lines, names.

use super::palette::Paint;
use super::plot::{Scale, ticks};
use super::svg::{self, Anchor, Element, label, text_width};

/// Size of an axis' texts.
pub const TEXT: f64 = 11.5;
/// Room below a plot for figures and name of its horizontal axis.
pub const BELOW: f64 = 42.0;

/// Whether lines are drawn across the plot at the ticks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Grid {
    /// Lines across the plot.
    Lines,
    /// Short strokes outside it.
    Strokes,
}

/// The horizontal axis, below a plot between `top` and `bottom`; its name is centred under the figures.
pub fn horizontal(x: &Scale, (top, bottom): (f64, f64), name: &str, grid: Grid) -> Vec<Element> {
    let (left, right) = x.paper;
    let widest = ticks(x.data, 6)
        .iter()
        .map(|tick| text_width(&tick.1, TEXT))
        .fold(1.0, f64::max);
    let about = ((right - left) / (1.5 * widest + 30.0)).clamp(1.0, 8.0);
    let mut elements = Vec::new();
    for (value, figure) in ticks(x.data, about as usize) {
        let at = x.at(value);
        let end = if grid == Grid::Lines { top } else { bottom };
        elements.push(svg::line((at, bottom + 5.0), (at, end)).stroke(Paint::Grid, 1.0));
        elements.push(label((at, bottom + 18.0), TEXT, Anchor::Middle, figure).fill(Paint::Muted));
    }
    let middle = 0.5 * (left + right);
    elements.push(label((middle, bottom + 36.0), TEXT, Anchor::Middle, name).fill(Paint::Ink));
    elements
}

/// The vertical axis, left of the plot between `x.paper`. Its name goes elsewhere.
pub fn vertical(x: &Scale, y: &Scale, grid: Grid) -> Vec<Element> {
    let (left, right) = x.paper;
    let about = ((y.paper.0 - y.paper.1).abs() / 55.0).clamp(2.0, 8.0);
    let mut elements = Vec::new();
    for (value, figure) in ticks(y.data, about as usize) {
        let at = y.at(value);
        let end = if grid == Grid::Lines { right } else { left };
        elements.push(svg::line((left - 5.0, at), (end, at)).stroke(Paint::Grid, 1.0));
        elements.push(label((left - 8.0, at + 4.0), TEXT, Anchor::End, figure).fill(Paint::Muted));
    }
    elements
}

/// Room the figures of a vertical axis need.
pub fn left_of(y: (f64, f64)) -> f64 {
    let figures = (2..=8).flat_map(|about| ticks(y, about));
    figures
        .map(|tick| text_width(&tick.1, TEXT))
        .fold(20.0, f64::max)
        .ceil()
        + 10.0
}
