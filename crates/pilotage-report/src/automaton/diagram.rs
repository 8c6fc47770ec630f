//! Cards in layers, with arrows from card to card.

use super::card::Card;
use crate::layout::{self, Layout, Link, Point, Route};
use crate::palette::Paint;
use crate::sheet::{MARGIN, Sheet};
use crate::svg::{self, Anchor, Element, label, number, text_width};

const LABEL: f64 = 11.0;
const HEAD: f64 = 8.0;
const RATIO: f64 = 1.5;
/// Least width of a sheet with a diagram.
pub const LEAST_WIDTH: f64 = 520.0;
/// Width and height of the dot from which the first card is entered.
const START: (f64, f64) = (14.0, 14.0);

/// An arrow from one card to another, by their positions, or to itself.
#[derive(Debug, Clone, PartialEq)]
pub struct Arrow {
    /// Card that it leaves.
    pub from: usize,
    /// Card that it enters.
    pub to: usize,
    /// Width of its line.
    pub width: f64,
    /// Whether it has heads at both ends.
    pub both: bool,
    /// What stands on it.
    pub label: Option<String>,
}

/// Cards and arrows that have their places.
pub struct Diagram {
    cards: Vec<Card>,
    arrows: Vec<Arrow>,
    /// One size for all cards looks calm and lets the eye compare.
    size: (f64, f64),
    layout: Layout,
}

impl Diagram {
    /// Lays out cards and arrows; with `has_start` the first card is entered from a dot.
    pub fn new(cards: Vec<Card>, arrows: Vec<Arrow>, has_start: bool) -> Self {
        let size = cards
            .iter()
            .map(Card::size)
            .fold((0.0_f64, 0.0_f64), |(w, h), card| {
                (w.max(card.0), h.max(card.1))
            });
        let mut boxes = vec![size; cards.len()];
        let mut links: Vec<Link> = arrows.iter().map(link).collect();
        if has_start {
            boxes.push(START);
            links.push(Link {
                from: cards.len(),
                to: 0,
                label: (0.0, 0.0),
            });
        }
        Self {
            layout: layout::largest_on_paper(&boxes, &links, RATIO),
            cards,
            arrows,
            size,
        }
    }

    /// Width and height.
    pub fn size(&self) -> (f64, f64) {
        self.layout.size
    }

    /// Puts it on a sheet, in the middle of a narrow one.
    pub fn put_on(&self, sheet: &mut Sheet) {
        let indent = 0.5 * (LEAST_WIDTH - self.layout.size.0).max(0.0);
        let corner = (MARGIN + indent, sheet.y() + 4.0);
        sheet.draw(self.draw(corner), self.layout.size.1 + 16.0);
    }

    /// What is drawn, with its upper left corner there: arrows below cards, labels above all.
    fn draw(&self, corner: Point) -> Vec<Element> {
        let placed = |point: Point| (point.0 + corner.0, point.1 + corner.1);
        let gap = |card: usize| self.cards.get(card).map_or(0.0, |card| 0.5 * card.frame());
        let mut drawn = Vec::new();
        let mut labels = Vec::new();
        for (k, route) in self.layout.routes.iter().enumerate() {
            let points: Vec<Point> = route.points.iter().copied().map(placed).collect();
            drawn.extend(match self.arrows.get(k) {
                Some(arrow) => {
                    let gaps = (gap(arrow.from), gap(arrow.to));
                    drawn_arrow(&points, gaps, arrow.both, arrow.width, Paint::Arrow)
                }
                None => drawn_arrow(&points, (0.0, gap(0)), false, 1.6, Paint::Ink),
            });
            if let Some(text) = self.arrows.get(k).and_then(|arrow| arrow.label.as_ref()) {
                labels.extend(arrow_label(text, route, placed));
            }
        }
        let cards = self.cards.iter().zip(&self.layout.centres);
        drawn.extend(cards.map(|(card, &centre)| card.draw(placed(centre), self.size)));
        let dot = self.layout.centres.get(self.cards.len());
        drawn.extend(dot.map(|&centre| svg::circle(placed(centre), 5.0).fill(Paint::Ink)));
        drawn.extend(labels);
        drawn
    }
}

fn link(arrow: &Arrow) -> Link {
    let label = arrow.label.as_ref().map_or((0.0, 0.0), |text| {
        (text_width(text, LABEL) + 8.0, LABEL + 6.0)
    });
    Link {
        from: arrow.from,
        to: arrow.to,
        label,
    }
}

fn arrow_label(text: &str, route: &Route, placed: impl Fn(Point) -> Point) -> [Element; 2] {
    let (x, y) = placed(route.label);
    let width = text_width(text, LABEL) + 4.0;
    [
        svg::rect((x - 0.5 * width, y - 7.0), (width, 14.0))
            .with("rx", 3.0)
            .fill(Paint::Paper),
        label((x, y + 4.0), LABEL, Anchor::Middle, text).fill(Paint::Ink),
    ]
}

/// A uniform cubic B-spline through its ends, with a head before the frame of the box it enters, or of both boxes. `gaps` are
/// the widths of the frames outside the boxes, at its first and last point.
fn drawn_arrow(
    points: &[Point],
    gaps: (f64, f64),
    both: bool,
    width: f64,
    paint: Paint,
) -> Vec<Element> {
    let mut way = points.to_vec();
    let mut heads = Vec::new();
    heads.extend(head(&mut way, gaps.1).map(|head| head.fill(paint)));
    if both {
        way.reverse();
        heads.extend(head(&mut way, gaps.0).map(|head| head.fill(paint)));
    }
    let line = Element::new("path")
        .with("d", spline(&way))
        .with("fill", "none")
        .stroke(paint, width);
    [line].into_iter().chain(heads).collect()
}

/// An arrow head at the end of a way, which is shortened to meet it.
fn head(way: &mut [Point], gap: f64) -> Option<Element> {
    let [.., before, end] = way else {
        return None;
    };
    let (dx, dy) = (end.0 - before.0, end.1 - before.1);
    let length = dx.hypot(dy).max(1e-9);
    let (ux, uy) = (dx / length, dy / length);
    let tip = *end;
    let back = |by: f64| (tip.0 - by * ux, tip.1 - by * uy);
    let (tip, neck) = (back(gap), back(gap + HEAD));
    let reach = 0.5 * HEAD;
    *end = back((gap + HEAD - 1.0).min(length));
    let corners = [
        tip,
        (neck.0 - reach * uy, neck.1 + reach * ux),
        (neck.0 + reach * uy, neck.1 - reach * ux),
    ];
    Some(svg::through(&corners, true))
}

fn spline(points: &[Point]) -> String {
    let text = |(x, y): Point| format!("{} {}", number(x), number(y));
    let mix = |a: Point, b: Point, c: Point, weights: [f64; 3]| {
        let total: f64 = weights.iter().sum();
        let sum =
            |a: f64, b: f64, c: f64| (weights[0] * a + weights[1] * b + weights[2] * c) / total;
        (sum(a.0, b.0, c.0), sum(a.1, b.1, c.1))
    };
    let [first, .., last] = points else {
        return String::new();
    };
    if points.len() == 2 {
        return format!("M{}L{}", text(*first), text(*last));
    }
    let mut d = format!(
        "M{}L{}",
        text(*first),
        text(mix(points[0], points[1], points[1], [5.0, 1.0, 0.0]))
    );
    let bend = |d: &mut String, a: Point, b: Point, c: Point| {
        let controls = [
            mix(a, b, c, [2.0, 1.0, 0.0]),
            mix(a, b, c, [1.0, 2.0, 0.0]),
            mix(a, b, c, [1.0, 4.0, 1.0]),
        ];
        *d += &format!(
            "C{} {} {}",
            text(controls[0]),
            text(controls[1]),
            text(controls[2])
        );
    };
    for three in points.windows(3) {
        bend(&mut d, three[0], three[1], three[2]);
    }
    bend(&mut d, points[points.len() - 2], *last, *last);
    d + &format!("L{}", text(*last))
}
