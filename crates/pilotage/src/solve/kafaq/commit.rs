//! Less certain levels, one after the other, each upon the committed ones below it (thesis 4.2.4): their targets are
//! `r + discount V` of the level that the step leads to. A level inherits the regions of that level and has its own only where
//! evidence calls for them.

use super::draft::{Draft, DraftNode};
use super::evidence::Halves;
use super::regions::{Region, Reviser, actions_by_cell};
use super::steady::Steady;
use super::task::Task;
use crate::model::Then;
use crate::random::uniform;
use crate::solve::learn::{Experience, any_action};

/// Fewest visits of a level.
const VISITS: usize = 1_000;

/// Learns the less certain levels of a draft; returns the levels that got regions of their own.
pub(super) fn segment_less_certain_levels(
    task: &Task<'_>,
    experience: &mut Experience,
    steady: &Steady,
    draft: &mut Draft,
) -> Vec<usize> {
    let (memories, cells) = (draft.memory.len(), task.lattice.len());
    // By memory and cell: the value of the level below.
    let mut values: Vec<f64> = (0..memories * cells)
        .map(|row| steady.table.best(row))
        .collect();
    let mut regions: Vec<Vec<Region>> = (0..memories)
        .map(|memory| {
            let nodes = draft
                .nodes
                .iter()
                .filter(|node| node.memory == draft.alias[memory]);
            nodes
                .map(|node| Region {
                    cells: node.cells.clone(),
                    action: node.action,
                })
                .collect()
        })
        .collect();
    let mut own = Vec::new();
    for level in (0..task.later()).rev() {
        let evidence = explore_level(task, experience, draft, level, &values);
        for memory in 0..memories {
            let (evidence, regions) = (&evidence[memory], &mut regions[memory]);
            let values = &mut values[memory * cells..(memory + 1) * cells];
            if regions.is_empty() || evidence.all.total() == 0.0 {
                continue;
            }
            let reviser = Reviser::new(
                &task.lattice,
                &task.settings,
                task.settings.worth * size(values, evidence),
            );
            if draft.alias[memory] == memory && reviser.refine(evidence, regions) {
                own.push(level);
                draft.nodes.extend(
                    regions
                        .iter()
                        .map(|region| node(task, level, memory, region, values)),
                );
            }
            let actions = actions_by_cell(&task.lattice, regions);
            for (cell, value) in values.iter_mut().enumerate() {
                *value = evidence.all.mean(cell, actions[cell]).unwrap_or(*value);
            }
        }
    }
    own.dedup();
    own
}

fn node(
    task: &Task<'_>,
    level: usize,
    memory: usize,
    region: &Region,
    values: &[f64],
) -> DraftNode {
    let sum: f64 = task
        .lattice
        .cells(&region.cells)
        .map(|cell| values[cell])
        .sum();
    DraftNode {
        level,
        memory,
        cells: region.cells.clone(),
        action: region.action,
        value: sum / region.cells.volume() as f64,
    }
}

/// Mean size of the values of visited cells.
fn size(values: &[f64], evidence: &Halves) -> f64 {
    let visited: Vec<f64> = (0..values.len())
        .filter(|&cell| evidence.all.visits(cell) > 0.0)
        .map(|cell| values[cell].abs())
        .collect();
    visited.iter().sum::<f64>() / visited.len().max(1) as f64
}

/// Evidence for one level: uniform actions from the start until the level is passed, again and again.
fn explore_level(
    task: &Task<'_>,
    experience: &mut Experience,
    draft: &Draft,
    level: usize,
    values: &[f64],
) -> Vec<Halves> {
    let (cells, actions) = (task.lattice.len(), task.actions());
    let mut evidence = vec![Halves::new(cells, actions); draft.memory.len()];
    let mut actor = task.actor();
    for _ in 0..(task.settings.epoch_per_cell * cells * actions).max(VISITS) {
        let (mut draws, mut exploration) = experience.next_episode(task.settings.seed);
        actor.reset(&mut draws);
        let mut memory = 0;
        for passed in 0..=level {
            let action = any_action(actions, &mut exploration);
            let cell = task.cell(&actor.belief().mean);
            let step = actor.step(action, &mut draws);
            experience.collect(step.reward);
            let next = draft
                .memory
                .next(memory, action, step.reward, &actor.belief().mean);
            if passed == level {
                let future = match step.then {
                    Then::Continue => values[next * cells + task.cell(&actor.belief().mean)],
                    Then::Restart | Then::End => 0.0,
                };
                let target = step.reward + task.discount() * future;
                let coin = uniform(&mut exploration) < 0.5;
                evidence[memory].add(coin, cell, action, target);
            }
            if step.then != Then::Continue {
                break;
            }
            memory = next;
        }
    }
    evidence
}
