//! One way to run any solver.

use std::ops::RangeInclusive;
use std::path::PathBuf;

use super::kbvi::branches::{self, Branches};
use super::kbvi::{closed, formulas::Formulas, generate, quadratic};
use super::mls::MostLikelyState;
use super::qmdp::Qmdp;
use super::{Form, Learning, Solution, Solved, SolverKind, arkaq, compile, kafaq, lqg, mdp};
use crate::belief::BeliefMdp;
use crate::error::Result;
use crate::observe::Observer;
use crate::policy::{Automaton, Controller, Policy};
use crate::scenario::Scenario;
use crate::world::{ProblemWorld, World};

/// Settings of all solvers; each takes what concerns it.
#[derive(Debug, Clone, PartialEq)]
pub struct SolveSettings {
    /// Form of the policy.
    pub form: Form,
    /// Seed of every random number.
    pub seed: u64,
    /// Points of a grid along each variable, at least 2; `None` for the solver's own choice.
    pub points: Option<usize>,
    /// Most memory for a grid, MiB.
    pub memory: u64,
    /// First and last horizon that `kbvi` tries.
    pub horizons: RangeInclusive<usize>,
    /// Episodes run to see which beliefs a policy meets, at least 1; `None` for the solver's own choice.
    pub runs: Option<usize>,
    /// Steps for which `kbvi` keeps an action once chosen, at least 1.
    pub group: usize,
    /// Whether `kbvi` looks less far ahead with every step of an episode, as in Figure 5.8.
    pub decreasing: bool,
    /// The formulas of `kbvi`.
    pub formulas: Formulas,
    /// Factor on the length of a policy search's simulations, above 0; 1 is the thorough search.
    pub effort: f64,
    /// What deviations cost `lqg`.
    pub weights: lqg::Weights,
    /// What concerns `kafaq` alone; its seed is `seed`.
    pub kafaq: kafaq::Settings,
    /// What concerns `arkaq` alone; its seed is `seed`.
    pub arkaq: arkaq::Settings,
    /// File in which a learner keeps its state, to go on from there if it is stopped.
    pub checkpoint: Option<PathBuf>,
}

impl Default for SolveSettings {
    fn default() -> Self {
        let generate = generate::Settings::default();
        Self {
            form: Form::default(),
            seed: generate.seed,
            points: None,
            memory: closed::Settings::default().memory,
            horizons: generate.search.horizon..=generate.last_horizon,
            runs: None,
            group: generate.search.group,
            decreasing: generate.decreasing,
            formulas: generate.search.formulas,
            effort: 1.0,
            weights: lqg::Weights::default(),
            kafaq: kafaq::Settings::default(),
            arkaq: arkaq::Settings::default(),
            checkpoint: None,
        }
    }
}

impl SolveSettings {
    /// Settings of the compiler.
    fn compiler(&self) -> compile::Settings {
        let defaults = compile::Settings::default();
        compile::Settings {
            matching: self.form.matching(),
            episodes: self.runs.unwrap_or(defaults.episodes),
            seed: self.seed,
            ..defaults
        }
    }

    /// Settings of value iteration on true states.
    fn states(&self) -> mdp::Settings {
        mdp::Settings {
            points: self.points,
            memory: self.memory,
            ..Default::default()
        }
    }
}

/// Solves a scenario: planners are handed its model alone, learners act in its world.
///
/// # Errors
/// [`crate::Error::Unsupported`] where the solver does not accept the model, [`crate::Error::NoSteadyState`] where the agent's uncertainty grows
/// without end, and the solver's own.
pub fn solve(
    kind: SolverKind,
    scenario: &Scenario,
    settings: &SolveSettings,
    observer: &dyn Observer,
) -> Result<Solution> {
    let model = &scenario.model;
    kind.accepts_with(model, settings)?;
    let mdp = BeliefMdp::new(model);
    if kind == SolverKind::Lqg && lqg::use_of(model) == Ok(lqg::Use::Control) {
        return control(&mdp);
    }
    mdp.levels().check_bounded(model)?;
    match kind {
        SolverKind::Kbvi => kbvi(&mdp, settings, observer),
        SolverKind::KbviClosed if quadratic::suits(model) => planes(&mdp, settings, observer),
        SolverKind::KbviClosed => {
            let grid = closed::Settings {
                points: settings.points,
                memory: settings.memory,
                ..Default::default()
            };
            let policy = closed::solve(&mdp, &grid, observer)?;
            let converged = policy.converged;
            planned(kind, &mdp, policy, converged, settings)
        }
        SolverKind::Lqg => nearest_action(&mdp, settings),
        SolverKind::Qmdp => {
            let policy = Qmdp::solve(&mdp, &settings.states(), observer)?;
            let converged = policy.converged();
            planned(kind, &mdp, policy, converged, settings)
        }
        SolverKind::Kafaq | SolverKind::Arkaq => learned(kind, scenario, &mdp, settings, observer),
        SolverKind::Mls => {
            let policy = MostLikelyState::solve(&mdp, &settings.states(), observer)?;
            let converged = policy.converged();
            planned(kind, &mdp, policy, converged, settings)
        }
    }
}

fn kbvi(mdp: &BeliefMdp, settings: &SolveSettings, observer: &dyn Observer) -> Result<Solution> {
    let defaults = generate::Settings::default();
    let search = branches::Settings {
        horizon: *settings.horizons.start(),
        group: settings.group,
        formulas: settings.formulas,
    };
    let generated = generate::generate(
        mdp,
        &generate::Settings {
            matching: settings.form.matching(),
            search,
            last_horizon: *settings.horizons.end(),
            runs: settings.runs.unwrap_or(defaults.runs),
            decreasing: settings.decreasing,
            seed: settings.seed,
            ..defaults
        },
        observer,
    )?;
    let planned_value = generated.automaton.planned_value;
    let policy = match settings.form {
        Form::Nearest | Form::Segments => Solved::Automaton(generated.automaton),
        Form::Grid => {
            let last = generated
                .history
                .last()
                .map_or(search.horizon, |last| last.0);
            let planner = Branches::new(mdp.clone(), search);
            rule(mdp, planner.with_horizon(last))
        }
    };
    Ok(Solution {
        policy,
        planned_value,
        policy_convergence_horizon: generated.convergence_horizon,
        levels: mdp.levels().len(),
        samples: None,
        learning: None,
        converged: generated.convergence_horizon.is_some(),
    })
}

/// Learned in the scenario's world. What was learned is the automaton, in whatever form it is asked for.
fn learned(
    kind: SolverKind,
    scenario: &Scenario,
    mdp: &BeliefMdp,
    settings: &SolveSettings,
    observer: &dyn Observer,
) -> Result<Solution> {
    let model = mdp.model();
    let (seed, checkpoint) = (settings.seed, settings.checkpoint.as_deref());
    let worlds = || -> Box<dyn World> { Box::new(ProblemWorld::new(scenario)) };
    let (mut automaton, samples, converged, learning) = if kind == SolverKind::Arkaq {
        let own = arkaq::Settings {
            seed,
            ..settings.arkaq.clone()
        };
        let found = arkaq::learn(model, &worlds, &own, checkpoint, observer)?;
        let learning = Learning::Arkaq(found.learning);
        (found.automaton, found.samples, found.converged, learning)
    } else {
        let own = kafaq::Settings {
            seed,
            ..settings.kafaq.clone()
        };
        let found = kafaq::learn(model, &worlds, &own, checkpoint, observer)?;
        let learning = Learning::Kafaq(found.learning);
        (found.automaton, found.samples, found.converged, learning)
    };
    let compiler = settings.compiler();
    compile::annotate(&mut automaton, mdp, compiler.episodes, compiler.seed);
    Ok(Solution {
        policy: match settings.form {
            Form::Nearest | Form::Segments => Solved::Automaton(automaton),
            Form::Grid => Solved::Rule {
                filter: automaton.filter.clone(),
                policy: Box::new(Controller::new(&automaton)),
            },
        },
        planned_value: None,
        policy_convergence_horizon: None,
        levels: mdp.levels().len(),
        samples: Some(samples),
        learning: Some(learning),
        converged,
    })
}

/// A free control, planned exactly.
fn control(mdp: &BeliefMdp) -> Result<Solution> {
    let controller = lqg::Controller::new(mdp)?;
    Ok(Solution {
        planned_value: Some(controller.planned_value()),
        policy: Solved::Control(controller),
        policy_convergence_horizon: None,
        levels: mdp.levels().len(),
        samples: None,
        learning: None,
        converged: true,
    })
}

/// The action nearest to a command: two nodes say it exactly where there are two actions.
fn nearest_action(mdp: &BeliefMdp, settings: &SolveSettings) -> Result<Solution> {
    let policy = lqg::NearestAction::new(mdp.model(), &settings.weights)?;
    let automaton = match settings.form {
        Form::Nearest => policy.automaton(mdp),
        Form::Segments | Form::Grid => None,
    };
    let Some(mut automaton) = automaton else {
        return planned(SolverKind::Lqg, mdp, policy, true, settings);
    };
    let compiler = settings.compiler();
    compile::annotate(&mut automaton, mdp, compiler.episodes, compiler.seed);
    Ok(searched(mdp, automaton))
}

/// Too many variables for a grid, and limits to stay within: nodes on either side of planes, which are the planner itself.
fn planes(mdp: &BeliefMdp, settings: &SolveSettings, observer: &dyn Observer) -> Result<Solution> {
    let planner = quadratic::Settings {
        effort: settings.effort,
        seed: settings.seed,
        ..Default::default()
    };
    let automaton = quadratic::solve(mdp, &planner, observer)?;
    if settings.form != Form::Nearest {
        let policy = Controller::new(&automaton);
        return planned(SolverKind::KbviClosed, mdp, policy, true, settings);
    }
    Ok(searched(mdp, automaton))
}

/// An automaton that was not planned on a grid, so that what it is worth is not known.
fn searched(mdp: &BeliefMdp, automaton: Automaton) -> Solution {
    Solution {
        policy: Solved::Automaton(automaton),
        planned_value: None,
        policy_convergence_horizon: None,
        levels: mdp.levels().len(),
        samples: None,
        learning: None,
        converged: true,
    }
}

/// A planner's policy in the form asked for.
fn planned(
    kind: SolverKind,
    mdp: &BeliefMdp,
    policy: impl Policy + 'static,
    converged: bool,
    settings: &SolveSettings,
) -> Result<Solution> {
    Ok(Solution {
        planned_value: policy.value(mdp.start()),
        policy: match settings.form {
            Form::Grid => rule(mdp, policy),
            Form::Nearest | Form::Segments => Solved::Automaton(compile::compile(
                &policy,
                mdp,
                kind.name(),
                &settings.compiler(),
            )?),
        },
        policy_convergence_horizon: None,
        levels: mdp.levels().len(),
        samples: None,
        learning: None,
        converged,
    })
}

fn rule(mdp: &BeliefMdp, policy: impl Policy + 'static) -> Solved {
    Solved::Rule {
        policy: Box::new(policy),
        filter: mdp.filter(),
    }
}
