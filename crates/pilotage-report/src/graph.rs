//! A policy graph: what is done, and where every signal leads.

use std::collections::BTreeSet;

use super::automaton::{Arrow, Card, Diagram, LEAST_WIDTH, named};
use super::palette::Paint;
use super::plot::percent;
use super::sheet::{Sheet, Sign};
use pilotage::error::{Error, Result};
use pilotage::policy::{NodeId, PolicyGraph};

/// Most cards that a drawing holds.
const MOST_CARDS: usize = 40;

/// Draws a policy graph: a card for every node, and an arrow for every node that a node leads to, with the signals after which it does.
/// Nodes that follow each other whatever is sensed, with the same action, share a card. Ways that are never gone where the model holds are
/// left out. Of more than forty cards the most visited are drawn.
///
/// # Errors
/// [`Error::Policy`] if a node leads to one that is not there, or a share is not a number.
pub fn graph_svg(graph: &PolicyGraph) -> Result<String> {
    check(graph)?;
    let folded = Folded::of(graph);
    let cards = folded.runs.iter().map(|run| card(graph, run)).collect();
    let diagram = Diagram::new(cards, folded.arrows(graph), true);
    let mut sheet = Sheet::new(
        &format!("Policy graph of {}", graph.problem),
        &subtitle(graph),
        &description(graph),
        diagram.size().0.max(LEAST_WIDTH),
    );
    diagram.put_on(&mut sheet);
    sheet.legend(&legend(graph));
    notes(&mut sheet, graph, &folded);
    Ok(sheet.finish())
}

fn check(graph: &PolicyGraph) -> Result<()> {
    let nodes = graph.nodes.len();
    let sound = graph.nodes.iter().map(|node| {
        let shares = node.gone.iter().chain([&node.visits]);
        node.next.iter().all(|next| *next < nodes) && { shares }.all(|share| share.is_finite())
    });
    let reason = match sound.enumerate().find(|(_, sound)| !sound) {
        Some((id, _)) => format!(
            "node {id} leads to a node that is not there, or has a share that is not a number"
        ),
        None if nodes == 0 => "there are no nodes".to_owned(),
        None => return Ok(()),
    };
    Err(Error::Policy {
        origin: graph.problem.clone(),
        reason,
    })
}

/// A way to another node that is gone now and then: where to, and after which signals.
struct Way {
    to: NodeId,
    after: Vec<usize>,
    gone: f64,
}

/// The ways of a node that are gone; all of them where it is not known which are.
fn ways(graph: &PolicyGraph, node: NodeId) -> Vec<Way> {
    let known = graph.nodes.iter().any(|node| node.visits > 0.0);
    let is_gone = |signal: &usize| {
        let gone = graph.nodes[node].gone.get(*signal);
        !known || gone.is_some_and(|gone| *gone > 0.0)
    };
    let exits = graph.exits(node).into_iter().map(|exit| Way {
        to: exit.to,
        after: exit.after.into_iter().filter(is_gone).collect(),
        gone: exit.gone,
    });
    exits.filter(|way| !way.after.is_empty()).collect()
}

/// Nodes that share a card, in the order in which they follow each other.
type Run = Vec<NodeId>;

/// The graph with runs of nodes in place of nodes, those that are drawn.
struct Folded {
    runs: Vec<Run>,
    /// Share of all steps that is spent in nodes left out.
    left_out: f64,
}

impl Folded {
    fn of(graph: &PolicyGraph) -> Self {
        let nodes = graph.nodes.len();
        let mut entered = vec![0; nodes];
        for way in (0..nodes).flat_map(|node| ways(graph, node)) {
            entered[way.to] += 1;
        }
        // The node that carries on what one does, whatever is sensed.
        let onwards = |node: NodeId| match ways(graph, node).as_slice() {
            [way] if way.to != 0 && way.to != node && entered[way.to] == 1 => {
                let same = graph.nodes[way.to].action == graph.nodes[node].action;
                same.then_some(way.to)
            }
            _ => None,
        };
        let carried_on: BTreeSet<NodeId> = (0..nodes).filter_map(onwards).collect();
        let firsts = (0..nodes).filter(|node| !carried_on.contains(node));
        let run = |first| std::iter::successors(Some(first), |node| onwards(*node)).collect();
        let mut runs: Vec<Run> = firsts.map(run).collect();
        let visits = |run: &Run| {
            run.iter()
                .map(|node| graph.nodes[*node].visits)
                .sum::<f64>()
        };
        runs.sort_by(|a, b| {
            let first = (b[0] == 0).cmp(&(a[0] == 0));
            first
                .then(visits(b).total_cmp(&visits(a)))
                .then(a[0].cmp(&b[0]))
        });
        let rest = runs.split_off(runs.len().min(MOST_CARDS));
        Self {
            runs,
            left_out: rest.iter().map(visits).sum(),
        }
    }

    /// Number of nodes that are drawn.
    fn nodes(&self) -> usize {
        self.runs.iter().map(Vec::len).sum()
    }

    fn arrows(&self, graph: &PolicyGraph) -> Vec<Arrow> {
        let place = |node: NodeId| self.runs.iter().position(|run| run[0] == node);
        let mut arrows = Vec::new();
        for (from, run) in self.runs.iter().enumerate() {
            let Some(last) = run.last() else { continue };
            let ways = ways(graph, *last);
            let all: f64 = ways.iter().map(|way| way.gone).sum();
            let always = ways.len() == 1;
            for way in ways {
                let share = if all > 0.0 { way.gone / all } else { 0.0 };
                let names = way.after.iter().map(|signal| graph.signal_name(*signal));
                arrows.extend(place(way.to).map(|to| Arrow {
                    from,
                    to,
                    width: 1.0 + 2.5 * share,
                    both: false,
                    label: (!always).then(|| names.collect::<Vec<_>>().join(", ")),
                }));
            }
        }
        arrows
    }
}

fn card(graph: &PolicyGraph, run: &Run) -> Card {
    let action = graph.nodes[run[0]].action;
    let name = named(&graph.actions, action, "action");
    let known = graph.nodes.iter().any(|node| node.visits > 0.0);
    let visits: f64 = run.iter().map(|node| graph.nodes[*node].visits).sum();
    let name = match run.len() {
        1 => format!("{} {name}", run[0]),
        times => format!("{} {name} × {times}", run[0]),
    };
    Card::new(action, name, known.then_some(visits), Vec::new())
}

fn subtitle(graph: &PolicyGraph) -> String {
    let nodes = graph.nodes.len();
    let plural = if nodes == 1 { "" } else { "s" };
    format!("{nodes} node{plural}, made by {}", graph.solver)
}

fn description(graph: &PolicyGraph) -> String {
    let first = named(&graph.actions, graph.nodes[0].action, "action");
    format!("Policy graph, {}. It begins with {first}.", subtitle(graph))
}

fn legend(graph: &PolicyGraph) -> Vec<(Sign, String)> {
    let action = |(action, name): (usize, &String)| {
        let chosen = graph.nodes.iter().any(|node| node.action == action);
        match chosen {
            true => (Sign::Area(Paint::Hue(action)), name.clone()),
            false => (
                Sign::Frame(Paint::LineHue(action)),
                format!("{name} (never chosen)"),
            ),
        }
    };
    let actions = graph.actions.iter().enumerate().map(action);
    let start = (Sign::Disc(Paint::Ink), "start".to_owned());
    actions.chain([start]).collect()
}

fn notes(sheet: &mut Sheet, graph: &PolicyGraph, folded: &Folded) {
    sheet.draw([], 14.0);
    let left_out = graph.nodes.len() - folded.nodes();
    if left_out > 0 {
        sheet.note(&format!(
            "The {} most visited nodes; of {left_out} more, in which {} of all steps are spent, nothing is drawn.",
            folded.nodes(),
            percent(folded.left_out)
        ));
    }
    sheet.note("On every arrow what was sensed where it is gone; without a word it is gone whatever was sensed, and the wider, the more often. Top right: share of all steps of an episode. From a card without an arrow the episode ends or begins again.");
    if folded.runs.iter().any(|run| run.len() > 1) {
        sheet.note("× 3: three nodes in a row that do the same whatever is sensed, the first of which has that number.");
    }
}
