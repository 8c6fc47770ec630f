//! The automaton as a graph (Figures 5.9, 5.12 and 5.14).

mod card;
mod choice;
mod diagram;

pub(super) use card::{Card, named};
use choice::Choice;
pub(super) use diagram::{Arrow, Diagram, LEAST_WIDTH};

use super::is_sound;
use super::palette::Paint;
use super::plot::percent;
use super::sheet::{Sheet, Sign};
use pilotage::error::{Error, Result};
use pilotage::policy::{Automaton, Matching};

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
    let labelled = choice.labelled;
    let arrows = choice.arrows.iter().map(|arrow| drawn(arrow, labelled));
    let diagram = Diagram::new(cards, arrows.collect(), choice.start.is_some());
    let mut sheet = Sheet::new(
        &format!("Automaton of {}", automaton.problem),
        &subtitle(automaton),
        &description(automaton, annotated),
        diagram.size().0.max(LEAST_WIDTH),
    );
    diagram.put_on(&mut sheet);
    sheet.legend(&legend(automaton, choice.start.is_some()));
    notes(&mut sheet, automaton, &choice, annotated, labelled);
    Ok(sheet.finish())
}

fn drawn(arrow: &choice::Arrow, labelled: bool) -> Arrow {
    Arrow {
        from: arrow.from,
        to: arrow.to,
        width: 1.0 + 2.5 * arrow.share,
        both: arrow.both,
        label: labelled.then(|| percent(arrow.share)),
    }
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
