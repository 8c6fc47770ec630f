//! The belief space of one state variable.

use super::Map;
use crate::axes::{self, Grid};
use crate::palette::Paint;
use crate::plot::{Scale, figure};
use crate::sheet::{MARGIN, Sign, TINT, diamond};
use crate::svg::{self, Anchor, Element, label};
use pilotage::belief::{Belief, StratumId};
use pilotage::model::{ActionId, ModeId};
use pilotage::policy::{Matching, Node, Place};

const SIDE: f64 = 62.0;
const GAP: f64 = 24.0;
const HEADING: f64 = 40.0;
/// Means asked along the width of a panel; borders between them are found by bisection.
const SAMPLES: usize = 240;

pub fn draw(map: &Map<'_>) -> String {
    let modes = map.modes();
    let columns = modes.len().min(2);
    let plot_width = if columns == 1 { 560.0 } else { 330.0 };
    let panel_width = plot_width + 2.0 * SIDE;
    let width = columns as f64 * panel_width + (columns - 1) as f64 * GAP;
    let levels = shown_levels(map);
    let mut sheet = map.sheet(&what(map, &levels), width);
    let level_height = (360.0 / levels.len() as f64).clamp(1.0, 44.0);
    let plot_height = level_height * levels.len() as f64;
    for row in modes.chunks(columns) {
        let top = sheet.y() + HEADING;
        let panels = row.iter().enumerate().flat_map(|(column, &mode)| {
            let left = MARGIN + column as f64 * (panel_width + GAP) + SIDE;
            let panel = Panel {
                map,
                mode,
                levels: &levels,
                x: Scale::new(map.extent(0), (left, left + plot_width)),
                y: Scale::new((0.0, levels.len() as f64), (top, top + plot_height)),
            };
            panel.draw()
        });
        let elements: Vec<Element> = panels.collect();
        sheet.draw(elements, HEADING + plot_height + axes::BELOW);
    }
    let mut marks = vec![(Sign::Diamond, "start".to_owned())];
    if modes.iter().any(|&mode| !map.goals(mode).is_empty()) {
        marks.push((Sign::Bar(Paint::Ink), "where a reward is paid".to_owned()));
    }
    sheet.legend(&map.legend(marks));
    sheet.draw([], 14.0);
    if let Some(automaton) = map.automaton {
        sheet.note(match automaton.matching {
            Matching::Nearest => {
                "Circles: the automaton's nodes, at the middle of their levels. Lines: borders between them."
            }
            Matching::Segments => {
                "Frames: the automaton's segments. Dots: their points of least value."
            }
            Matching::Tree => {
                "Frames: where the beliefs of the tree's nodes lie. Dots: their middles."
            }
        });
    }
    sheet.note("σ: standard deviation, P: variance of the belief. Faint vertical lines: bounds of the world.");
    sheet.finish()
}

/// Levels from the least to the most certain; with an automaton, those it has nodes at and the start.
fn shown_levels(map: &Map<'_>) -> Vec<StratumId> {
    let start = map.space.start().stratum;
    let is_met = |level: StratumId| {
        map.automaton.is_none_or(|automaton| {
            let mut bands = automaton.nodes.iter().map(|node| node.levels);
            level == start || bands.any(|(first, last)| first <= level && level <= last)
        })
    };
    let mut levels = map.ordered_levels();
    levels.retain(|&level| is_met(level));
    levels
}

fn what(map: &Map<'_>, shown: &[StratumId]) -> String {
    let total = map.space.strata();
    let levels = match (shown.len(), total) {
        (_, 1) => "there is one level.".to_owned(),
        (all, total) if all == total => {
            format!("all {total} levels, the most certain at the bottom.")
        }
        (met, total) => format!(
            "the {met} of {total} levels that the automaton meets, the most certain at the bottom."
        ),
    };
    format!("Mean across, uncertainty up; {levels}")
}

struct Panel<'a> {
    map: &'a Map<'a>,
    mode: ModeId,
    /// From top to bottom.
    levels: &'a [StratumId],
    x: Scale,
    /// Counts rows from the top.
    y: Scale,
}

/// Means with one action, at one level.
struct Run {
    low: f64,
    high: f64,
    action: ActionId,
}

impl Panel<'_> {
    fn draw(&self) -> Vec<Element> {
        let mut elements =
            axes::horizontal(&self.x, self.y.paper, &self.axis_name(), Grid::Strokes);
        elements.push(self.areas());
        elements.extend(self.bounds());
        elements.extend(self.goals());
        elements.extend(self.level_labels());
        elements.extend(self.borders());
        elements.extend(self.map.nodes(self.mode).flat_map(|node| self.node(node)));
        elements.extend(self.start());
        elements
    }

    fn axis_name(&self) -> String {
        let name = &self.map.space.model().state[0].name;
        match self.map.mode_name(self.mode) {
            "" => format!("mean of {name}"),
            mode => format!("mean of {name}, when {mode}"),
        }
    }

    fn areas(&self) -> Element {
        let rows = pilotage::parallel::map(self.levels.len(), |row| self.runs(self.levels[row]));
        let areas = rows.iter().enumerate().flat_map(|(row, runs)| {
            runs.iter().map(move |run| {
                let (left, right) = (self.x.at(run.low), self.x.at(run.high));
                let (top, bottom) = (self.y.at(row as f64), self.y.at(row as f64 + 1.0));
                svg::rect((left, top), (right - left, bottom - top)).fill(Paint::Hue(run.action))
            })
        });
        Element::new("g")
            .with("fill-opacity", TINT)
            .with("shape-rendering", "crispEdges")
            .children(areas)
    }

    fn action(&self, level: StratumId, mean: f64) -> ActionId {
        self.map.policy.action(&Belief {
            stratum: level,
            mode: self.mode,
            mean: vec![mean],
        })
    }

    fn runs(&self, level: StratumId) -> Vec<Run> {
        const BISECTIONS: usize = 12;
        let (low, high) = self.x.data;
        let at = |k: usize| low + (high - low) * k as f64 / SAMPLES as f64;
        let mut runs = Vec::new();
        let mut current = Run {
            low,
            high,
            action: self.action(level, low),
        };
        for k in 1..=SAMPLES {
            let action = self.action(level, at(k));
            if action == current.action {
                continue;
            }
            let (mut left, mut right) = (at(k - 1), at(k));
            for _ in 0..BISECTIONS {
                let middle = 0.5 * (left + right);
                if self.action(level, middle) == current.action {
                    left = middle;
                } else {
                    right = middle;
                }
            }
            let next = Run {
                low: right,
                high,
                action,
            };
            current.high = right;
            runs.push(std::mem::replace(&mut current, next));
        }
        runs.push(current);
        runs
    }

    fn bounds(&self) -> Vec<Element> {
        let bounds = self.map.space.model().state[0].bounds;
        let (top, bottom) = self.y.paper;
        let frame = svg::rect(
            (self.x.paper.0, top),
            (self.x.paper.1 - self.x.paper.0, bottom - top),
        )
        .with("fill", "none")
        .stroke(Paint::Grid, 1.0);
        [bounds.low, bounds.high]
            .into_iter()
            .filter(|x| x.is_finite())
            .map(|x| {
                let at = self.x.clamped(x);
                svg::line((at, top), (at, bottom))
                    .stroke(Paint::Ink, 1.0)
                    .with("stroke-opacity", 0.35)
            })
            .chain([frame])
            .collect()
    }

    fn goals(&self) -> Vec<Element> {
        let bottom = self.y.paper.1;
        let regions = self.map.goals(self.mode);
        let sides = regions.iter().flat_map(|region| &region.sides);
        sides
            .map(|(_, side)| {
                let (left, right) = (self.x.clamped(side.low), self.x.clamped(side.high));
                svg::rect((left, bottom + 1.0), (right - left, 4.0)).fill(Paint::Ink)
            })
            .collect()
    }

    /// Standard deviations on the left, variances on the right, of as many levels as there is room for.
    fn level_labels(&self) -> Vec<Element> {
        const LEADING: f64 = 17.0;
        let (left, right) = (self.x.paper.0 - 8.0, self.x.paper.1 + 8.0);
        let row = self.y.at(1.0) - self.y.at(0.0);
        let every = (LEADING / row).ceil().max(1.0) as usize;
        let last = self.levels.len() - 1;
        let head = self.y.paper.0 - 12.0;
        let mut elements = vec![
            label((left, head), axes::TEXT, Anchor::End, "σ").fill(Paint::Ink),
            label((right, head), axes::TEXT, Anchor::Start, "P").fill(Paint::Ink),
        ];
        let figures = |row: usize| {
            let deviation = self.map.deviation(self.levels[row], 0);
            [figure(deviation), figure(deviation * deviation)]
        };
        let mut before = [String::new(), String::new()];
        for row in (0..=last).filter(|row| row % every == 0 || *row == last) {
            if row != last && last - row < every {
                continue;
            }
            let y = self.y.at(row as f64 + 0.5) + 4.0;
            let sides = [(left, Anchor::End), (right, Anchor::Start)];
            for (side, text) in figures(row).into_iter().enumerate() {
                let repeats = text == before[side] || (row != last && text == figures(last)[side]);
                if !repeats {
                    let (x, anchor) = sides[side];
                    elements.push(label((x, y), axes::TEXT, anchor, &text).fill(Paint::Muted));
                    before[side] = text;
                }
            }
        }
        elements
    }

    /// Rows of a node's levels that lie together, as top and bottom on paper.
    fn rows(&self, node: &Node) -> Vec<(f64, f64)> {
        let holds = |level: StratumId| node.levels.0 <= level && level <= node.levels.1;
        let rows: Vec<usize> = (0..self.levels.len())
            .filter(|&row| holds(self.levels[row]))
            .collect();
        rows.chunk_by(|a, b| a + 1 == *b)
            .map(|rows| {
                (
                    self.y.at(rows[0] as f64),
                    self.y.at((rows[0] + rows.len()) as f64),
                )
            })
            .collect()
    }

    fn node(&self, node: &Node) -> Vec<Element> {
        let rows = self.rows(node);
        match &node.place {
            Place::Point(point) => rows
                .iter()
                .map(|(top, bottom)| {
                    svg::circle((self.x.clamped(point[0]), 0.5 * (top + bottom)), 5.0)
                        .fill(Paint::Hue(node.action))
                        .stroke(Paint::Ink, 1.5)
                })
                .collect(),
            Place::Segment {
                lower,
                upper,
                minimum,
            } => rows
                .iter()
                .flat_map(|&(top, bottom)| {
                    let (left, right) = (self.x.clamped(lower[0]), self.x.clamped(upper[0]));
                    let inset = (0.12 * (bottom - top)).min(2.0);
                    let frame = svg::rect(
                        (left, top + inset),
                        (right - left, bottom - top - 2.0 * inset),
                    )
                    .with("fill", "none")
                    .stroke(Paint::Ink, 1.5);
                    let least = minimum.first().filter(|x| x.is_finite()).map(|&x| {
                        svg::circle((self.x.clamped(x), 0.5 * (top + bottom)), 2.5).fill(Paint::Ink)
                    });
                    [frame].into_iter().chain(least)
                })
                .collect(),
        }
    }

    /// Where one point node's means end and its neighbour's begin, and where one band of levels ends.
    fn borders(&self) -> Vec<Element> {
        let nodes: Vec<&Node> = self
            .map
            .nodes(self.mode)
            .filter(|node| matches!(node.place, Place::Point(_)))
            .collect();
        let mut bands: Vec<(StratumId, StratumId)> = nodes.iter().map(|node| node.levels).collect();
        bands.sort_unstable();
        bands.dedup();
        let stroke = |element: Element| element.stroke(Paint::Ink, 1.0);
        let mut elements = Vec::new();
        for band in bands {
            let mut here: Vec<&Node> = nodes
                .iter()
                .copied()
                .filter(|node| node.levels == band)
                .collect();
            here.sort_by(|a, b| a.place.centre()[0].total_cmp(&b.place.centre()[0]));
            for (top, bottom) in here.first().map(|node| self.rows(node)).unwrap_or_default() {
                for pair in here.windows(2) {
                    let x = self
                        .x
                        .clamped(0.5 * (pair[0].place.centre()[0] + pair[1].place.centre()[0]));
                    elements.push(stroke(svg::line((x, top), (x, bottom))));
                }
                for y in [top, bottom] {
                    let thin = stroke(svg::line((self.x.paper.0, y), (self.x.paper.1, y)));
                    elements.push(thin.with("stroke-opacity", 0.35));
                }
            }
        }
        elements
    }

    fn start(&self) -> Option<Element> {
        let start = self.map.space.start();
        let row = self
            .levels
            .iter()
            .position(|&level| level == start.stratum)?;
        let place = (self.x.clamped(start.mean[0]), self.y.at(row as f64 + 0.5));
        (self.map.start_mode() == self.mode).then(|| diamond(place))
    }
}
