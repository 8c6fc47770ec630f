//! The bang-bang controller of the cart and pole, its weights tuned in good faith: what a planner of its automata is measured against.

use pilotage::belief::BeliefMdp;
use pilotage::error::{Error, Result};
use pilotage::model::Model;
use pilotage::policy::AutomatonRunner;
use pilotage::solve::lqg::{NearestAction, Weights};
use pilotage::solve::policy_search::failure::{Runs, Sample};

/// Weights of position, angle and force.
pub type PoleWeights = [f64; 3];

/// Variance of the angle, in rad^2, below which failures are too rare for a sample.
const QUIET: f64 = 5e-4;

/// Full force in the direction of the linear-quadratic-Gaussian controller's command, undiscounted.
fn bang_bang(mdp: &BeliefMdp, [position, angle, control]: PoleWeights) -> Result<AutomatonRunner> {
    let weights = Weights {
        state: Some(vec![position, 0.0, angle, 0.0]),
        control: Some(vec![control]),
    };
    let undiscounted = Model {
        discount: 1.0,
        ..mdp.model().clone()
    };
    let automaton = NearestAction::new(&undiscounted, &weights)?.automaton(mdp);
    let automaton = automaton.ok_or_else(|| Error::Unsupported {
        solver: "lqg",
        model: mdp.model().name.clone(),
        reason: "a push to either side is needed, two actions; use a model of the cart and pole"
            .to_owned(),
    })?;
    Ok(AutomatonRunner::new(&automaton))
}

/// The controller of a cart and pole (state `x, x', theta, theta'`, two actions) under which the agent's own model expects the
/// longest life once it knows where it is: the best of a coarse comparison of all weights, and of a finer one of the eight that did
/// best. `effort`, above 0, is a factor on the simulations; 1 is thorough.
///
/// # Errors
/// [`Error::Unsupported`] for a model that is no cart and pole, and as [`NearestAction::new`].
pub fn tuned(mdp: &BeliefMdp, effort: f64) -> Result<(AutomatonRunner, PoleWeights)> {
    if mdp.model().state_dim() != 4 {
        return Err(Error::Unsupported {
            solver: "lqg",
            model: mdp.model().name.clone(),
            reason: "these weights are of position, speed, angle and its speed; use a model of the cart and pole".to_owned(),
        });
    }
    // Of failures as rare as with little noise no sample tells; with closer limits there are enough.
    let last = mdp.strata() - 1;
    let steady = mdp.covariance(last);
    let limits = if steady[(2, 2)] < QUIET { 0.75 } else { 1.0 };
    let runs = Runs::steady(mdp, last, &[0.0; 4]).with_limits(limits);
    let failure = |policy: &AutomatonRunner, count: f64| {
        let sample = Sample {
            runs: (count * effort).ceil() as usize,
            steps: 10_000,
            seed: 7,
        };
        runs.failure(policy, sample)
    };
    let mut tried = Vec::new();
    for position in [1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 1e-1, 1.0] {
        for control in [1e-6, 1e-5, 1e-4, 1e-3, 1e-2] {
            let weights = [position, 1.0, control];
            let policy = bang_bang(mdp, weights)?;
            tried.push((failure(&policy, 50.0), policy, weights));
        }
    }
    tried.sort_by(|a, b| a.0.total_cmp(&b.0));
    tried.truncate(8);
    for (measured, policy, _) in &mut tried {
        *measured = failure(policy, 400.0);
    }
    tried.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (_, policy, weights) = tried.swap_remove(0);
    Ok((policy, weights))
}
