//! Placing nodes among sampled beliefs, in any number of dimensions.

use super::Band;
use crate::belief::Belief;
use crate::model::ActionId;
use crate::policy::{Automaton, Matching, NodeId, Policy};

/// Adds the nodes of a band: every belief met is learned by the automaton's own rule, over and over until nothing changes; then
/// nodes that can go without more than the slack of wrong decisions are dropped, the least needed first.
pub(super) fn place(automaton: &mut Automaton, policy: &dyn Policy, band: &Band, slack: f64) {
    const PASSES: usize = 8;
    let mut fresh = Automaton {
        nodes: Vec::new(),
        ..automaton.clone()
    };
    for _ in 0..PASSES {
        let before = fresh.nodes.len();
        for (mean, action) in &band.decisions {
            let belief = belief_of(band, mean);
            if policy_of(&fresh, &belief) != Some(*action) {
                fresh.learn(&belief, *action, policy.value(&belief).unwrap_or(0.0));
            }
        }
        if fresh.nodes.len() == before {
            break;
        }
    }
    if fresh.matching == Matching::Segments {
        fresh.merge_segments();
    }
    drop_needless(&mut fresh, band, slack);
    for mut node in fresh.nodes {
        node.levels = band.levels;
        automaton.nodes.push(node);
    }
}

fn belief_of(band: &Band, mean: &[f64]) -> Belief {
    Belief {
        stratum: band.levels.1,
        mode: band.mode,
        mean: mean.to_vec(),
    }
}

fn policy_of(automaton: &Automaton, belief: &Belief) -> Option<usize> {
    automaton
        .matched(belief)
        .map(|id| automaton.nodes[id].action)
}

/// Tries to do without each node in turn. Only the beliefs that were its own are then decided by others.
fn drop_needless(automaton: &mut Automaton, band: &Band, slack: f64) {
    const CHECKED: usize = 4000;
    let stride = band.decisions.len().div_ceil(CHECKED);
    let checked: Vec<(Belief, ActionId)> = band
        .decisions
        .iter()
        .step_by(stride)
        .map(|(mean, action)| (belief_of(band, mean), *action))
        .collect();
    let allowed = (slack * checked.len() as f64) as usize;
    let mut owners: Vec<Option<NodeId>> = checked
        .iter()
        .map(|(belief, _)| automaton.matched(belief))
        .collect();
    let wrong_of = |automaton: &Automaton, decided: &[(usize, Option<NodeId>)]| {
        let action = |owner: Option<NodeId>| owner.map(|id| automaton.nodes[id].action);
        decided
            .iter()
            .filter(|&&(i, owner)| action(owner) != Some(checked[i].1))
            .count()
    };
    let all: Vec<_> = owners.iter().copied().enumerate().collect();
    let mut wrong = wrong_of(automaton, &all);
    let mut id = 0;
    while id < automaton.nodes.len() && automaton.nodes.len() > 1 {
        let own: Vec<_> = owners
            .iter()
            .copied()
            .enumerate()
            .filter(|(_, owner)| *owner == Some(id))
            .collect();
        let others_wrong = wrong - wrong_of(automaton, &own);
        let node = automaton.nodes.remove(id);
        let heirs: Vec<_> = own
            .iter()
            .map(|&(i, _)| (i, automaton.matched(&checked[i].0)))
            .collect();
        let without = others_wrong + wrong_of(automaton, &heirs);
        if without > allowed {
            automaton.nodes.insert(id, node);
            id += 1;
            continue;
        }
        wrong = without;
        for owner in owners.iter_mut().flatten().filter(|owner| **owner > id) {
            *owner -= 1;
        }
        for (i, heir) in heirs {
            owners[i] = heir;
        }
    }
}
