//! Edges by predecessor regions: an automaton that sees no reward changes its memory where the event has probably happened by now.

use super::draft::{Draft, DraftNode, Edge};
use super::steady::Steady;
use super::task::Task;
use crate::solve::learn::{Trial, discounted};

/// Nodes and edges of what was learned, with the trial that chose the edges.
pub(super) fn compile(task: &Task<'_>, steady: &Steady) -> (Draft, Trial, u64) {
    let mut draft = Draft {
        nodes: nodes(task, steady),
        edges: Vec::new(),
        alias: (0..steady.memory.len()).collect(),
        memory: steady.memory.clone(),
    };
    let mut trial = task.trial(&draft.compile(task));
    let mut steps = trial.steps();
    if steady.memory.len() == 1 {
        return (draft, trial, steps);
    }
    let mut best = f64::NEG_INFINITY;
    for &odds in &task.settings.odds {
        let candidate = Draft {
            edges: edges(task, steady, odds),
            ..draft.clone()
        };
        let tried = task.trial(&candidate.compile(task));
        steps += tried.steps();
        if tried.mean(discounted) > best {
            best = tried.mean(discounted);
            (draft, trial) = (candidate, tried);
        }
    }
    (draft, trial, steps)
}

fn nodes(task: &Task<'_>, steady: &Steady) -> Vec<DraftNode> {
    let by_sheet = steady.regions.iter().enumerate();
    let node = |sheet: usize, region: &super::regions::Region| DraftNode {
        level: task.later() + sheet % task.sheets,
        memory: sheet / task.sheets,
        cells: region.cells.clone(),
        action: region.action,
        value: steady.region_value(task, sheet, region),
    };
    by_sheet
        .flat_map(|(sheet, regions)| regions.iter().map(move |region| node(sheet, region)))
        .collect()
}

/// For every way an event was seen to change the memory, the box of means in which it is likeliest to have happened: the one with
/// the largest sum of `events - odds arrivals`.
fn edges(task: &Task<'_>, steady: &Steady, odds: f64) -> Vec<Edge> {
    let crossings = &steady.crossings;
    let edge = |crossing: &super::steady::Crossing| {
        let sums = task.lattice.sums(|cell| {
            crossing.counts[cell]
                - odds * crossings.arrivals(crossing.memory, crossing.action, cell)
        });
        let mut best = (0.0, None);
        for (cells, _) in task.lattice.boxes() {
            let surplus = sums.over(cells);
            if surplus > best.0 * (1.0 + 1e-9) {
                best = (surplus, Some(cells));
            }
        }
        best.1.map(|cells| Edge {
            memory: crossing.memory,
            action: crossing.action,
            cells: cells.clone(),
            to: crossing.to,
        })
    };
    crossings.events.iter().filter_map(edge).collect()
}
