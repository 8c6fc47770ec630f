//! A planner and a learner that the library does not know: a file and a line each.
#![allow(clippy::unwrap_used)]

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use pilotage::Result;
use pilotage::belief::Belief;
use pilotage::model::{ActionId, Model};
use pilotage::policy::{Automaton, Matching, Node, Place, Policy};
use pilotage::progress::{Progress, Silent};
use pilotage::scenario::{self, Scenario};
use pilotage::simulate::Options;
use pilotage::solve::{
    Course, Entry, Form, Learned, Learner, Learning, Lesson, Owner, Plan, Planner, Problem,
    Registry, Request, Run, Settings, Solution, Worlds, run_course, solve,
};
use pilotage::world::{Observation, Streams, World};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Always the same action.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
struct Stubborn {
    /// Number of the action; at least 0.
    action: usize,
}

impl Settings for Stubborn {
    fn validate(&self) -> Result<()> {
        Ok(())
    }
}

impl Policy for Stubborn {
    fn action(&self, _: &Belief) -> ActionId {
        self.action
    }
}

impl Planner for Stubborn {
    fn name(&self) -> &'static str {
        "stubborn"
    }

    fn accepts(&self, model: &Model) -> Result<()> {
        let has = self.action < model.actions.len();
        has.then_some(())
            .ok_or_else(|| pilotage::Error::Unsupported {
                solver: self.name(),
                model: model.name.clone(),
                reason: format!("it has no action {}; set another", self.action),
            })
    }

    fn plan(&self, problem: &Problem, _: &dyn Progress) -> Result<Plan> {
        Ok(Plan::rule(self.clone(), problem.mdp().clone()))
    }
}

/// Tries every action for an episode after the other and keeps to the best.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
struct Bandit {
    /// Seed of every random number.
    seed: u64,
    /// Episodes of each action; at least 1.
    episodes: usize,
}

impl Default for Bandit {
    fn default() -> Self {
        Self {
            seed: 1,
            episodes: 10,
        }
    }
}

impl Settings for Bandit {
    fn validate(&self) -> Result<()> {
        Ok(())
    }
}

impl Learner for Bandit {
    fn name(&self) -> &'static str {
        "bandit"
    }

    fn accepts(&self, _: &Model) -> Result<()> {
        Ok(())
    }

    fn learn(
        &self,
        problem: &Problem,
        worlds: &Worlds<'_>,
        checkpoint: Option<&Path>,
        observer: &dyn Progress,
    ) -> Result<Lesson> {
        let settings = Self {
            seed: problem.seed(),
            ..self.clone()
        };
        let trials = Trials {
            problem,
            worlds,
            settings,
        };
        let learned = run_course(trials, checkpoint, observer)?;
        Ok(Lesson {
            automaton: learned.automaton,
            converged: learned.converged,
            samples: learned.samples,
            learning: Learning {
                found: format!("returns {:?}", learned.learning),
                ..Learning::default()
            },
            remarks: Vec::new(),
        })
    }
}

/// The bandit with its task.
struct Trials<'a> {
    problem: &'a Problem,
    worlds: &'a Worlds<'a>,
    settings: Bandit,
}

/// Sum of the returns of each action tried, and steps.
#[derive(Debug, Default, Serialize, Deserialize)]
struct State {
    returns: Vec<f64>,
    steps: u64,
}

impl Course for Trials<'_> {
    type Settings = Bandit;
    type State = State;
    type Learning = Vec<f64>;

    fn owner(&self) -> Owner<'_, Bandit> {
        Owner {
            solver: "bandit",
            problem: &self.problem.model().name,
            fingerprint: self.problem.model().fingerprint(),
            settings: &self.settings,
        }
    }

    fn start(&self) -> Result<State> {
        Ok(State::default())
    }

    fn check(&self, state: &State) -> std::result::Result<(), String> {
        match state.returns.len() <= self.problem.model().actions.len() {
            true => Ok(()),
            false => Err("more actions than there are".to_owned()),
        }
    }

    fn step(&self, state: &mut State, observer: &dyn Progress) -> Result<ControlFlow<()>> {
        let (model, action) = (self.problem.model(), state.returns.len());
        if action == model.actions.len() {
            return Ok(ControlFlow::Break(()));
        }
        let mut world = (self.worlds)();
        let mut observation = Observation::new(model.observation_dim());
        let mut sum = 0.0;
        for episode in 0..self.settings.episodes as u64 {
            let mut draws = Streams::new(self.settings.seed, episode);
            world.reset(&mut draws);
            for _ in 0..model.episode.length {
                sum += world.step(action, &mut draws, &mut observation).reward;
                state.steps += 1;
            }
        }
        state.returns.push(sum);
        observer.progress("actions", action as u64 + 1, model.actions.len() as u64);
        Ok(ControlFlow::Continue(()))
    }

    fn learned(&self, state: &State) -> Learned<Vec<f64>> {
        let returns = state.returns.iter().enumerate();
        let best = returns.max_by(|a, b| a.1.total_cmp(b.1));
        let mdp = self.problem.mdp();
        let mut automaton = Automaton::new(mdp, "bandit", Matching::Nearest);
        let place = Place::Point(vec![0.0; mdp.model().state_dim()]);
        let levels = 0..=mdp.strata() - 1;
        let action = best.map_or(0, |(action, _)| action);
        automaton
            .nodes
            .push(Node::new(levels, 0, place, action, None));
        Learned {
            automaton,
            converged: state.returns.len() == mdp.model().actions.len(),
            samples: state.steps,
            learning: state.returns.clone(),
        }
    }
}

/// Asks for no more than so many pieces of work.
struct Impatient {
    left: AtomicUsize,
}

impl Progress for Impatient {
    fn goes_on(&self) -> ControlFlow<()> {
        match self.left.fetch_sub(1, Ordering::Relaxed) {
            0 => ControlFlow::Break(()),
            _ => ControlFlow::Continue(()),
        }
    }
}

fn registry() -> Registry {
    Registry::builtin()
        .with(Entry::planner::<Stubborn>(
            "stubborn",
            &["mule"],
            "always the same",
        ))
        .with(Entry::learner::<Bandit>(
            "bandit",
            &[],
            "tries every action",
        ))
}

fn solved(name: &str, settings: &[(&str, &str)], scenario: &Scenario, form: Form) -> Solution {
    let told: Vec<(String, String)> = settings
        .iter()
        .map(|(key, value)| ((*key).to_owned(), (*value).to_owned()))
        .collect();
    let registry = registry();
    let solver = registry.find(name).unwrap().solver(&told).unwrap();
    let request = Request {
        runs: 20,
        ..Request::form(form)
    };
    solve(&solver, scenario, &request, &Silent).unwrap()
}

#[test]
fn a_planner_of_ones_own_is_set_compiled_and_evaluated_like_any_other() {
    let scenario = scenario::find("corridor-unbounded").unwrap();
    for form in Form::ALL.into_iter().filter(|form| *form != Form::Graph) {
        let solution = solved("mule", &[("action", "1")], &scenario, form);
        if let Some(automaton) = solution.automaton() {
            assert_eq!((automaton.solver.as_str(), form), ("stubborn", form));
            assert!(automaton.nodes.iter().all(|node| node.action == 1));
        }
        let options = Options {
            episodes: 10,
            seed: 1,
        };
        solution.evaluate(&scenario, options, &Silent).unwrap();
    }
    let solver = registry().find("stubborn").unwrap().solver(&[]).unwrap();
    let refused = solve(&solver, &scenario, &Request::form(Form::Graph), &Silent);
    let said = refused.map(|_| ()).unwrap_err().to_string();
    assert!(
        said.contains("needs a discrete sensor") && said.contains("such as tree"),
        "{said}"
    );
    let entry = registry().find("stubborn").copied().unwrap();
    let error = entry.solver(&[("acton".to_owned(), "1".to_owned())]);
    let error = error.map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("did you mean `action`?"), "{error}");
    let error = entry.solver(&[("action".to_owned(), "9".to_owned())]);
    assert!(error.unwrap().accepts(&scenario.model).is_err());
}

#[test]
fn a_learner_of_ones_own_is_stopped_and_gone_on_with_like_any_other() {
    let scenario = scenario::find("corridor-unbounded").unwrap();
    let whole = solved("bandit", &[("episodes", "5")], &scenario, Form::Nearest);
    assert!(whole.converged && whole.samples.unwrap() > 0);
    // Going east for ever passes by what is paid.
    assert_eq!(whole.automaton().unwrap().nodes[0].action, 2);

    let folder = tempfile::tempdir().unwrap();
    let request = Request {
        runs: 20,
        checkpoint: Some(folder.path().join("bandit.json")),
        ..Request::default()
    };
    let registry = registry();
    let told = [("episodes".to_owned(), "5".to_owned())];
    let bandit = registry.find("bandit").unwrap().solver(&told).unwrap();
    let impatient = Impatient {
        left: AtomicUsize::new(1),
    };
    let part = solve(&bandit, &scenario, &request, &impatient).unwrap();
    assert!(!part.converged && part.samples < whole.samples);
    let rest = solve(&bandit, &scenario, &request, &Silent).unwrap();
    assert_eq!(rest.automaton(), whole.automaton());
    assert_eq!(rest.learning, whole.learning);
}

#[test]
fn a_state_that_no_run_can_have_is_refused() {
    let scenario = scenario::find("corridor-unbounded").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bandit.json");
    let problem = Problem::new(&scenario.model, &Request::default());
    let worlds = || -> Box<dyn World> { unreachable!("nothing is learned") };
    let trials = || Trials {
        problem: &problem,
        worlds: &worlds,
        settings: Bandit::default(),
    };
    let state = State {
        returns: vec![0.0; 9],
        steps: 0,
    };
    trials().owner().save(&state, &path).unwrap();
    let refused = Run::resume(trials(), &path).map(|_| ()).unwrap_err();
    assert!(
        refused.to_string().contains("more actions than there are"),
        "{refused}"
    );
}
