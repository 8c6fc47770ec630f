//! Every built-in model with every solver that accepts it, and what the others say.
#![allow(clippy::unwrap_used)]

use pilotage::Error;
use pilotage::belief::{Belief, BeliefMdp};
use pilotage::model::{Interval, Model, Region};
use pilotage::observe::Silent;
use pilotage::policy::{Automaton, Controller, Policy};
use pilotage::random::{Rng, Role, normal, stream};
use pilotage::scenario::{self, Scenario};
use pilotage::simulate::Options;
use pilotage::solve::{Form, Solution, SolveSettings, Solved, SolverKind, rollout, solve};
use pilotage::solve::{arkaq, kafaq};

/// Settings small enough for a test of all pairs; what is found need not be good.
fn small(model: &Model, form: Form) -> SolveSettings {
    SolveSettings {
        form,
        points: Some(match model.state_dim() {
            1 => 161,
            2 => 33,
            _ => 3,
        }),
        horizons: 1..=2,
        runs: Some(20),
        effort: 1e-3,
        kafaq: kafaq::Settings {
            epoch: 500,
            epoch_per_cell: 1,
            epoch_limit: 2,
            cells_along: 8,
            trial: 10,
            ..Default::default()
        },
        arkaq: arkaq::Settings {
            vigilances: vec![0.5],
            scout: 200,
            settle: 50,
            explore_limit: 1000,
            state_limit: 20,
            epoch: 500,
            epoch_per_entry: 1,
            epoch_limit: 2,
            trial: 10,
            ..Default::default()
        },
        ..Default::default()
    }
}

/// Every pair of a built-in model and a solver.
fn pairs() -> impl Iterator<Item = (Scenario, SolverKind)> {
    scenario::names().flat_map(|name| {
        let scenario = scenario::find(name).unwrap();
        SolverKind::ALL
            .into_iter()
            .map(move |kind| (scenario.clone(), kind))
    })
}

/// Bounds of any discounted return, from the rewards of one step.
fn bounds(model: &Model) -> (f64, f64) {
    let (low, high) = BeliefMdp::new(model).reward_range();
    if model.discount == 1.0 {
        return (f64::NEG_INFINITY, 0.0);
    }
    let sum = 1.0 / (1.0 - model.discount);
    let fails = model.episode.failure_reward;
    (low * sum + fails.min(0.0), high * sum + fails.max(0.0))
}

/// Beliefs at every level and mode, in and around the bounds.
fn beliefs(mdp: &BeliefMdp, modes: usize, rng: &mut Rng) -> Vec<Belief> {
    let model = mdp.model();
    let mut beliefs = Vec::new();
    for mode in 0..modes {
        for level in 0..mdp.levels().len() {
            for _ in 0..20 {
                let mean = model.state.iter().map(|variable| {
                    let bounds = variable.bounds;
                    0.5 * (bounds.low + bounds.high) + 0.5 * bounds.width() * normal(rng)
                });
                beliefs.push(Belief {
                    level,
                    mode,
                    mean: mean.collect(),
                });
            }
        }
    }
    beliefs
}

fn check_policy(mdp: &BeliefMdp, policy: &dyn Policy, what: &str) {
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
fn check_automaton(mdp: &BeliefMdp, automaton: &Automaton, what: &str) {
    assert!(!automaton.nodes.is_empty(), "{what}: no nodes");
    let visits: f64 = automaton.nodes.iter().map(|node| node.visits).sum();
    assert!(
        (visits - 1.0).abs() < 1e-9,
        "{what}: visits sum to {visits}"
    );

    let controller = Controller::new(automaton);
    // A learner has memories in place of modes.
    let modes = automaton.modes.len();
    for belief in beliefs(mdp, modes, &mut stream(2, 0, Role::Planner)) {
        assert_eq!(
            controller.action(&belief),
            automaton.action(&belief),
            "{what}: {belief:?}"
        );
    }
    let length = mdp.model().episode.length.min(60);
    for run in rollout::decisions(mdp, &automaton.filter, automaton, 3, length, 5) {
        let mut controller = Controller::new(automaton);
        // A model with several starts is run from each; the controller begins at the first.
        if run[0].belief != *controller.belief() {
            continue;
        }
        for (now, next) in run.iter().zip(run.iter().skip(1)) {
            assert_eq!(controller.belief(), &now.belief, "{what}");
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
fn every_solver_that_accepts_a_model_solves_it_in_every_form() {
    let mut solved = 0;
    let accepted = pairs().filter(|(scenario, kind)| kind.accepts(&scenario.model).is_ok());
    for (scenario, kind) in accepted {
        let model = &scenario.model;
        let mdp = BeliefMdp::new(model);
        for form in Form::ALL {
            let what = format!("{} with {} as {}", model.name, kind.name(), form.name());
            let solution = solve(kind, &scenario, &small(model, form), &Silent)
                .unwrap_or_else(|error| panic!("{what}: {error}"));
            match &solution.policy {
                Solved::Automaton(automaton) => {
                    assert_ne!(form, Form::Grid, "{what}");
                    assert_eq!(automaton.solver, kind.name());
                    check_policy(&mdp, automaton, &what);
                    check_automaton(&mdp, automaton, &what);
                }
                Solved::Rule { policy, .. } => {
                    assert_eq!(form, Form::Grid, "{what}");
                    check_policy(&mdp, policy.as_ref(), &what);
                }
                Solved::Control(_) => assert!(model.cost.is_some(), "{what}"),
            }
            check_value(&scenario, &solution, &what);
            solved += 1;
        }
    }
    assert!(solved >= 180, "only {solved}");
}

#[test]
fn a_solver_that_does_not_accept_a_model_says_why_and_what_would_do() {
    for (scenario, kind) in pairs() {
        let model = &scenario.model;
        let Err(error) = kind.accepts(model) else {
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
        assert_eq!((*solver, named), (kind.name(), &model.name));
        assert!(
            ["add ", "use ", "set "]
                .iter()
                .any(|hint| reason.contains(hint)),
            "{error}"
        );
        let refused = solve(kind, &scenario, &SolveSettings::default(), &Silent);
        assert_eq!(
            refused.map(|_| ()).unwrap_err().to_string(),
            error.to_string()
        );
    }
}

#[test]
fn every_model_has_a_solver_and_every_solver_a_model() {
    for name in scenario::names() {
        let model = scenario::find(name).unwrap().model;
        assert!(
            SolverKind::ALL
                .iter()
                .any(|kind| kind.accepts(&model).is_ok()),
            "{name}"
        );
    }
    for kind in SolverKind::ALL {
        assert!(
            pairs().any(|(scenario, other)| other == kind && kind.accepts(&scenario.model).is_ok())
        );
        assert_eq!(SolverKind::parse(kind.name()).unwrap(), kind);
        assert!(!kind.about().is_empty());
    }
}

#[test]
fn misspelt_names_bring_the_nearest() {
    let error = SolverKind::parse("kbvi-close").unwrap_err();
    assert_eq!(
        error.to_string(),
        "there is no solver `kbvi-close` (hint: did you mean `kbvi-closed`?)"
    );
    let error = SolverKind::parse("value-iteration")
        .unwrap_err()
        .to_string();
    for kind in SolverKind::ALL {
        assert!(error.contains(kind.name()), "{error}");
    }
    let error = Form::parse("segment").unwrap_err().to_string();
    assert!(error.contains("did you mean `segments`?"), "{error}");
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
        for kind in [
            SolverKind::KbviClosed,
            SolverKind::Kbvi,
            SolverKind::Qmdp,
            SolverKind::Mls,
        ] {
            let scenario = with_drift(factor, 0.0, 0.1);
            let settings = small(&scenario.model, Form::Nearest);
            let error = solve(kind, &scenario, &settings, &Silent)
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
        let settings = small(&scenario.model, Form::Grid);
        solve(SolverKind::Mls, &scenario, &settings, &Silent).unwrap();
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
    let error = solve(
        SolverKind::Lqg,
        &scenario,
        &SolveSettings::default(),
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
    for kind in [SolverKind::KbviClosed, SolverKind::Qmdp, SolverKind::Mls] {
        let settings = SolveSettings {
            points: Some(1001),
            memory: 16,
            ..Default::default()
        };
        let error = solve(kind, &scenario, &settings, &Silent)
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
