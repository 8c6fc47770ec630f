//! A node as a card: its action on a coloured strip, below it where the node is and how certain the agent is there.

use crate::layout::Point;
use crate::palette::Paint;
use crate::plot::{figure, percent, range};
use crate::svg::{self, Anchor, Element, label, text_width};
use pilotage::policy::{Automaton, Node, Place};

const PAD: f64 = 10.0;
const STRIP: f64 = 24.0;
const ROW: f64 = 16.0;
const NAME: f64 = 13.0;
const SMALL: f64 = 11.5;
const CORNER: f64 = 6.0;
/// Rows of single variables; more are summed up in a last row.
const MOST_VARIABLES: usize = 6;

/// The texts of a node, and the size they need.
#[derive(Debug, Clone, PartialEq)]
pub struct Card {
    action: usize,
    name: String,
    visits: Option<f64>,
    rows: Vec<String>,
    tooltip: String,
}

impl Card {
    /// The card of a node.
    pub fn of(automaton: &Automaton, node: &Node, annotated: bool) -> Self {
        let name = named(&automaton.actions, node.action, "action");
        let rows = rows(automaton, node);
        let mut tooltip = format!("{name}, {}", rows.join(", "));
        if let Some(value) = node.value.filter(|value| value.is_finite()) {
            tooltip += &format!(", value {}", figure(value));
        }
        if annotated {
            tooltip += &format!(", {} of all steps", percent(node.visits));
        }
        Self {
            action: node.action,
            name,
            visits: annotated.then_some(node.visits),
            rows,
            tooltip,
        }
    }

    /// A card with its action, what is written on its strip, its share of all steps and the rows below.
    pub fn new(action: usize, name: String, visits: Option<f64>, rows: Vec<String>) -> Self {
        let mut tooltip = [vec![name.clone()], rows.clone()].concat().join(", ");
        if let Some(visits) = visits {
            tooltip += &format!(", {} of all steps", percent(visits));
        }
        Self {
            action,
            name,
            visits,
            rows,
            tooltip,
        }
    }

    /// Width and height.
    pub fn size(&self) -> (f64, f64) {
        let strip = text_width(&self.name, NAME) * 1.1
            + self
                .share()
                .map_or(0.0, |share| 14.0 + text_width(&share, SMALL));
        let widest = self
            .rows
            .iter()
            .map(|row| text_width(row, SMALL))
            .fold(strip, f64::max);
        (widest.ceil() + 2.0 * PAD, STRIP + self.below())
    }

    /// Height of what is below the strip.
    fn below(&self) -> f64 {
        match self.rows.len() {
            0 => 0.0,
            rows => ROW * rows as f64 + 8.0,
        }
    }

    /// Width of the frame: the more visits, the wider.
    pub fn frame(&self) -> f64 {
        1.5 + 4.0 * self.visits.unwrap_or(0.0).clamp(0.0, 1.0).sqrt()
    }

    fn share(&self) -> Option<String> {
        self.visits.map(percent)
    }

    /// The card around a centre, in a box of the given size.
    pub fn draw(&self, (x, y): Point, (width, height): (f64, f64)) -> Element {
        let (left, top) = (x - 0.5 * width, y - 0.5 * height);
        let paper = match self.rows.is_empty() {
            true => Paint::Hue(self.action),
            false => Paint::Paper,
        };
        let strip = format!(
            "M{l} {b}V{m}Q{l} {t} {i} {t}H{j}Q{r} {t} {r} {m}V{b}Z",
            l = svg::number(left),
            r = svg::number(left + width),
            t = svg::number(top),
            b = svg::number(top + STRIP),
            m = svg::number(top + CORNER),
            i = svg::number(left + CORNER),
            j = svg::number(left + width - CORNER),
        );
        let mut card = Element::new("g")
            .child(Element::new("title").text(&self.tooltip))
            .child(
                svg::rect((left, top), (width, height))
                    .with("rx", CORNER)
                    .fill(paper),
            )
            .children((!self.rows.is_empty()).then(|| {
                Element::new("path")
                    .with("d", strip)
                    .fill(Paint::Hue(self.action))
            }))
            .child(
                svg::rect((left, top), (width, height))
                    .with("rx", CORNER)
                    .with("fill", "none")
                    .stroke(Paint::LineHue(self.action), self.frame()),
            )
            .child(
                label((left + PAD, top + 17.0), NAME, Anchor::Start, &self.name)
                    .with("font-weight", "600")
                    .fill(Paint::OnHue(self.action)),
            );
        if let Some(share) = self.share() {
            let place = (left + width - PAD, top + 17.0);
            card =
                card.child(label(place, SMALL, Anchor::End, share).fill(Paint::OnHue(self.action)));
        }
        let rows = self.rows.iter().enumerate().map(|(k, row)| {
            let place = (left + PAD, top + STRIP + ROW * (k as f64 + 1.0));
            label(place, SMALL, Anchor::Start, row).fill(Paint::Ink)
        });
        card.children(rows)
    }
}

/// A name by its index, where there is one.
pub fn named(names: &[String], index: usize, kind: &str) -> String {
    names
        .get(index)
        .cloned()
        .unwrap_or_else(|| format!("{kind} {index}"))
}

fn rows(automaton: &Automaton, node: &Node) -> Vec<String> {
    let mut rows = Vec::new();
    if automaton.modes.len() > 1 {
        rows.push(named(&automaton.modes, node.mode, "mode"));
    }
    let names = automaton.place_names();
    let deviations = match automaton.coordinates {
        None => deviations(automaton, node),
        Some(_) => Vec::new(),
    };
    let alike = deviations.windows(2).all(|pair| pair[0] == pair[1]);
    for (variable, name) in names.iter().enumerate().take(MOST_VARIABLES) {
        let place = place(name, &node.place, variable);
        match deviations.get(variable) {
            Some(deviation) if !alike => rows.push(format!("{place}, σ {deviation}")),
            _ => rows.push(place),
        }
    }
    if names.len() > MOST_VARIABLES {
        rows.push(format!("and {} more", names.len() - MOST_VARIABLES));
    }
    if let (true, Some(deviation)) = (alike, deviations.first()) {
        rows.push(format!("σ = {deviation}"));
    }
    rows
}

fn place(name: &str, place: &Place, variable: usize) -> String {
    match place {
        Place::Point(point) => format!(
            "{name} = {}",
            point
                .get(variable)
                .copied()
                .map_or_else(String::new, figure)
        ),
        Place::Segment { lower, upper, .. } => match (lower.get(variable), upper.get(variable)) {
            (Some(low), Some(high)) if low.is_finite() && high.is_finite() => {
                format!("{name} from {} to {}", figure(*low), figure(*high))
            }
            (Some(low), _) if low.is_finite() => format!("{name} ≥ {}", figure(*low)),
            (_, Some(high)) if high.is_finite() => format!("{name} ≤ {}", figure(*high)),
            _ => format!("any {name}"),
        },
    }
}

/// Standard deviation of each state variable at the node's levels.
fn deviations(automaton: &Automaton, node: &Node) -> Vec<String> {
    let n = automaton.states.len();
    let levels = automaton
        .levels
        .get(node.levels.0..=node.levels.1)
        .unwrap_or_default();
    (0..n)
        .filter_map(|variable| {
            let of_level = levels
                .iter()
                .filter_map(|covariance| covariance.get(variable * (n + 1)));
            let (low, high) = of_level
                .map(|variance| variance.max(0.0).sqrt())
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), sd| {
                    (low.min(sd), high.max(sd))
                });
            (low <= high).then(|| range(low, high))
        })
        .collect()
}
