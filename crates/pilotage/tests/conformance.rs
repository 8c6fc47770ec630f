//! Every built-in model with every solver that accepts it, and what the others say.
#![allow(clippy::unwrap_used)]

mod common;

use common::{short, small};
use pilotage::Error;
use pilotage::belief::{Belief, BeliefSpace};
use pilotage::model::{Interval, Model, Region};
use pilotage::policy::{Automaton, AutomatonRunner, Policy, PolicyGraph, Saved};
use pilotage::progress::Silent;
use pilotage::random::{Rng, Role, normal, stream};
use pilotage::scenario::{self, Scenario};
use pilotage::simulate::Options;
use pilotage::solve::value_iteration::Settings;
use pilotage::solve::{
    Entry, Form, Lqg, Mls, Planner, Qmdp, Registry, Request, Solution, Solved, ValueIteration,
    plan, rollout, solve,
};

/// Every pair of a built-in model and a solver.
fn pairs() -> impl Iterator<Item = (Scenario, Entry)> {
    scenario::names().flat_map(|name| {
        let scenario = scenario::find(name).unwrap();
        let entries = Registry::builtin().entries().to_vec();
        entries
            .into_iter()
            .map(move |entry| (scenario.clone(), entry))
    })
}

/// Bounds of any discounted return, from the rewards of one step.
fn bounds(model: &Model) -> (f64, f64) {
    let (low, high) = model.reward_range();
    // What formulas pay is not known beforehand.
    if model.rewards.iter().any(|reward| reward.formula.is_some()) {
        return (f64::NEG_INFINITY, f64::INFINITY);
    }
    if model.discount == 1.0 {
        return (f64::NEG_INFINITY, 0.0);
    }
    let sum = 1.0 / (1.0 - model.discount);
    let fails = model.episode.failure_reward;
    (low * sum + fails.min(0.0), high * sum + fails.max(0.0))
}

/// Beliefs at every level and mode, in and around the bounds.
fn beliefs(mdp: &dyn BeliefSpace, modes: usize, rng: &mut Rng) -> Vec<Belief> {
    let model = mdp.model();
    let mut beliefs = Vec::new();
    for mode in 0..modes {
        for level in 0..mdp.strata() {
            for _ in 0..20 {
                let mean = model.state.iter().map(|variable| {
                    let bounds = variable.bounds;
                    0.5 * (bounds.low + bounds.high) + 0.5 * bounds.width() * normal(rng)
                });
                beliefs.push(Belief {
                    stratum: level,
                    mode,
                    mean: mean.collect(),
                });
            }
        }
    }
    beliefs
}

fn check_policy(mdp: &dyn BeliefSpace, policy: &dyn Policy, what: &str) {
    let modes = mdp.model().modes.len();
    for belief in beliefs(mdp, modes, &mut stream(1, 0, Role::Planner)) {
        let action = policy.action(&belief);
        assert!(
            action < mdp.model().actions.len(),
            "{what}: action {action} at {belief:?}"
        );
    }
}

/// The flat runtime decides as the automaton does, and a saved automaton is the same one.
fn check_automaton(mdp: &dyn BeliefSpace, automaton: &Automaton, what: &str) {
    assert!(!automaton.nodes.is_empty(), "{what}: no nodes");
    let visits: f64 = automaton.nodes.iter().map(|node| node.visits).sum();
    assert!(
        (visits - 1.0).abs() < 1e-9,
        "{what}: visits sum to {visits}"
    );

    let controller = AutomatonRunner::new(automaton);
    // A learner has memories in place of modes.
    let modes = automaton.modes.len();
    for belief in beliefs(mdp, modes, &mut stream(2, 0, Role::Planner)) {
        assert_eq!(
            controller.action(&belief),
            automaton.action(&belief),
            "{what}: {belief:?}"
        );
    }
    let model = mdp.model();
    // Where a reading may be missing by place, a decision does not tell whether it was, or an episode began anew.
    let cases = || model.laws.cases.iter();
    let certain = model.is_linear()
        || model.sensor.present == 1.0 && cases().all(|case| case.sensor.present.is_none());
    let length = model.episode.length.min(60);
    for run in rollout::decisions(mdp, &automaton.updater, automaton, 3, length, 5) {
        let mut controller = AutomatonRunner::new(automaton);
        // A model with several starts is run from each; the controller begins at the first. Signals are not written down.
        if run[0].at != *controller.belief() || automaton.updater.readings() == 0 || !certain {
            continue;
        }
        for (now, next) in run.iter().zip(run.iter().skip(1)) {
            assert_eq!(controller.belief(), &now.at, "{what}");
            assert_eq!(controller.decide().1, now.action, "{what}");
            if next.observation.is_empty() {
                controller.reset();
            } else {
                controller.observe(now.action, &next.observation);
            }
        }
    }

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("policy.json");
    automaton.save(&path).unwrap();
    let loaded = Automaton::load(&path).unwrap();
    assert_eq!(&loaded, automaton, "{what}");
    loaded.check_problem(mdp.model(), "policy.json").unwrap();
}

/// All of a graph is reached and met or not, and a saved one is the same one.
fn check_graph(model: &Model, graph: &PolicyGraph, what: &str) {
    let visits: f64 = graph.nodes.iter().map(|node| node.visits).sum();
    assert!(
        (visits - 1.0).abs() < 1e-9,
        "{what}: visits sum to {visits}"
    );
    assert_eq!(graph.in_words().lines().count(), graph.nodes.len());
    assert_eq!(graph.signals, model.laws.symbols, "{what}");
    let Saved::Graph(loaded) = Saved::from_json(&graph.to_json().unwrap(), "policy.json").unwrap()
    else {
        panic!("{what}: no graph");
    };
    assert_eq!(&loaded, graph, "{what}");
    let saved = Saved::Graph(loaded);
    saved.check_problem(model, "policy.json").unwrap();
    saved.check_world(model, "policy.json").unwrap();
}

fn check_value(scenario: &Scenario, solution: &Solution, what: &str) {
    let model = &scenario.model;
    let (low, high) = bounds(model);
    let slack = 0.02 * (high - low).min(1e6);
    if let Some(value) = solution.planned_value {
        assert!(
            (low - slack..=high + slack).contains(&value),
            "{what}: planned {value} is outside {low}..{high}"
        );
    }
    let options = Options {
        episodes: 20,
        seed: 3,
    };
    let evaluation = solution.evaluate(scenario, options, &Silent).unwrap();
    assert_eq!(evaluation.episodes, 20);
    let mean = evaluation.discounted.mean;
    assert!(
        (low..=high).contains(&mean),
        "{what}: earned {mean} outside {low}..{high}"
    );
    let steps = evaluation.steps.mean;
    assert!(
        (1.0..=model.episode.length as f64).contains(&steps),
        "{what}: {steps} steps"
    );
}

#[test]
fn every_planner_that_accepts_a_model_solves_it_in_every_form() {
    let (solved, graphs) = solve_all(false);
    assert!(solved >= 130, "only {solved}");
    assert!(graphs > 0);
}

#[test]
fn every_learner_that_accepts_a_model_learns_it_in_every_form() {
    let (solved, _) = solve_all(true);
    assert!(solved >= 40, "only {solved}");
}

/// Solves all that planners, or learners, accept; how many solutions there are, and how many of them are graphs.
fn solve_all(learners: bool) -> (usize, usize) {
    let (mut solved, mut graphs) = (0, 0);
    // Beliefs in full of three variables take minutes to keep without optimisation, and so do cells of two. Learners take many steps.
    let in_full = |model: &Model, entry: &Entry| entry.learns() && !model.body().is_linear();
    let quick = |model: &Model, entry: &Entry| match entry.name() {
        "point-based" => model.state_dim() == 1,
        _ if in_full(model, entry) => model.state_dim() == 1 && model.modes.len() == 1,
        _ => model.is_linear() || model.state_dim() < 3,
    };
    let accepted = pairs().filter(|(scenario, entry)| {
        let asked = entry.learns() == learners && quick(&scenario.model, entry);
        asked && entry.accepts(&scenario.model).is_ok()
    });
    for (scenario, entry) in accepted {
        let model = &scenario.model;
        let gives = |form: &Form| small(&entry, model).gives(*form, model).is_ok();
        // Beliefs in full are slow to keep without optimisation: the form that suits them, and on a line the planner itself. What is learned
        // has a form of its own.
        let learned = in_full(model, &entry);
        let forms = Form::ALL
            .into_iter()
            .filter(|form| match model.is_linear() {
                _ if learned => *form == Form::Tree,
                true if entry.name() != "point-based" => true,
                _ => {
                    matches!(form, Form::Tree | Form::Graph)
                        || (*form == Form::Grid && model.state_dim() == 1)
                }
            })
            .filter(gives);
        for form in forms {
            let what = format!("{} with {} as {}", model.name, entry.name(), form.name());
            let solution = solve(&small(&entry, model), &scenario, &short(form), &Silent)
                .unwrap_or_else(|error| panic!("{what}: {error}"));
            match &solution.policy {
                Solved::Automaton(automaton) => {
                    assert_ne!(form, Form::Grid, "{what}");
                    assert_eq!(automaton.solver, entry.name());
                    let space = automaton.space(model);
                    check_policy(space.as_ref(), automaton, &what);
                    check_automaton(space.as_ref(), automaton, &what);
                }
                Solved::Rule { policy, updater } => {
                    assert_eq!(form, Form::Grid, "{what}");
                    check_policy(updater.space(model).as_ref(), policy.as_ref(), &what);
                }
                Solved::Graph(graph) => {
                    assert_eq!(form, Form::Graph, "{what}");
                    check_graph(model, graph, &what);
                    graphs += 1;
                }
                Solved::Control(_) => assert!(model.cost.is_some(), "{what}"),
            }
            check_value(&scenario, &solution, &what);
            solved += 1;
        }
    }
    (solved, graphs)
}

#[test]
fn a_solver_that_does_not_accept_a_model_says_why_and_what_would_do() {
    for (scenario, entry) in pairs() {
        let model = &scenario.model;
        let Err(error) = entry.accepts(model) else {
            continue;
        };
        let Error::Unsupported {
            solver,
            model: named,
            reason,
        } = &error
        else {
            panic!("{error}");
        };
        assert_eq!((*solver, named), (entry.name(), &model.name));
        assert!(
            ["add ", "use ", "set "]
                .iter()
                .any(|hint| reason.contains(hint)),
            "{error}"
        );
        let solver = entry.solver(&[]).unwrap();
        let refused = solve(&solver, &scenario, &Request::default(), &Silent);
        assert_eq!(
            refused.map(|_| ()).unwrap_err().to_string(),
            error.to_string()
        );
    }
}

#[test]
fn every_model_has_a_solver_and_every_solver_a_model() {
    let registry = Registry::builtin();
    for name in scenario::names() {
        let model = scenario::find(name).unwrap().model;
        let first = registry.first_for(&model).unwrap();
        assert!(!first.learns() && first.accepts(&model).is_ok(), "{name}");
    }
    for entry in registry.entries() {
        let name = entry.name();
        assert!(pairs().any(
            |(scenario, other)| other.name() == name && entry.accepts(&scenario.model).is_ok()
        ));
        assert_eq!(registry.find(name).unwrap().name(), name);
        let solver = entry.solver(&[]).unwrap();
        assert_eq!((solver.name(), solver.learns()), (name, entry.learns()));
        assert!(!entry.about().is_empty());
    }
    let first = |model: &Model| registry.first_for(model).unwrap().name();
    for (name, expected) in [
        ("corridor-blind", "value-iteration"),
        ("cart-pole", "policy-search"),
        ("light-dark-5", "point-based"),
        ("light-dark-2d", "codebook"),
        ("scalar-lqg", "value-iteration"),
        ("cart-load-unload", "point-based"),
        ("load-unload", "value-iteration"),
        ("shuttle", "point-based"),
    ] {
        assert_eq!(first(&scenario::find(name).unwrap().model), expected);
    }
    // A cost alone, and nowhere to put a grid: what is found chooses among the actions of the model, as on a grid.
    let mut free = scenario::find("scalar-lqg").unwrap().model;
    free.state[0].bounds = Interval::ALL;
    assert_eq!(first(&free), "policy-search");
}

#[test]
fn misspelt_names_bring_the_nearest() {
    let registry = Registry::builtin();
    let error = registry.find("value-iterations").unwrap_err();
    assert_eq!(
        error.to_string(),
        "there is no solver `value-iterations` (hint: did you mean `value-iteration`?)"
    );
    let error = registry.find("dynamic programming").unwrap_err();
    for entry in registry.entries() {
        assert!(error.to_string().contains(entry.name()), "{error}");
    }
    assert_eq!(
        registry.find("kbvi-closed").unwrap().name(),
        "value-iteration"
    );
    let error = Form::parse("segment").unwrap_err().to_string();
    assert!(error.contains("did you mean `segments`?"), "{error}");
}

#[test]
fn a_setting_that_a_solver_does_not_have_lists_those_it_has() {
    for entry in Registry::builtin().entries() {
        let none = [("colour".to_owned(), "1".to_owned())];
        let error = entry.solver(&none).map(|_| ()).unwrap_err().to_string();
        let known = entry.settings();
        assert!(!known.is_empty());
        for info in known {
            assert!(error.contains(&format!("`{}`", info.name)), "{error}");
            assert!(!info.about.is_empty(), "{}: {}", entry.name(), info.name);
            // Every default can be said.
            let told = [(info.name.clone(), info.default.clone())];
            assert!(entry.solver(&told).is_ok(), "{}: {told:?}", entry.name());
        }
    }
}

/// A corridor with a second variable `y` that drifts by `factor` a step, is sensed by `sensed` and disturbed by `noise`.
fn with_drift(factor: f64, sensed: f64, noise: f64) -> Scenario {
    let text = scenario::builtin("corridor-unbounded").unwrap();
    let text = text
        .replace("names = [\"x\"]", "names = [\"x\", \"y\"]")
        .replace(
            "bounds = [[0.0, 4.0]]",
            "bounds = [[0.0, 4.0], [-9.0, 9.0]]",
        )
        .replace("mean = [0.0]", "mean = [0.0, 0.0]")
        .replace(
            "covariance = [[0.30]]",
            "covariance = [[0.3, 0.0], [0.0, 0.3]]",
        )
        .replace(
            "A = [[1.0]]",
            &format!("A = [[1.0, 0.0], [0.0, {factor:?}]]"),
        )
        .replace("B = [[1.0]]", "B = [[1.0], [0.0]]")
        .replace(
            "noise = [[0.25]]",
            &format!("noise = [[0.25, 0.0], [0.0, {noise:?}]]"),
        )
        .replace(
            "H = [[1.0]]",
            &format!("H = [[1.0, 0.0], [0.0, {sensed:?}]]"),
        )
        .replace("noise = [[0.45]]", "noise = [[0.45, 0.0], [0.0, 0.45]]");
    scenario::read(&text, "drift.toml").unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn uncertainty_that_grows_for_ever_is_refused_with_its_direction() {
    // Not detectable: a random walk, and an unstable variable, that no sensor shows.
    for factor in [1.0, 1.2] {
        for name in ["value-iteration", "kbvi", "qmdp", "mls"] {
            let scenario = with_drift(factor, 0.0, 0.1);
            let registry = Registry::builtin();
            let solver = small(registry.find(name).unwrap(), &scenario.model);
            let error = solve(&solver, &scenario, &short(Form::Nearest), &Silent)
                .map(|_| ())
                .unwrap_err();
            let Error::NoSteadyState { direction, .. } = &error else {
                panic!("{error}");
            };
            let y: f64 = direction.split(", ").nth(1).unwrap().parse().unwrap();
            assert!(y.abs() > 0.999, "{error}");
            assert!(
                error.to_string().contains("give [sensor] a reading of it"),
                "{error}"
            );
        }
    }
    // Detectable: sensed, or dying out by itself.
    for scenario in [with_drift(1.2, 1.0, 0.1), with_drift(0.9, 0.0, 0.1)] {
        let grid = Settings {
            points: Some(31),
            ..Settings::default()
        };
        plan(&Mls { grid }, &scenario.model, &short(Form::Grid), &Silent).unwrap();
    }
}

#[test]
fn a_regulator_that_cannot_be_is_refused_with_its_direction() {
    // `y` runs away, costs, and no action moves it.
    let mut scenario = with_drift(1.2, 1.0, 0.1);
    scenario.model.episode.alive = Region::new(vec![
        (0, Interval::new(-1.0, 1.0)),
        (1, Interval::new(-1.0, 1.0)),
    ]);
    let error = plan(
        &Lqg::default(),
        &scenario.model,
        &Request::default(),
        &Silent,
    )
    .map(|_| ())
    .unwrap_err();
    let Error::NoSteadyState {
        what, direction, ..
    } = &error
    else {
        panic!("{error}");
    };
    assert_eq!(*what, "regulator");
    let y: f64 = direction.split(", ").nth(1).unwrap().parse().unwrap();
    assert!(y.abs() > 0.999, "{error}");
    assert!(
        error.to_string().contains("a control that moves it"),
        "{error}"
    );
}

#[test]
fn a_grid_that_is_too_large_is_refused_with_its_size() {
    let scenario = scenario::find("maze-2d").unwrap();
    let grid = Settings {
        points: Some(1001),
        memory: 16,
        ..Default::default()
    };
    let planners: [&dyn Planner; 3] = [&ValueIteration { grid }, &Qmdp { grid }, &Mls { grid }];
    for planner in planners {
        let error = plan(planner, &scenario.model, &Request::default(), &Silent)
            .map(|_| ())
            .unwrap_err();
        let Error::TooLarge {
            mebibytes, limit, ..
        } = error
        else {
            panic!("{error}");
        };
        assert_eq!(limit, 16);
        assert!(mebibytes > 16);
    }
}
