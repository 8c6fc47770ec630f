//! Placing nodes among sampled beliefs, in any number of dimensions.

use super::Band;
use crate::belief::Belief;
use crate::policy::{Automaton, Controller, Matching, Policy};

/// Adds the nodes of a band: every belief met is learned by the automaton's own rule, over and over until nothing changes; then
/// nodes that can go without more than the slack of wrong decisions are dropped, the least needed first.
pub fn place(automaton: &mut Automaton, policy: &dyn Policy, band: &Band, slack: f64) {
    const PASSES: usize = 8;
    let mut fresh = Automaton {
        nodes: Vec::new(),
        ..automaton.clone()
    };
    for _ in 0..PASSES {
        let before = fresh.nodes.len();
        for (mean, action) in &band.decisions {
            let belief = Belief {
                level: band.levels.1,
                mode: band.mode,
                mean: mean.clone(),
            };
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

fn policy_of(automaton: &Automaton, belief: &Belief) -> Option<usize> {
    automaton
        .matched(belief)
        .map(|id| automaton.nodes[id].action)
}

fn drop_needless(automaton: &mut Automaton, band: &Band, slack: f64) {
    const CHECKED: usize = 4000;
    let stride = band.decisions.len().div_ceil(CHECKED);
    let checked: Vec<_> = band.decisions.iter().step_by(stride).collect();
    let allowed = (slack * checked.len() as f64) as usize;
    // Most nodes are needed, which the first few wrong decisions show.
    let suffices = |automaton: &Automaton| {
        let controller = Controller::new(automaton);
        let mut belief = Belief {
            level: band.levels.1,
            mode: band.mode,
            mean: Vec::new(),
        };
        let mut wrong = checked.iter().filter(|(mean, action)| {
            belief.mean.clone_from(mean);
            controller.action(&belief) != *action
        });
        wrong.nth(allowed).is_none()
    };
    let mut id = 0;
    while id < automaton.nodes.len() && automaton.nodes.len() > 1 {
        let node = automaton.nodes.remove(id);
        if !suffices(automaton) {
            automaton.nodes.insert(id, node);
            id += 1;
        }
    }
}
