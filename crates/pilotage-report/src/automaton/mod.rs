//! The automaton as a graph (Figures 5.9, 5.12 and 5.14).

mod card;
mod choice;

use card::{Card, named};
use choice::{Arrow, Choice};

use super::is_sound;
use super::layout::{self, Link, Point, Route};
use super::palette::Paint;
use super::plot::percent;
use super::sheet::{MARGIN, Sheet, Sign};
use super::svg::{self, Anchor, Element, label, number, text_width};
use pilotage::error::{Error, Result};
use pilotage::policy::{Automaton, Matching};

const LABEL: f64 = 11.0;
const HEAD: f64 = 8.0;
const RATIO: f64 = 1.5;
const LEAST_WIDTH: f64 = 520.0;
/// Width and height of the dot from which the start node is entered.
const START: (f64, f64) = (14.0, 14.0);

/// Draws an automaton: a card for every node, arrows from node to node as they followed each other when the automaton was
/// run. Of more than forty nodes the most visited are drawn.
///
/// # Errors
/// [`Error::Policy`] if a place, a covariance or a count is not a number.
pub fn automaton_svg(automaton: &Automaton) -> Result<String> {
    check(automaton)?;
    let choice = Choice::of(automaton);
    let annotated = automaton.nodes.iter().any(|node| node.visits > 0.0);
    let cards: Vec<Card> = choice
        .nodes
        .iter()
        .map(|&id| Card::of(automaton, &automaton.nodes[id], annotated))
        .collect();
    // One size for all looks calm and lets the eye compare.
    let size = cards
        .iter()
        .map(Card::size)
        .fold((0.0_f64, 0.0_f64), |(w, h), card| {
            (w.max(card.0), h.max(card.1))
        });
    let labelled = choice.labelled;
    let mut boxes = vec![size; cards.len()];
    let mut links: Vec<Link> = choice
        .arrows
        .iter()
        .map(|arrow| link(arrow, labelled))
        .collect();
    if choice.start.is_some() {
        boxes.push(START);
        links.push(Link {
            from: cards.len(),
            to: 0,
            label: (0.0, 0.0),
        });
    }
    let layout = layout::largest_on_paper(&boxes, &links, RATIO);

    let mut sheet = Sheet::new(
        &format!("Automaton of {}", automaton.problem),
        &subtitle(automaton),
        &description(automaton, annotated),
        layout.size.0.max(LEAST_WIDTH),
    );
    let indent = 0.5 * (LEAST_WIDTH - layout.size.0).max(0.0);
    let corner = (MARGIN + indent, sheet.y() + 4.0);
    let placed = |point: Point| (point.0 + corner.0, point.1 + corner.1);
    let mut ways = Vec::new();
    let mut labels = Vec::new();
    for (k, route) in layout.routes.iter().enumerate() {
        let arrow = choice.arrows.get(k);
        let points: Vec<Point> = route.points.iter().copied().map(placed).collect();
        let gap = |card: usize| cards.get(card).map_or(0.0, |card| 0.5 * card.frame());
        ways.extend(match arrow {
            Some(arrow) => {
                let gaps = (gap(arrow.from), gap(arrow.to));
                let width = 1.0 + 2.5 * arrow.share;
                drawn_arrow(&points, gaps, arrow.both, width, Paint::Arrow)
            }
            None => drawn_arrow(&points, (0.0, gap(0)), false, 1.6, Paint::Ink),
        });
        if let Some(arrow) = arrow.filter(|_| labelled) {
            labels.extend(arrow_label(arrow, route, placed));
        }
    }
    let nodes = cards
        .iter()
        .zip(&layout.centres)
        .map(|(card, &centre)| card.draw(placed(centre), size));
    let dot = layout
        .centres
        .get(cards.len())
        .map(|&centre| svg::circle(placed(centre), 5.0).fill(Paint::Ink));
    sheet.draw(
        ways.into_iter().chain(nodes).chain(dot).chain(labels),
        layout.size.1 + 16.0,
    );
    sheet.legend(&legend(automaton, choice.start.is_some()));
    notes(&mut sheet, automaton, &choice, annotated, labelled);
    Ok(sheet.finish())
}

fn check(automaton: &Automaton) -> Result<()> {
    let numbers = automaton.nodes.iter().map(|node| {
        let counts = node.predecessors.iter().all(|(_, count)| count.is_finite());
        is_sound(&node.place, automaton.place_names().len()) && counts && node.visits.is_finite()
    });
    let levels = automaton.levels.iter().flatten().all(|x| x.is_finite());
    let reason = match numbers.enumerate().find(|(_, sound)| !sound) {
        Some((id, _)) => format!(
            "node {id} has a place, count or share that is not a number, or not one a variable"
        ),
        None if !levels => "a level has a covariance that is not a number".to_owned(),
        None => return Ok(()),
    };
    Err(Error::Policy {
        origin: automaton.problem.clone(),
        reason,
    })
}

fn link(arrow: &Arrow, labelled: bool) -> Link {
    let label = if labelled {
        (text_width(&percent(arrow.share), LABEL) + 8.0, LABEL + 6.0)
    } else {
        (0.0, 0.0)
    };
    Link {
        from: arrow.from,
        to: arrow.to,
        label,
    }
}

fn arrow_label(arrow: &Arrow, route: &Route, placed: impl Fn(Point) -> Point) -> [Element; 2] {
    let (x, y) = placed(route.label);
    let text = percent(arrow.share);
    let width = text_width(&text, LABEL) + 4.0;
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

fn subtitle(automaton: &Automaton) -> String {
    let nodes = automaton.nodes.len();
    let matching = match automaton.matching {
        Matching::Nearest => "nearest point",
        Matching::Segments => "belief segments",
        Matching::Tree => "a decision tree",
    };
    let plural = if nodes == 1 { "" } else { "s" };
    format!(
        "{nodes} node{plural}, matched by {matching}, made by {}",
        automaton.solver
    )
}

fn description(automaton: &Automaton, annotated: bool) -> String {
    let mut nodes: Vec<(f64, String)> = automaton
        .nodes
        .iter()
        .map(|node| {
            (
                node.visits,
                named(&automaton.actions, node.action, "action"),
            )
        })
        .collect();
    nodes.sort_by(|a, b| b.0.total_cmp(&a.0));
    let told: Vec<String> = nodes
        .into_iter()
        .take(5)
        .map(|(visits, action)| {
            if annotated {
                format!("{action} {}", percent(visits))
            } else {
                action
            }
        })
        .collect();
    format!(
        "Finite automaton, {}. Most visited nodes: {}.",
        subtitle(automaton),
        told.join(", ")
    )
}

fn legend(automaton: &Automaton, has_start: bool) -> Vec<(Sign, String)> {
    let mut entries: Vec<(Sign, String)> = automaton
        .actions
        .iter()
        .enumerate()
        .map(|(action, name)| {
            if automaton.nodes.iter().any(|node| node.action == action) {
                (Sign::Area(Paint::Hue(action)), name.clone())
            } else {
                (
                    Sign::Frame(Paint::LineHue(action)),
                    format!("{name} (never chosen)"),
                )
            }
        })
        .collect();
    if has_start {
        entries.push((Sign::Disc(Paint::Ink), "start".to_owned()));
    }
    entries
}

fn notes(
    sheet: &mut Sheet,
    automaton: &Automaton,
    choice: &Choice,
    annotated: bool,
    labelled: bool,
) {
    sheet.draw([], 14.0);
    let left_out = automaton.nodes.len() - choice.nodes.len();
    if left_out > 0 {
        let verb = if left_out == 1 {
            "node is"
        } else {
            "nodes are"
        };
        sheet.note(&format!(
            "The {} most visited nodes; {left_out} more {verb} left out, with {} of all steps.",
            choice.nodes.len(),
            percent(choice.visits_left_out)
        ));
    }
    if annotated {
        let told = if labelled {
            "how often each is followed from its node"
        } else {
            "the more often followed, the wider"
        };
        sheet.note(&format!(
            "Top right: share of all steps that is spent in the node. Arrows: {told}; those with less than {:.0}% of a node's arrivals are left out. σ: standard deviation of the belief.",
            100.0 * choice.least_share
        ));
    } else {
        sheet.note("Arrows and visits are not known: the automaton has not been run. σ: standard deviation of the belief.");
    }
}
