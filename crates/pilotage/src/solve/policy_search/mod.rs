//! Policy search: the planes at which an automaton switches between actions are moved to where it does best.
//!
//! Which action to take is a choice between controls, and a linear command in the mean of the belief says which control is wanted: the
//! action whose control is nearest to it is taken, so that actions switch along planes through the space of means. A plane needs a node
//! on either side, however many variables there are, and the agent may be less uncertain later than at the start, so that each of at
//! most three groups of levels has a command of its own. There is no grid.
//!
//! The search begins with the linear-quadratic regulator (`regulator`) and moves all numbers of its commands by CMA-ES (`cma`), to
//! where simulations go best:
//!
//! - for the *return* (`returns`), the discounted return of episodes where the model holds;
//! - for *survival* (`survival`), the probability of leaving the failure limits ([`failure`]), which is told by beliefs long before
//!   anything fails. Rewards are then not looked at.
//!
//! What is found is the best of such automata, as far as the search has come; another shape of policy may earn more.

mod cma;
pub mod failure;
mod refine;
mod regulator;
mod returns;
mod search;
mod settings;
mod survival;

pub use settings::{Objective, PolicySearch};

use super::refusals;
use super::settings::Settings;
use super::solver::{Plan, Planner, Problem, refuse_if};
use crate::belief::BeliefMdp;
use crate::error::Result;
use crate::model::Model;
use crate::policy::Automaton;
use crate::progress::Progress;
use crate::solve::compile::annotate;
use search::Search;
use settings::SOLVER;

/// Episodes run to describe the nodes.
const ANNOTATED: usize = 50;

impl Planner for PolicySearch {
    fn name(&self) -> &'static str {
        SOLVER
    }

    fn accepts(&self, model: &Model) -> Result<()> {
        let mdp = BeliefMdp::new(model);
        let reason = refusals::steps_differ(model)
            .or_else(|| refusals::drifts(model))
            .or_else(|| refusal(&mdp, self.aim(model)));
        refuse_if(SOLVER, model, reason)
    }

    fn plan(&self, problem: &Problem, observer: &dyn Progress) -> Result<Plan> {
        let automaton = search(problem.mdp(), self, problem.seed(), observer)?;
        let mut plan = Plan::automaton(automaton);
        if self.aim(problem.model()) == Objective::Survival {
            plan.remarks.push(
                "the plan is to stay within the failure limits for as long as can be; what is paid was not looked at (objective)"
                    .to_owned(),
            );
        }
        Ok(plan)
    }
}

/// Searches for the planes of a decision process.
///
/// # Errors
/// [`crate::Error::Unsupported`] for a model that the planner does not accept, [`crate::Error::Setting`] for settings out of range,
/// [`crate::Error::NoSteadyState`] where no control keeps the state where it is to be.
pub fn search(
    mdp: &BeliefMdp,
    settings: &PolicySearch,
    seed: u64,
    observer: &dyn Progress,
) -> Result<Automaton> {
    settings.validate()?;
    let aim = settings.aim(mdp.model());
    refuse_if(SOLVER, mdp.model(), refusal(mdp, aim))?;
    let (mut search, mut numbers) = Search::new(mdp, (settings, seed), aim, observer)?;
    let value = match aim {
        Objective::Return => returns::improve(&mut search, &mut numbers),
        Objective::Survival => {
            survival::improve(&mut search, &mut numbers);
            None
        }
    };
    let mut automaton = search.automaton(&numbers);
    automaton.planned_value = value;
    annotate(&mut automaton, mdp, ANNOTATED, seed);
    Ok(automaton)
}

/// Why a model cannot be planned for, and what would do.
fn refusal(mdp: &BeliefMdp, aim: Objective) -> Option<String> {
    let model = mdp.model();
    let sides = &model.episode.alive.sides;
    let outside = sides
        .iter()
        .find(|(_, side)| !(side.low < 0.0 && 0.0 < side.high));
    let controls = || model.actions.iter().enumerate();
    let alike = controls().find_map(|(id, action)| {
        let mut before = model.actions[..id].iter();
        let twin = before.find(|other| other.control == action.control)?;
        Some((twin, action))
    });
    match (aim, outside) {
        (Objective::Survival, _) if sides.is_empty() => {
            return Some("it has no failure limits to stay within; add `alive` to [episode], or a [[reward]] to earn".to_owned());
        }
        (Objective::Survival, Some((i, side))) => {
            return Some(format!(
                "0 is not within the failure limits [{}, {}] of `{}`, and who is to survive is steered there; measure the variable from a point within its limits",
                side.low, side.high, model.state[*i].name
            ));
        }
        _ => {}
    }
    if model.modes.len() > 1 || !mdp.is_gaussian() {
        Some("its planes know nothing of modes, walls or hypotheses; state the problem without them, or use value-iteration".to_owned())
    } else if mdp.classes() > 1 {
        Some("its actions differ in their noise, so that its levels are no chain; give all actions the same noise, or use value-iteration".to_owned())
    } else if let Some((one, other)) = alike {
        Some(format!(
            "`{}` and `{}` have the same control, and planes tell actions apart by their controls; use value-iteration",
            one.name, other.name
        ))
    } else {
        None
    }
}
