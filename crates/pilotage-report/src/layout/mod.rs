//! Layered layout of a directed graph (K. Sugiyama, S. Tagawa, M. Toda, 1981), by the `dagre` crate.

mod routes;

use dagre::graph::{Graph, GraphOptions};
use dagre::layout::types::LabelPos;
use dagre::{EdgeLabel, LayoutOptions, NodeLabel, RankDir, Ranker};
use routes::{LOOP_REACH, attach, looped, routed, straight, straighten};

pub type Point = (f64, f64);

/// More boxes than this are a crowd.
const CROWD: usize = 14;

/// An arrow from one box to another, or to itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Link {
    /// Index of the box it leaves.
    pub from: usize,
    /// Index of the box it enters.
    pub to: usize,
    /// Width and height of its label; zeros for none.
    pub label: (f64, f64),
}

/// Which way layers follow each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// From top to bottom.
    Down,
    /// From left to right.
    Right,
}

/// Where everything goes; the upper left corner of the whole is the origin.
#[derive(Debug, Clone, PartialEq)]
pub struct Layout {
    /// Width and height of the whole.
    pub size: (f64, f64),
    /// Centre of each box.
    pub centres: Vec<Point>,
    /// Way of each link.
    pub routes: Vec<Route>,
}

/// The way of a link.
#[derive(Debug, Clone, PartialEq)]
pub struct Route {
    /// Control points of a B-spline whose ends lie on the two boxes.
    pub points: Vec<Point>,
    /// Centre of its label.
    pub label: Point,
}

/// Lays out boxes of the given sizes, in the way that can be drawn largest on paper of the given ratio of width to height.
pub fn largest_on_paper(boxes: &[(f64, f64)], links: &[Link], ratio: f64) -> Layout {
    let paper = |layout: &Layout| (layout.size.0 / ratio).max(layout.size.1);
    let mut best = layered(boxes, links, Direction::Down, Ranker::NetworkSimplex);
    let others = [
        (Direction::Right, Ranker::NetworkSimplex),
        (Direction::Down, Ranker::LongestPath),
        (Direction::Right, Ranker::LongestPath),
    ];
    for (direction, ranker) in others {
        let layout = layered(boxes, links, direction, ranker);
        // Network simplex has the shorter arrows: the other has to be clearly smaller.
        let handicap = if ranker == Ranker::LongestPath {
            1.3
        } else {
            1.0
        };
        if paper(&layout) * handicap < paper(&best) {
            best = layout;
        }
    }
    best
}

/// Lays out boxes of the given sizes.
fn layered(boxes: &[(f64, f64)], links: &[Link], direction: Direction, ranker: Ranker) -> Layout {
    let mut graph = graph(boxes, links, direction);
    // Crowds stand closer.
    let (nodesep, edgesep, ranksep) = if boxes.len() > CROWD {
        (18.0, 8.0, 64.0)
    } else {
        (30.0, 14.0, 60.0)
    };
    let options = LayoutOptions {
        rankdir: match direction {
            Direction::Down => RankDir::TB,
            Direction::Right => RankDir::LR,
        },
        nodesep,
        edgesep,
        ranksep,
        ranker,
        ..LayoutOptions::default()
    };
    dagre::layout(&mut graph, Some(options));
    let centres: Vec<Point> = (0..boxes.len())
        .map(|k| {
            let placed = graph.node(&k.to_string());
            placed.map_or((0.0, 0.0), |node| {
                (node.x.unwrap_or(0.0), node.y.unwrap_or(0.0))
            })
        })
        .collect();
    let mut routes: Vec<Route> = links
        .iter()
        .enumerate()
        .map(|(k, link)| {
            if link.from == link.to {
                return looped(centres[link.from], boxes[link.from], link.label, direction);
            }
            let name = k.to_string();
            let edge = graph.edge(&link.from.to_string(), &link.to.to_string(), Some(&name));
            edge.map_or_else(|| straight(centres[link.from], centres[link.to]), routed)
        })
        .collect();
    straighten(&mut routes, links, boxes, &centres, direction);
    attach(&mut routes, links, boxes, &centres, direction);
    shifted(boxes, links, centres, routes)
}

fn graph(
    boxes: &[(f64, f64)],
    links: &[Link],
    direction: Direction,
) -> Graph<NodeLabel, EdgeLabel> {
    let mut graph = Graph::with_options(GraphOptions {
        directed: true,
        multigraph: true,
        compound: false,
    });
    for (k, &(width, height)) in boxes.iter().enumerate() {
        let node = NodeLabel {
            width,
            height,
            ..NodeLabel::default()
        };
        graph.set_node(k.to_string(), Some(node));
    }
    for (k, link) in links.iter().enumerate() {
        let (width, height) = if link.from == link.to {
            match direction {
                Direction::Down => (LOOP_REACH + link.label.0, link.label.1),
                Direction::Right => (link.label.0, LOOP_REACH.max(link.label.1)),
            }
        } else {
            link.label
        };
        let edge = EdgeLabel {
            width,
            height,
            labelpos: LabelPos::Center,
            ..EdgeLabel::default()
        };
        graph.set_edge(
            link.from.to_string(),
            link.to.to_string(),
            Some(edge),
            Some(&k.to_string()),
        );
    }
    graph
}

/// Moves everything so that it begins at the origin.
fn shifted(
    boxes: &[(f64, f64)],
    links: &[Link],
    mut centres: Vec<Point>,
    mut routes: Vec<Route>,
) -> Layout {
    let (mut low, mut high) = ((0.0_f64, 0.0_f64), (1.0_f64, 1.0_f64));
    let around = |(x, y): Point, (w, h): (f64, f64)| {
        [(x - 0.5 * w, y - 0.5 * h), (x + 0.5 * w, y + 0.5 * h)]
    };
    let corners = centres
        .iter()
        .zip(boxes)
        .flat_map(|(&centre, &size)| around(centre, size));
    let labels = routes
        .iter()
        .zip(links)
        .flat_map(|(route, link)| around(route.label, link.label));
    let ways = routes.iter().flat_map(|route| route.points.iter().copied());
    for (k, (x, y)) in corners.chain(labels).chain(ways).enumerate() {
        if k == 0 {
            (low, high) = ((x, y), (x, y));
        }
        low = (low.0.min(x), low.1.min(y));
        high = (high.0.max(x), high.1.max(y));
    }
    let moved = |point: &mut Point| *point = (point.0 - low.0, point.1 - low.1);
    centres.iter_mut().for_each(moved);
    for route in &mut routes {
        moved(&mut route.label);
        route.points.iter_mut().for_each(moved);
    }
    Layout {
        size: (high.0 - low.0, high.1 - low.1),
        centres,
        routes,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn graphs() -> impl Strategy<Value = (Vec<(f64, f64)>, Vec<Link>)> {
        (1..25_usize).prop_flat_map(|count| {
            let link = (0..count, 0..count, any::<bool>()).prop_map(|(from, to, labelled)| Link {
                from,
                to,
                label: if labelled { (30.0, 14.0) } else { (0.0, 0.0) },
            });
            (
                Just(vec![(120.0, 60.0); count]),
                proptest::collection::vec(link, 0..60),
            )
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn boxes_are_apart_and_the_same_graph_is_laid_out_the_same((boxes, links) in graphs()) {
            for direction in [Direction::Down, Direction::Right] {
                let layout = layered(&boxes, &links, direction, Ranker::NetworkSimplex);
                for (k, a) in layout.centres.iter().enumerate() {
                    for b in &layout.centres[..k] {
                        prop_assert!((a.0 - b.0).abs() > 119.9 || (a.1 - b.1).abs() > 59.9);
                    }
                }
                let again = layered(&boxes, &links, direction, Ranker::NetworkSimplex);
                prop_assert_eq!(layout, again);
            }
        }
    }
}
