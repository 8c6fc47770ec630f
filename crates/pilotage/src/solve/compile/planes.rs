//! From a linear command to nodes: a switching plane needs one node on either side, not hundreds.
//!
//! The policy that takes the action whose control is closest to a command `u = c - K m` is the nearest-neighbour rule on one node an
//! action: the mean nearest the origin at which the command is just that action's control. (In coordinates `y` in which distances
//! are measured, `|y - y_a|^2` and `|c - K y - u_a|^2` differ between actions by the same amount up to a factor. With several controls
//! that takes rows of `K` of the same length at right angles; otherwise it is a starting point.)

use nalgebra::{DMatrix, DVector};

use crate::belief::{BeliefMdp, StratumId};
use crate::policy::{Automaton, Matching, Node, Place};

/// Levels from the first to the last of which the agent does the same at the same mean.
pub(crate) type Group = (StratumId, StratumId);

/// A command `u = c - K m`.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Command {
    /// `K`, `p x n`.
    pub gain: DMatrix<f64>,
    /// `c`, length `p`.
    pub offset: DVector<f64>,
}

/// The automaton of a command per group of levels, in units in which each state variable is divided by its `scale` (length `n`, above
/// 0).
pub(crate) fn automaton(
    mdp: &BeliefMdp,
    solver: &str,
    groups: &[Group],
    commands: &[Command],
    scale: &[f64],
) -> Automaton {
    let mut automaton = Automaton::new(mdp, solver, Matching::Nearest);
    automaton.scale = scale.to_vec();
    let scale = DVector::from_column_slice(scale);
    for (&(first, last), Command { gain, offset }) in groups.iter().zip(commands) {
        let least = gain
            .clone()
            .pseudo_inverse(1e-12 * gain.amax())
            .unwrap_or_else(|_| gain.transpose() * 0.0);
        for (id, action) in mdp.model().actions.iter().enumerate() {
            let point = (-&least * (&action.control - offset)).component_mul(&scale);
            automaton.nodes.push(Node::new(
                first..=last,
                mdp.start().mode,
                Place::Point(point.as_slice().to_vec()),
                id,
                None,
            ));
        }
    }
    automaton
}
