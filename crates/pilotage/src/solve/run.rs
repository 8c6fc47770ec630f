//! One way to run any solver: what it finds is brought into the form asked for here, and nowhere else.

use super::rollout::check_runs;
use super::solver::{
    Found, Learner, Plan, Planner, Problem, Request, Solver, accepted, no_graph, refuse,
};
use super::{Form, Solution, Solved, compile};
use crate::error::Result;
use crate::model::Model;
use crate::policy::{Automaton, AutomatonRunner};
use crate::progress::Progress;
use crate::scenario::Scenario;
use crate::world::{ProblemWorld, World};

/// Solves a scenario: planners are handed its model alone, learners act in its world.
///
/// # Errors
/// As [`plan`] and [`learn`].
pub fn solve(
    solver: &Solver,
    scenario: &Scenario,
    request: &Request,
    observer: &dyn Progress,
) -> Result<Solution> {
    match solver {
        Solver::Planner(planner) => plan(planner.as_ref(), &scenario.model, request, observer),
        Solver::Learner(learner) => learn(learner.as_ref(), scenario, request, observer),
    }
}

/// Plans for a model, and compiles the plan into the form asked for.
///
/// # Errors
/// [`crate::Error::Unsupported`] where the planner does not accept the model, [`crate::Error::NoSteadyState`] where the agent's
/// uncertainty grows without end, and the planner's own.
pub fn plan(
    planner: &dyn Planner,
    model: &Model,
    request: &Request,
    observer: &dyn Progress,
) -> Result<Solution> {
    check_runs("runs", request.runs)?;
    request.size().check(request.form.has_size())?;
    let problem = Problem::new(model, request);
    let levels = planner.needs_levels() && model.is_linear();
    if levels {
        problem.mdp().check()?;
    }
    accepted(planner, model)?;
    if request.form == Form::Graph {
        planner.makes_graph(model)?;
    }
    if levels && planner.makes_automaton(model) {
        problem.mdp().check_bounded()?;
    }
    let Plan {
        policy,
        value,
        converged,
        policy_convergence_horizon,
        remarks,
    } = planner.plan(&problem, observer)?;
    let levels = match &policy {
        Found::Rule { space, .. } => space.strata(),
        Found::Automaton(_) | Found::Control(_) => problem.mdp().strata(),
        Found::Graph(_) => 0,
    };
    let policy = match (policy, request.form) {
        (Found::Graph(graph), Form::Graph) => Solved::Graph(graph),
        (_, Form::Graph) => return Err(no_graph(planner.name(), model)),
        (Found::Graph(_), _) => {
            let reason = "what it finds is a policy graph alone; use the form graph";
            return Err(refuse(planner.name(), model, reason));
        }
        (Found::Control(controller), _) => Solved::Control(controller),
        (Found::Rule { policy, space }, Form::Grid) => Solved::Rule {
            policy,
            updater: space.updater(),
        },
        (Found::Rule { policy, space }, Form::Nearest | Form::Segments | Form::Tree) => {
            let settings = compiler(request);
            let mut automaton =
                compile::compile(policy.as_ref(), space.as_ref(), planner.name(), &settings)?;
            automaton.planned_value = value;
            Solved::Automaton(automaton)
        }
        (Found::Automaton(automaton), Form::Grid) => asked_anew(&automaton),
        (Found::Automaton(automaton), form) if automaton.matching == form.matching() => {
            Solved::Automaton(annotated(automaton, &problem, request))
        }
        (Found::Automaton(automaton), _) => {
            let (policy, settings) = (AutomatonRunner::new(&automaton), compiler(request));
            let compiled = compile::compile(&policy, problem.mdp(), planner.name(), &settings)?;
            Solved::Automaton(compiled)
        }
    };
    Ok(Solution {
        policy,
        planned_value: value,
        policy_convergence_horizon,
        levels,
        samples: None,
        learning: None,
        converged,
        remarks,
    })
}

/// Learns in a scenario's world. What was learned is the automaton, in whatever form it was.
///
/// # Errors
/// [`crate::Error::Unsupported`] where the learner does not accept the model, [`crate::Error::NoSteadyState`] where the agent's
/// uncertainty grows without end, and the learner's own.
pub fn learn(
    learner: &dyn Learner,
    scenario: &Scenario,
    request: &Request,
    observer: &dyn Progress,
) -> Result<Solution> {
    let model = &scenario.model;
    check_runs("runs", request.runs)?;
    request.size().check(request.form.has_size())?;
    if request.form == Form::Graph {
        return Err(no_graph(learner.name(), model));
    }
    let problem = Problem::new(model, request);
    let levels = model.is_linear();
    if levels {
        problem.mdp().check()?;
    }
    learner.accepts(model)?;
    if levels {
        problem.mdp().check_bounded()?;
    }
    let worlds = || -> Box<dyn World> { Box::new(ProblemWorld::new(scenario)) };
    let lesson = learner.learn(&problem, &worlds, request.checkpoint.as_deref(), observer)?;
    Ok(Solution {
        levels: lesson.automaton.levels.len(),
        policy: match request.form {
            Form::Grid => asked_anew(&lesson.automaton),
            Form::Nearest | Form::Segments | Form::Tree | Form::Graph => {
                Solved::Automaton(annotated(lesson.automaton, &problem, request))
            }
        },
        planned_value: None,
        policy_convergence_horizon: None,
        samples: Some(lesson.samples),
        learning: Some(lesson.learning),
        converged: lesson.converged,
        remarks: lesson.remarks,
    })
}

fn compiler(request: &Request) -> compile::Settings {
    compile::Settings {
        matching: request.form.matching(),
        episodes: request.runs,
        nodes: request.nodes,
        loss: request.loss,
        seed: request.seed,
        ..compile::Settings::default()
    }
}

/// The automaton, its nodes told where they are reached from and how often, if they do not know already.
fn annotated(mut automaton: Automaton, problem: &Problem, request: &Request) -> Automaton {
    if automaton.nodes.iter().all(|node| node.visits == 0.0) {
        let space = automaton.space(problem.model());
        compile::annotate(&mut automaton, space.as_ref(), request.runs, request.seed);
    }
    automaton
}

fn asked_anew(automaton: &Automaton) -> Solved {
    Solved::Rule {
        updater: automaton.updater.clone(),
        policy: Box::new(AutomatonRunner::new(automaton)),
    }
}
