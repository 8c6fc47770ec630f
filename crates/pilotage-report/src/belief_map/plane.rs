//! The belief space in the plane of two state variables, a picture for each level and mode.

use std::fmt::Write;

use super::Map;
use super::voronoi::{Site, cells};
use crate::axes::{self, Grid};
use crate::palette::Paint;
use crate::plot::{Scale, figure};
use crate::sheet::{MARGIN, Sign, TINT, diamond};
use crate::svg::{self, Anchor, Element, label, number, text_width};
use pilotage::belief::{Belief, Codebook, StratumId};
use pilotage::model::{ModeId, Region};
use pilotage::policy::{Automaton, Matching, Node, Place};

/// Longer side of a panel.
const SIDE: f64 = 300.0;
/// The same where there is only one.
const LONE_SIDE: f64 = 420.0;
const GAP: f64 = 28.0;
const HEADING: f64 = 44.0;
/// From the name of what goes up to the panel.
const NAME: f64 = 8.0;
const MOST_LEVELS: usize = 4;
const MOST_PANELS: usize = 9;
/// Beliefs asked along the longer side.
const SAMPLES: usize = 150;

pub fn draw(map: &Map<'_>) -> String {
    let plane = Plane::new(map);
    let panels = &plane.panels;
    let columns = if panels.len() == 4 {
        2
    } else {
        panels.len().min(3)
    };
    let name = text_width(plane.name(plane.up), axes::TEXT) + NAME;
    let left = axes::left_of(plane.extent.1).max(name.ceil());
    let (plot_width, plot_height) = plane.size();
    let panel_width = left + plot_width;
    let width = columns as f64 * panel_width + (columns - 1) as f64 * GAP;
    let mut sheet = map.sheet(&plane.caption(), width);
    for row in panels.chunks(columns) {
        let top = sheet.y() + HEADING;
        let elements: Vec<Element> = row
            .iter()
            .enumerate()
            .flat_map(|(column, &(mode, level))| {
                let edge = MARGIN + column as f64 * (panel_width + GAP) + left;
                let panel = Panel {
                    plane: &plane,
                    mode,
                    level,
                    x: Scale::new(plane.extent.0, (edge, edge + plot_width)),
                    y: Scale::new(plane.extent.1, (top + plot_height, top)),
                };
                panel.draw()
            })
            .collect();
        sheet.draw(elements, HEADING + plot_height + axes::BELOW);
    }
    let mut marks = Vec::new();
    if panels.iter().any(|&panel| plane.shows_start(panel)) {
        marks.push((Sign::Diamond, "start".to_owned()));
    }
    if panels.iter().any(|(mode, _)| !map.goals(*mode).is_empty()) {
        marks.push((Sign::Frame(Paint::Ink), "where a reward is paid".to_owned()));
    }
    sheet.legend(&map.legend(marks));
    sheet.draw([], 14.0);
    if let Some(automaton) = map.automaton.filter(|automaton| shows_nodes(automaton)) {
        sheet.note(match automaton.matching {
            Matching::Nearest if map.space.model().state_dim() == 2 => {
                "Circles: the automaton's nodes. Thin lines: borders between them."
            }
            Matching::Nearest => "Thin lines: borders between the automaton's nodes.",
            Matching::Segments => "Thin frames: the automaton's segments.",
            Matching::Tree => "Thin frames: where the beliefs of the tree's nodes lie.",
        });
    }
    sheet.note("σ: standard deviation of the belief. Dashed: bounds of the world.");
    sheet.finish()
}

/// Leaves of slanted tests are no boxes, and frames around them would overlap.
fn shows_nodes(automaton: &Automaton) -> bool {
    let tests = automaton.tree.iter().flat_map(|tree| &tree.tests);
    tests.into_iter().all(|test| test.plus.is_empty())
}

/// Which two variables are drawn, which levels, and what the other variables are.
struct Plane<'a> {
    map: &'a Map<'a>,
    across: usize,
    up: usize,
    extent: ((f64, f64), (f64, f64)),
    panels: Vec<(ModeId, StratumId)>,
}

impl<'a> Plane<'a> {
    fn new(map: &'a Map<'a>) -> Self {
        let n = map.space.model().state_dim();
        let (across, up) = if n == 2 { (0, 1) } else { most_uncertain(map) };
        let panels = match map.codebook() {
            Some(codebook) if n == 2 => sure_of(map, codebook),
            _ => {
                let levels = match n {
                    2 => chosen_levels(map),
                    _ => vec![map.steady_level()],
                };
                let modes = map.modes().into_iter();
                let of = |mode| levels.iter().map(move |&level| (mode, level));
                modes.flat_map(of).collect()
            }
        };
        Self {
            map,
            across,
            up,
            extent: (map.extent(across), map.extent(up)),
            panels,
        }
    }

    /// Name of a variable.
    fn name(&self, variable: usize) -> &str {
        &self.map.space.model().state[variable].name
    }

    /// Size of a panel, true to scale unless that makes it thin.
    fn size(&self) -> (f64, f64) {
        let width = |(low, high): (f64, f64)| high - low;
        let ratio = width(self.extent.0) / width(self.extent.1);
        let side = if self.panels.len() == 1 {
            LONE_SIDE
        } else {
            SIDE
        };
        match ratio {
            flat if (1.0..=3.0).contains(&flat) => (side, side / flat),
            tall if (1.0 / 3.0..1.0).contains(&tall) => (side * tall, side),
            _ => (side, side),
        }
    }

    fn caption(&self) -> String {
        let n = self.map.space.model().state_dim();
        let (across, up) = (self.name(self.across), self.name(self.up));
        let total = self.map.space.strata();
        if n == 2 {
            let mut levels: Vec<StratumId> = self.panels.iter().map(|panel| panel.1).collect();
            levels.sort_unstable();
            levels.dedup();
            let shown = levels.len();
            let of = if shown < total {
                format!("{shown} of {total}")
            } else {
                format!("{total}")
            };
            let plural = if total == 1 { "level" } else { "levels" };
            return format!("Mean of {across} across, of {up} up; {of} {plural}.");
        }
        let start = &self.map.space.start().mean;
        let others = (0..n).filter(|&variable| variable != self.across && variable != self.up);
        let fixed: Vec<String> = others
            .map(|variable| format!("{} = {}", self.name(variable), figure(start[variable])))
            .collect();
        format!(
            "A slice at the steady level: mean of {across} across, of {up} up, the two least certain for the width of their bounds; {}, as at the start.",
            fixed.join(", ")
        )
    }

    fn belief(&self, level: StratumId, mode: ModeId, (x, y): (f64, f64)) -> Belief {
        let mut mean = self.map.space.start().mean.clone();
        mean[self.across] = x;
        mean[self.up] = y;
        Belief {
            stratum: level,
            mode,
            mean,
        }
    }

    /// Whether the start is a belief of a panel.
    fn shows_start(&self, (mode, level): (ModeId, StratumId)) -> bool {
        let start = self.map.space.start();
        // Where how likely modes are belongs to the level, the mode is not asked for.
        start.stratum == level && (self.map.codebook().is_some() || self.map.start_mode() == mode)
    }

    /// Squared distance of a place from the plane, in the automaton's scale.
    fn apart(&self, place: &Place, scale: &[f64]) -> f64 {
        let centre = place.centre();
        let mut mean = self.map.space.start().mean.clone();
        mean[self.across] = centre[self.across];
        mean[self.up] = centre[self.up];
        place.distance(&mean, scale)
    }

    /// The part of a region that is seen: its sides along both axes, where the variables outside the plane are in it.
    fn seen(&self, region: &Region) -> Option<((f64, f64), (f64, f64))> {
        let start = &self.map.space.start().mean;
        let (mut x, mut y) = self.extent;
        for &(variable, side) in &region.sides {
            if variable == self.across {
                x = (x.0.max(side.low), x.1.min(side.high));
            } else if variable == self.up {
                y = (y.0.max(side.low), y.1.min(side.high));
            } else if !side.contains(start[variable]) {
                return None;
            }
        }
        (x.0 < x.1 && y.0 < y.1 && (x, y) != self.extent).then_some((x, y))
    }
}

/// The two variables with the largest standard deviation at the steady level, measured by the width of their bounds.
fn most_uncertain(map: &Map<'_>) -> (usize, usize) {
    let level = map.steady_level();
    let relative = |variable: usize| {
        let width = map.space.model().state[variable].bounds.width();
        map.deviation(level, variable) / if width.is_finite() { width } else { 1.0 }
    };
    let mut variables: Vec<usize> = (0..map.space.model().state_dim()).collect();
    variables.sort_by(|&a, &b| relative(b).total_cmp(&relative(a)).then(a.cmp(&b)));
    (
        variables[0].min(variables[1]),
        variables[0].max(variables[1]),
    )
}

/// The least and the most certain level and some between.
fn chosen_levels(map: &Map<'_>) -> Vec<StratumId> {
    let ordered = map.ordered_levels();
    let count = ordered.len().min(MOST_LEVELS);
    let last = ordered.len() - 1;
    (0..count)
        .map(|k| ordered[(k * last).checked_div(count - 1).unwrap_or(0)])
        .collect()
}

/// The start, and for each mode the level that is surest of it, most panels at most. Who keeps a belief in full asks how likely modes are, and
/// believes in none.
fn sure_of(map: &Map<'_>, codebook: &Codebook) -> Vec<(ModeId, StratumId)> {
    let panel = |stratum: StratumId| (codebook.stratum(stratum).mode(), stratum);
    let surest = |mode: ModeId| {
        let weight = |stratum: &StratumId| codebook.stratum(*stratum).weights[mode];
        let of_mode = (0..codebook.len()).filter(|&stratum| panel(stratum).0 == mode);
        of_mode.max_by(|a, b| weight(a).total_cmp(&weight(b)).then(b.cmp(a)))
    };
    let start = map.space.start().stratum;
    let modes = 0..map.space.model().modes.len();
    let others = modes.filter_map(surest).filter(|&stratum| stratum != start);
    let all = std::iter::once(start).chain(others);
    all.map(panel).take(MOST_PANELS).collect()
}

struct Panel<'a> {
    plane: &'a Plane<'a>,
    mode: ModeId,
    level: StratumId,
    x: Scale,
    y: Scale,
}

impl Panel<'_> {
    fn draw(&self) -> Vec<Element> {
        let mut elements = axes::horizontal(
            &self.x,
            (self.y.paper.1, self.y.paper.0),
            self.plane.name(self.plane.across),
            Grid::Strokes,
        );
        elements.extend(axes::vertical(&self.x, &self.y, Grid::Strokes));
        elements.push(self.heading());
        elements.push(
            label(
                (self.x.paper.0 - NAME, self.y.paper.1 - 10.0),
                axes::TEXT,
                Anchor::End,
                self.plane.name(self.plane.up),
            )
            .fill(Paint::Ink),
        );
        elements.push(self.areas());
        elements.extend(self.walls());
        elements.push(self.frame());
        let automaton = self.plane.map.automaton;
        if let Some(automaton) = automaton.filter(|automaton| shows_nodes(automaton)) {
            elements.extend(self.nodes(automaton));
        }
        elements.extend(self.goals());
        elements.extend(self.start());
        elements
    }

    fn heading(&self) -> Element {
        let map = self.plane.map;
        let deviations = map.deviations(self.level, &[self.plane.across, self.plane.up]);
        let weights = map
            .codebook()
            .map(|codebook| &codebook.stratum(self.level).weights);
        let text = match (map.mode_name(self.mode), weights) {
            ("", _) => deviations,
            (mode, None) => format!("{mode}, {deviations}"),
            (mode, Some(weights)) => {
                let percent = 100.0 * weights[self.mode];
                format!("{mode} {percent:.0} %, {deviations}")
            }
        };
        let middle = 0.5 * (self.x.paper.0 + self.x.paper.1);
        label(
            (middle, self.y.paper.1 - 10.0),
            axes::TEXT + 0.5,
            Anchor::Middle,
            text,
        )
        .fill(Paint::Ink)
    }

    fn point(&self, (x, y): (f64, f64)) -> (f64, f64) {
        (self.x.clamped(x), self.y.clamped(y))
    }

    /// A frame around what lies between two corners.
    fn boxed(&self, (x, y): ((f64, f64), (f64, f64))) -> Element {
        let (left, bottom) = self.point((x.0, y.0));
        let (right, top) = self.point((x.1, y.1));
        svg::rect((left, top), (right - left, bottom - top))
    }

    /// One path for each action, made of strips of equal action in each row.
    fn areas(&self) -> Element {
        let size = (
            self.x.paper.1 - self.x.paper.0,
            self.y.paper.0 - self.y.paper.1,
        );
        let cell = size.0.max(size.1) / SAMPLES as f64;
        let (columns, rows) = (
            (size.0 / cell).round() as usize,
            (size.1 / cell).round() as usize,
        );
        let value = |scale: &Scale, k: usize, count: usize| {
            scale.data.0 + (scale.data.1 - scale.data.0) * (k as f64 + 0.5) / count as f64
        };
        let actions = pilotage::parallel::map(rows, |row| {
            let y = value(&self.y, row, rows);
            let at = |column| {
                self.plane
                    .belief(self.level, self.mode, (value(&self.x, column, columns), y))
            };
            (0..columns)
                .map(|column| self.plane.map.policy.action(&at(column)))
                .collect::<Vec<_>>()
        });
        let mut paths = vec![String::new(); self.plane.map.space.model().actions.len()];
        let (width, height) = (size.0 / columns as f64, size.1 / rows as f64);
        for (row, actions) in actions.iter().enumerate() {
            let top = self.y.paper.0 - (row + 1) as f64 * height;
            let mut column = 0;
            for strip in actions.chunk_by(|a, b| a == b) {
                let left = self.x.paper.0 + column as f64 * width;
                let across = number(strip.len() as f64 * width);
                if let Some(path) = paths.get_mut(strip[0]) {
                    let _ = write!(
                        path,
                        "M{} {}h{across}v{}h-{across}z",
                        number(left),
                        number(top),
                        number(height)
                    );
                }
                column += strip.len();
            }
        }
        let filled = paths
            .into_iter()
            .enumerate()
            .filter(|(_, path)| !path.is_empty());
        Element::new("g")
            .with("fill-opacity", TINT)
            .with("shape-rendering", "crispEdges")
            .children(filled.map(|(action, path)| {
                Element::new("path")
                    .with("d", path)
                    .fill(Paint::Hue(action))
            }))
    }

    fn frame(&self) -> Element {
        let states = &self.plane.map.space.model().state;
        let (across, up) = (
            states[self.plane.across].bounds,
            states[self.plane.up].bounds,
        );
        self.boxed(((across.low, across.high), (up.low, up.high)))
            .with("fill", "none")
            .stroke(Paint::Ink, 1.0)
            .with("stroke-opacity", 0.5)
            .with("stroke-dasharray", "4 3")
    }

    /// Blocked cells and thin walls of a grid map, where the plane is the map's.
    fn walls(&self) -> Vec<Element> {
        let model = self.plane.map.space.model();
        let Some(map) = model
            .map
            .as_ref()
            .filter(|_| (self.plane.across, self.plane.up) == (0, 1))
        else {
            return Vec::new();
        };
        let blocked = map
            .blocked
            .iter()
            .filter_map(|region| self.plane.seen(region));
        let cells = blocked.map(|seen| self.boxed(seen).fill(Paint::Muted));
        let walls = map.walls.iter().map(|[from, to]| {
            svg::line(self.point((from[0], from[1])), self.point((to[0], to[1])))
                .stroke(Paint::Muted, 4.0)
                .with("stroke-linecap", "round")
        });
        cells.chain(walls).collect()
    }

    fn goals(&self) -> Vec<Element> {
        let goals = self.plane.map.goals(self.mode);
        let seen = goals
            .into_iter()
            .filter_map(|region| self.plane.seen(region));
        seen.map(|seen| {
            self.boxed(seen)
                .with("fill", "none")
                .stroke(Paint::Ink, 2.5)
        })
        .collect()
    }

    fn nodes(&self, automaton: &Automaton) -> Vec<Element> {
        let holds = |node: &&Node| node.levels.0 <= self.level && self.level <= node.levels.1;
        let nodes: Vec<&Node> = self.plane.map.nodes(self.mode).filter(holds).collect();
        match automaton.matching {
            Matching::Nearest => self.points(&nodes, &automaton.scale),
            Matching::Segments | Matching::Tree => self.segments(&nodes, &automaton.scale),
        }
    }

    fn points(&self, nodes: &[&Node], scale: &[f64]) -> Vec<Element> {
        let (across, up) = (self.plane.across, self.plane.up);
        let sites: Vec<Site> = nodes
            .iter()
            .map(|node| {
                let centre = node.place.centre();
                Site {
                    at: (centre[across], centre[up]),
                    apart: self.plane.apart(&node.place, scale),
                }
            })
            .collect();
        let (low, high) = (
            (self.x.data.0, self.y.data.0),
            (self.x.data.1, self.y.data.1),
        );
        let cells = cells(&sites, low, high, (scale[across], scale[up]));
        let borders = cells.iter().filter(|cell| cell.len() > 2).map(|cell| {
            let corners: Vec<(f64, f64)> = cell.iter().map(|&corner| self.point(corner)).collect();
            svg::through(&corners, true)
                .with("fill", "none")
                .stroke(Paint::Ink, 0.6)
                .with("stroke-opacity", 0.5)
        });
        // Many small dots instead of a few large ones that cover each other.
        let radius = (40.0 / (nodes.len().max(1) as f64).sqrt()).clamp(2.0, 4.5);
        let in_plane = nodes
            .iter()
            .zip(&sites)
            .filter(|(_, site)| site.apart == 0.0);
        let dots = in_plane.map(|(node, site)| {
            svg::circle(self.point(site.at), radius)
                .fill(Paint::Hue(node.action))
                .stroke(Paint::Ink, 0.25 * radius)
        });
        borders.chain(dots).collect()
    }

    fn segments(&self, nodes: &[&Node], scale: &[f64]) -> Vec<Element> {
        let (across, up) = (self.plane.across, self.plane.up);
        nodes
            .iter()
            .filter(|node| self.plane.apart(&node.place, scale) == 0.0)
            .filter_map(|node| match &node.place {
                Place::Segment { lower, upper, .. } => Some(
                    self.boxed(((lower[across], upper[across]), (lower[up], upper[up])))
                        .with("fill", "none")
                        .stroke(Paint::Ink, 0.8)
                        .with("stroke-opacity", 0.7),
                ),
                Place::Point(_) => None,
            })
            .collect()
    }

    fn start(&self) -> Option<Element> {
        let start = self.plane.map.space.start();
        let here = self.plane.shows_start((self.mode, self.level));
        here.then(|| {
            diamond(self.point((start.mean[self.plane.across], start.mean[self.plane.up])))
        })
    }
}
