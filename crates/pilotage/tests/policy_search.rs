//! The search for switching planes: what it earns beside value iteration, what it promises, what it refuses.
#![allow(clippy::unwrap_used)]

use pilotage::belief::BeliefMdp;
use pilotage::model::{Interval, Region, Reward, Steps, When};
use pilotage::progress::Silent;
use pilotage::scenario::{self, Scenario};
use pilotage::simulate::{Options, compare};
use pilotage::solve::policy_search::Objective;
use pilotage::solve::{Form, Planner, PolicySearch, Request, Solved, ValueIteration, plan};

fn quick() -> PolicySearch {
    PolicySearch {
        effort: 0.3,
        ..PolicySearch::default()
    }
}

/// In the corridor without walls value iteration is exact and its policy a matter of two planes, so that the search loses no more than
/// 2 % of it, in the same 20,000 episodes.
#[test]
fn the_return_is_that_of_value_iteration_where_planes_are_enough() {
    let scenario = scenario::find("corridor-unbounded").unwrap();
    let model = &scenario.model;
    let best = plan(
        &ValueIteration::default(),
        model,
        &Request::form(Form::Grid),
        &Silent,
    )
    .unwrap();
    let Solved::Rule {
        policy,
        updater: filter,
    } = &best.policy
    else {
        panic!("asked for as a rule");
    };
    let found = plan(&quick(), model, &Request::default(), &Silent).unwrap();
    let automaton = found.automaton().unwrap();
    assert!(automaton.nodes.len() <= 9, "{}", automaton.nodes.len());
    let options = Options {
        episodes: 20_000,
        seed: 8,
    };
    let lost = compare(
        &Scenario::assumed(model),
        filter,
        policy.as_ref(),
        automaton,
        options,
        &Silent,
    );
    assert!(
        lost.mean < 0.02 * best.planned_value.unwrap(),
        "{lost:?} of {:?}",
        best.planned_value
    );
}

/// What is promised is a mean over episodes, and so is what is earned: apart by less than 5 of their standard errors (chance 6e-7).
#[test]
fn what_is_promised_is_earned_where_the_model_holds() {
    for name in ["corridor-unbounded", "cart-pole-sd"] {
        let scenario = scenario::find(name).unwrap();
        let settings = PolicySearch {
            effort: if name == "cart-pole-sd" { 0.02 } else { 0.3 },
            ..PolicySearch::default()
        };
        let found = plan(&settings, &scenario.model, &Request::default(), &Silent).unwrap();
        assert!(found.remarks.is_empty(), "{:?}", found.remarks);
        let episodes = (10_000.0 * settings.effort) as usize;
        let options = Options { episodes, seed: 77 };
        let assumed = Scenario::assumed(&scenario.model);
        let earned = found.evaluate(&assumed, options, &Silent).unwrap();
        let apart = (found.planned_value.unwrap() - earned.discounted.mean).abs();
        assert!(
            apart < 5.0 * 2.0_f64.sqrt() * earned.discounted.stderr,
            "{name}: {:?} against {:?}",
            found.planned_value,
            earned.discounted
        );
    }
}

#[test]
fn rewards_are_looked_at_unless_survival_is_asked_for() {
    // A place on the right pays, and the limits leave room for it.
    let mut model = scenario::find("corridor-unbounded").unwrap().model;
    model.rewards = vec![Reward {
        actions: None,
        mode: None,
        region: Region::new(vec![(0, Interval::new(2.0, 4.0))]),
        when: When::Before,
        steps: Steps::ALL,
        value: 1.0,
        formula: None,
    }];
    model.episode.alive = Region::new(vec![(0, Interval::new(-6.0, 6.0))]);
    let assumed = Scenario::assumed(&model);
    let earned = |objective| {
        let settings = PolicySearch {
            objective,
            ..quick()
        };
        let found = plan(&settings, &model, &Request::default(), &Silent).unwrap();
        let options = Options {
            episodes: 4000,
            seed: 4,
        };
        let earned = found.evaluate(&assumed, options, &Silent).unwrap();
        (earned.discounted.mean, earned.failed, found.remarks)
    };
    let (rich, _, nothing) = earned(Objective::Return);
    let (poor, failed, remarks) = earned(Objective::Survival);
    assert!(nothing.is_empty(), "{nothing:?}");
    assert!(remarks[0].contains("not looked at"), "{remarks:?}");
    assert!(rich > 1.5 * poor, "{rich} against {poor}");
    assert!(failed < 0.05, "{failed}");
    // Where nothing is paid there is nothing else.
    model.rewards.clear();
    let found = plan(&quick(), &model, &Request::default(), &Silent).unwrap();
    assert!(
        found.planned_value.is_none() && found.remarks.len() == 1,
        "{:?}",
        found.remarks
    );
}

/// Many variables are no obstacle: six of them, each to be kept where it pays.
#[test]
fn the_number_of_variables_does_not_matter() {
    let text = r#"
format = 1
name = "six"
about = "Six points on a line of springs, pushed at one end."
discount = 0.95

[state]
names = ["a", "b", "c", "d", "e", "f"]
bounds = [[-5.0, 5.0], [-5.0, 5.0], [-5.0, 5.0], [-5.0, 5.0], [-5.0, 5.0], [-5.0, 5.0]]

[start]
mean = [2.0, 0.0, 0.0, 0.0, 0.0, 0.0]
covariance = COVARIANCE

[motion]
A = [
    [0.9, 0.1, 0.0, 0.0, 0.0, 0.0],
    [0.1, 0.8, 0.1, 0.0, 0.0, 0.0],
    [0.0, 0.1, 0.8, 0.1, 0.0, 0.0],
    [0.0, 0.0, 0.1, 0.8, 0.1, 0.0],
    [0.0, 0.0, 0.0, 0.1, 0.8, 0.1],
    [0.0, 0.0, 0.0, 0.0, 0.1, 0.9],
]
B = [[1.0], [0.0], [0.0], [0.0], [0.0], [0.0]]
noise = NOISE

[sensor]
noise = COVARIANCE

[actions]
LEFT = { u = [-0.4] }
STAY = { u = [0.0] }
RIGHT = { u = [0.4] }

[[reward]]
in = { a = [-0.5, 0.5], b = [-0.5, 0.5] }
value = 1.0

[episode]
length = 60
"#;
    let diagonal = |value: f64| {
        let row =
            |i: usize| -> Vec<f64> { (0..6).map(|j| if i == j { value } else { 0.0 }).collect() };
        format!("{:?}", (0..6).map(row).collect::<Vec<_>>())
    };
    let text = text
        .replace("COVARIANCE", &diagonal(0.2))
        .replace("NOISE", &diagonal(0.02));
    let scenario = scenario::read(&text, "six.toml").unwrap_or_else(|error| panic!("{error}"));
    let settings = PolicySearch {
        effort: 0.1,
        ..PolicySearch::default()
    };
    let found = plan(&settings, &scenario.model, &Request::default(), &Silent).unwrap();
    let options = Options {
        episodes: 2000,
        seed: 6,
    };
    let earned = |settings: &PolicySearch| {
        let found = plan(settings, &scenario.model, &Request::default(), &Silent).unwrap();
        let earned = found.evaluate(&scenario, options, &Silent).unwrap();
        earned.discounted.mean
    };
    // Hardly searched at all, it is the regulator.
    let least = PolicySearch {
        effort: 1e-9,
        ..PolicySearch::default()
    };
    let (searched, begun) = (earned(&settings), earned(&least));
    assert!(searched > begun, "{searched} against {begun}");
    assert_eq!(found.automaton().unwrap().nodes.len() % 3, 0);
}

#[test]
fn what_planes_cannot_tell_apart_is_refused_with_what_would_do() {
    let refused = |name: &str, settings: &PolicySearch| {
        let model = scenario::find(name).unwrap().model;
        settings.accepts(&model).unwrap_err().to_string()
    };
    for (name, settings, reason) in [
        (
            "corridor-declare",
            PolicySearch::default(),
            "have the same control",
        ),
        ("tiger", PolicySearch::default(), "use value-iteration"),
        (
            "cart-load-unload",
            PolicySearch::default(),
            "modes, walls or hypotheses",
        ),
        (
            "corridor-unbounded",
            PolicySearch::survival(),
            "add `alive` to [episode]",
        ),
    ] {
        let error = refused(name, &settings);
        assert!(error.contains(reason), "{name}: {error}");
    }
    // Limits that leave the origin out are no obstacle to earning.
    let mut model = scenario::find("corridor-unbounded").unwrap().model;
    model.episode.alive = Region::new(vec![(0, Interval::new(0.5, 9.0))]);
    assert!(PolicySearch::survival().accepts(&model).is_err());
    PolicySearch::default().accepts(&model).unwrap();
    assert!(BeliefMdp::new(&model).is_gaussian());
}
