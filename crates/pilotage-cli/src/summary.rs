//! Results as text for people.

use std::fmt::Write as _;

use comfy_table::presets;
use comfy_table::{CellAlignment, Table};
use pilotage::policy::{Automaton, Place, PolicyGraph};
use pilotage::simulate::{Estimate, Evaluation};
use pilotage::solve::Earned;
use pilotage::solve::bound::Bound;

/// Rows of a node table that are shown before it is cut.
const ROWS: usize = 24;

/// What was solved, with what, and how large the automaton is where there is one.
pub fn heading(problem: &str, solver: &str, nodes: Option<usize>) -> String {
    let size = match nodes {
        None => "the planner itself, not compiled".to_owned(),
        Some(1) => "1 node".to_owned(),
        Some(nodes) => format!("{nodes} nodes"),
    };
    format!("{problem}, solved with {solver}: {size}\n")
}

pub fn estimate(estimate: &Estimate) -> String {
    format!("{:.4} ± {:.4}", estimate.mean, estimate.stderr)
}

/// What a saved policy earns, with what was planned when it was made.
pub fn evaluation(evaluation: &Evaluation, planned: Option<f64>) -> String {
    let mut text = planned_line(planned);
    let _ = writeln!(
        text,
        "  discounted return    {}",
        estimate(&evaluation.discounted)
    );
    text + &rest(evaluation)
}

/// What a solution earns: as planned, where its model holds, and in the world; one line where the last two are the same thing.
pub fn earned(earned: &Earned, planned: Option<f64>, as_assumed: bool) -> String {
    let rule = earned.rule.as_ref().map_or(String::new(), |rule| {
        let (own, less) = (estimate(&rule.earned.discounted), estimate(&rule.less));
        format!(
            "  rule of thumb        {own}, the one in the model file\n  less than the above  {less} over the same episodes\n"
        )
    });
    if as_assumed {
        return evaluation(&earned.world, planned) + &rule;
    }
    let mut text = planned_line(planned);
    let _ = writeln!(
        text,
        "  discounted return    {} where the model holds",
        estimate(&earned.assumed.discounted)
    );
    let _ = writeln!(
        text,
        "                       {} in the world",
        estimate(&earned.world.discounted)
    );
    text + &rest(&earned.world) + &rule
}

/// The most that any policy can earn, and how far what is earned where the model holds lies below it.
pub fn bound(bound: &Bound, earned: f64) -> String {
    let gap = bound.gap(earned).map_or(String::new(), |gap| {
        format!(", gap {:.1} %", 100.0 * gap.max(0.0))
    });
    format!(
        "  at most              {:.4}{gap}\n                       {}",
        bound.mean,
        bound.method.describe()
    )
}

fn planned_line(planned: Option<f64>) -> String {
    planned.map_or(String::new(), |value| {
        format!("  planned              {value:.4}\n")
    })
}

fn rest(evaluation: &Evaluation) -> String {
    let mut text = String::new();
    let _ = writeln!(
        text,
        "  undiscounted return  {}",
        estimate(&evaluation.undiscounted)
    );
    let _ = writeln!(
        text,
        "  steps per episode    {}",
        estimate(&evaluation.steps)
    );
    if evaluation.failed > 0.0 {
        let _ = writeln!(
            text,
            "  episodes that failed {:.2} %",
            100.0 * evaluation.failed
        );
    }
    let _ = writeln!(
        text,
        "  mean ± standard error over {} episodes",
        evaluation.episodes
    );
    text
}

/// The automaton as a table: where a node is, what it does, what it is worth, where it comes from.
pub fn nodes(automaton: &Automaton) -> String {
    let mut table = Table::new();
    table.load_style(presets::NOTHING);
    let modes = automaton.modes.len() > 1;
    let mut header = vec!["node", "level"];
    if modes {
        header.push("mode");
    }
    let place = automaton.place_names().join(", ");
    header.extend([place.as_str(), "action", "value", "time", "reached from"]);
    table.set_header(header);
    for (id, node) in automaton.nodes.iter().enumerate().take(ROWS) {
        let mut row = vec![id.to_string(), levels(node.levels)];
        if modes {
            row.push(automaton.modes[node.mode].clone());
        }
        let from: Vec<String> = node
            .predecessors
            .iter()
            .take(4)
            .map(|(from, _)| from.to_string())
            .collect();
        row.extend([
            shown(&node.place),
            automaton.actions[node.action].clone(),
            node.value
                .map_or_else(String::new, |value| format!("{value:.3}")),
            format!("{:.1} %", 100.0 * node.visits),
            from.join(" "),
        ]);
        table.add_row(row);
    }
    for column in [0, 1] {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    let rest = automaton.nodes.len().saturating_sub(ROWS);
    let more = if rest > 0 {
        format!("\n  and {rest} more; --out FILE keeps them all")
    } else {
        String::new()
    };
    // A tree that fills more than a screen is read in its file.
    let tree = match automaton.nodes.len() <= ROWS {
        true => automaton.conditions(),
        false => String::new(),
    };
    let tree = match tree.is_empty() {
        true => tree,
        false => format!("\n\n{tree}"),
    };
    format!("{}{more}{tree}", table.trim_fmt())
}

/// A policy graph in words; of a large one the first nodes.
pub fn graph(graph: &PolicyGraph) -> String {
    let words = graph.in_words();
    let lines: Vec<String> = words
        .lines()
        .take(ROWS)
        .map(|line| format!("  {line}"))
        .collect();
    let rest = graph.nodes.len().saturating_sub(ROWS);
    let more = match rest {
        0 => String::new(),
        rest => format!("\n  and {rest} more; --out FILE keeps them all"),
    };
    lines.join("\n") + &more
}

fn levels((first, last): (usize, usize)) -> String {
    if first == last {
        first.to_string()
    } else {
        format!("{first}-{last}")
    }
}

fn shown(place: &Place) -> String {
    let list = |values: &[f64]| {
        values
            .iter()
            .map(|value| format!("{value:.2}"))
            .collect::<Vec<_>>()
            .join(", ")
    };
    match place {
        Place::Point(point) => list(point),
        Place::Segment { lower, upper, .. } => lower
            .iter()
            .zip(upper)
            .map(|(low, high)| format!("[{low:.2}, {high:.2}]"))
            .collect::<Vec<_>>()
            .join(" x "),
    }
}
