//! The ways of links between boxes that have their places.

use std::collections::BTreeMap;

use dagre::EdgeLabel;

use super::{Direction, Link, Point, Route};

/// How far a loop reaches out of its box.
pub const LOOP_REACH: f64 = 24.0;
/// Half the distance between the two feet of a loop.
const LOOP_FOOT: f64 = 9.0;
/// How far a link goes straight out of its box.
const STUB: f64 = 16.0;
/// How far before and behind a layer a link goes straight.
const CLEAR: f64 = 6.0;

pub fn routed(edge: &EdgeLabel) -> Route {
    let points: Vec<Point> = edge.points.iter().map(|point| (point.x, point.y)).collect();
    let middle = points.get(points.len() / 2).copied().unwrap_or((0.0, 0.0));
    let label = edge.x.zip(edge.y).unwrap_or(middle);
    Route { points, label }
}

pub fn straight(from: Point, to: Point) -> Route {
    Route {
        points: vec![from, to],
        label: (0.5 * (from.0 + to.0), 0.5 * (from.1 + to.1)),
    }
}

/// A loop out of the side of the box where the layout has kept room: to the right between layers going down, below between
/// layers going right.
pub fn looped(
    (x, y): Point,
    (width, height): (f64, f64),
    label: (f64, f64),
    direction: Direction,
) -> Route {
    let bend = 2.0 * LOOP_FOOT;
    match direction {
        Direction::Down => {
            let (side, tip) = (x + 0.5 * width, x + 0.5 * width + LOOP_REACH);
            Route {
                points: vec![
                    (side, y - LOOP_FOOT),
                    (tip, y - bend),
                    (tip, y + bend),
                    (side, y + LOOP_FOOT),
                ],
                label: (tip + 0.5 * label.0, y),
            }
        }
        Direction::Right => {
            let (side, tip) = (y + 0.5 * height, y + 0.5 * height + LOOP_REACH);
            Route {
                points: vec![
                    (x - LOOP_FOOT, side),
                    (x - bend, tip),
                    (x + bend, tip),
                    (x + LOOP_FOOT, side),
                ],
                label: (x + bend + 0.5 * label.0, side + 0.5 * LOOP_REACH),
            }
        }
    }
}

/// Lets routes pass between the boxes of a layer straight, and straight through the middle of their labels, so that they turn
/// in the room between layers only.
pub fn straighten(
    routes: &mut [Route],
    links: &[Link],
    boxes: &[(f64, f64)],
    centres: &[Point],
    direction: Direction,
) {
    const SAME: f64 = 0.5;
    let axes = |point| along_and_across(point, direction);
    let half = 0.5 * boxes.iter().map(|&size| axes(size).1).fold(0.0, f64::max);
    let in_layer = |across: f64| {
        centres
            .iter()
            .any(|&centre| (axes(centre).1 - across).abs() < SAME)
    };
    for (route, link) in routes
        .iter_mut()
        .zip(links)
        .filter(|(_, link)| link.from != link.to)
    {
        let [first, inner @ .., last] = route.points.as_slice() else {
            continue;
        };
        let onwards = (axes(*last).1 - axes(*first).1).signum();
        let label = (link.label.0 > 0.0).then_some(axes(route.label));
        let mut labelled = false;
        let mut points = vec![*first];
        for &point in inner {
            let (along, across) = axes(point);
            let at_label =
                label.filter(|label| (label.1 - across).abs() <= 0.5 * axes(link.label).1 + SAME);
            if let Some((along, across)) = at_label {
                if !std::mem::replace(&mut labelled, true) {
                    let reach = onwards * 0.5 * axes(link.label).1;
                    points.extend([-reach, 0.0, reach].map(|by| axes((along, across + by))));
                }
            } else if in_layer(across) {
                let reach = onwards * (half + CLEAR);
                points.extend([-reach, reach].map(|by| axes((along, across + by))));
            } else {
                points.push(point);
            }
        }
        points.push(*last);
        route.points = points;
    }
}

/// A point or size along the layers and across them, or back.
fn along_and_across((x, y): (f64, f64), direction: Direction) -> (f64, f64) {
    match direction {
        Direction::Down => (x, y),
        Direction::Right => (y, x),
    }
}

/// One end of a route.
struct End {
    route: usize,
    is_last: bool,
    /// Where along the face of the box its way goes on.
    towards: f64,
}

/// Lets routes leave and enter boxes at right angles, side by side in the order in which they go on, and not through boxes
/// beside their own.
pub fn attach(
    routes: &mut [Route],
    links: &[Link],
    boxes: &[(f64, f64)],
    centres: &[Point],
    direction: Direction,
) {
    let axes = |point| along_and_across(point, direction);
    let mut faces: BTreeMap<(usize, bool), Vec<End>> = BTreeMap::new();
    for (k, link) in links
        .iter()
        .enumerate()
        .filter(|(_, link)| link.from != link.to)
    {
        let points = &routes[k].points;
        let inner = if points.len() > 2 { 1 } else { 0 };
        let ends = [
            (link.from, link.to, false, points.get(inner)),
            (
                link.to,
                link.from,
                true,
                points
                    .len()
                    .checked_sub(inner + 1)
                    .and_then(|at| points.get(at)),
            ),
        ];
        for (own, other, is_last, next) in ends {
            let next = next
                .copied()
                .filter(|_| inner == 1)
                .unwrap_or(centres[other]);
            let (towards, beyond) = axes(next);
            let after = beyond > axes(centres[own]).1;
            faces.entry((own, after)).or_default().push(End {
                route: k,
                is_last,
                towards,
            });
        }
    }
    for ((own, after), mut ends) in faces {
        ends.sort_by(|a, b| a.towards.total_cmp(&b.towards).then(a.route.cmp(&b.route)));
        let (centre, size) = (axes(centres[own]), axes(boxes[own]));
        let outward = if after { 1.0 } else { -1.0 };
        let gap = size.0 / (ends.len() as f64 + 1.0);
        for (k, end) in ends.iter().enumerate() {
            let along = centre.0 - 0.5 * size.0 + gap * (k as f64 + 1.0);
            let face = centre.1 + outward * 0.5 * size.1;
            let (port, out) = (axes((along, face)), axes((along, face + outward * STUB)));
            let points = &mut routes[end.route].points;
            if end.is_last {
                points.pop();
                points.extend([out, port]);
            } else {
                points.splice(..1.min(points.len()), [port, out]);
            }
        }
    }
}
