//! Rewards, motion and sensors that change with the step `t`: planned for, whatever says so.
#![allow(clippy::unwrap_used)]

use pilotage::model::{Clause, Formula, Model, ModelBuilder};
use pilotage::policy::Automaton;
use pilotage::progress::Silent;
use pilotage::scenario::{self, Scenario};
use pilotage::simulate::{Estimate, Options};
use pilotage::solve::{CodebookPlanner, Form, Planner, Request, Solution, ValueIteration, plan};

/// A prize on the right until step 6, and on the left from then on; who is late has to be on the way before. A belief is as wide at every
/// step, so that nothing but the step tells the time.
fn turning(reward: &str) -> Scenario {
    let text = format!(
        r#"
format = 1
name = "turning"
discount = 0.9
[state]
names = ["x"]
bounds = [[-4.0, 4.0]]
[start]
mean = [0.0]
covariance = [[0.05]]
[motion]
A = [[1.0]]
B = [[1.0]]
noise = [[0.05]]
[sensor]
noise = [[0.1]]
[actions]
LEFT = {{ u = [-0.7] }}
STAY = {{ u = [0.0] }}
RIGHT = {{ u = [0.7] }}
{reward}
[episode]
length = 14
"#
    );
    scenario::read(&text, "turning").unwrap()
}

const BY_STEPS: &str = r#"
[[reward]]
in = { x = [1.5, inf] }
steps = { until = 6 }
value = 1.0
[[reward]]
in = { x = [-inf, -1.5] }
steps = { from = 6 }
value = 1.0
"#;

const BY_FORMULA: &str = r#"
[[reward]]
value = "if(t < 6, x >= 1.5, x < -1.5)"
"#;

fn planned(scenario: &Scenario, planner: &dyn Planner, form: Form) -> Solution {
    let request = Request {
        runs: 60,
        nodes: (form == Form::Tree).then_some(24),
        ..Request::form(form)
    };
    plan(planner, &scenario.model, &request, &Silent).unwrap()
}

fn codebook() -> CodebookPlanner {
    CodebookPlanner {
        strata: Some(30),
        points: Some(65),
        rounds: 2,
        episodes: 60,
        ..CodebookPlanner::default()
    }
}

fn earned(scenario: &Scenario, solution: &Solution) -> Estimate {
    let options = Options {
        episodes: 4000,
        seed: 5,
    };
    let earned = solution.earned(scenario, options, &Silent).unwrap();
    earned.assumed.discounted
}

/// Uncertainty levels that tell the time, and strata that do, come to the same.
#[test]
fn what_a_formula_says_of_steps_is_planned_for() {
    let (by_steps, by_formula) = (turning(BY_STEPS), turning(BY_FORMULA));
    assert_eq!(by_steps.model.clock(), 6);
    assert_eq!(by_formula.model.clock(), 14);
    let exact = planned(&by_steps, &ValueIteration::default(), Form::Grid);
    let worth = exact.planned_value.unwrap();
    let found = planned(&by_formula, &codebook(), Form::Tree);
    let promised = found.planned_value.unwrap();
    assert!(
        (promised - worth).abs() < 0.05 * worth,
        "{promised} {worth}"
    );
    let tree = earned(&by_formula, &found);
    let within = 3.0 * tree.stderr + 0.05 * worth;
    assert!((tree.mean - worth).abs() < within, "{tree:?} {worth}");
    let automaton = found.automaton().unwrap();
    assert!(
        automaton.conditions().contains("if t < "),
        "{}",
        automaton.conditions()
    );
}

#[test]
fn a_saved_tree_still_knows_the_time() {
    let scenario = turning(BY_FORMULA);
    let found = planned(&scenario, &codebook(), Form::Tree);
    let automaton = found.automaton().unwrap();
    let file = std::env::temp_dir().join(format!("pilotage-time-{}.json", std::process::id()));
    automaton.save(&file).unwrap();
    let loaded = Automaton::load(&file).unwrap();
    std::fs::remove_file(&file).unwrap();
    assert_eq!(*automaton, loaded);
}

/// Functions of a program are asked whether they change.
#[test]
fn functions_that_tell_the_time_are_found_out() {
    let model = |formula: Formula| -> Model {
        ModelBuilder::new("coded", 0.9)
            .variable("x", -4.0, 4.0)
            .start(&[0.0], &[0.2])
            .motion(&[1.0], &[1.0], &[0.05])
            .sensor(&[1.0], &[0.1])
            .action("STAY", &[0.0])
            .reward_of(formula, Clause::new())
            .build()
            .unwrap()
    };
    let still = model(Formula::coded("square", |point| point.state[0].powi(2)));
    assert_eq!(still.clock(), 0);
    let late = model(Formula::coded("late", |point| f64::from(point.step > 9)));
    assert_eq!(late.clock(), late.episode.length);
}
