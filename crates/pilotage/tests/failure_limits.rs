//! Planning with failure limits: the value on a grid against simulation, the search without a grid, and mean lives.

use pilotage::belief::{Belief, BeliefMdp};
use pilotage::error::Error;
use pilotage::model::{ActionId, Interval, Model, Region};
use pilotage::policy::{AutomatonRunner, Policy};
use pilotage::progress::Silent;
use pilotage::scenario::{Scenario, find, read};
use pilotage::simulate::{LifeOptions, Options, evaluate, life};
use pilotage::solve::policy_search::failure::{Runs, Sample};
use pilotage::solve::policy_search::search;
use pilotage::solve::{Planner, PolicySearch, value_iteration};

/// An unstable variable that has to be kept within limits.
fn edge(failure_reward: f64) -> Model {
    let text = format!(
        r#"
format = 1
name = "edge"
about = "Keep an unstable variable within two units of zero."
discount = 0.9

[state]
names = ["x"]
bounds = [[-2.0, 2.0]]

[start]
mean = [1.0]
covariance = [[0.001]]

[motion]
A = [[1.1]]
B = [[1.0]]
noise = [[0.2]]

[sensor]
H = [[1.0]]
noise = [[0.001]]

[actions]
DOWN = {{ u = [-0.3] }}
UP = {{ u = [0.3] }}

[[reward]]
in = {{ x = [1.0, 2.0] }}
value = 1.0

[episode]
length = 200
alive = {{ x = [-2.0, 2.0] }}
failure_reward = {failure_reward:?}
"#
    );
    read(&text, "edge.toml")
        .unwrap_or_else(|error| panic!("{error}"))
        .model
}

/// The sensor is so good that the belief is all but the state, so that the planned value is that of the world: apart by less than
/// 4 standard errors (chance 6e-5 for each) and 0.005 for the little that is not known.
#[test]
fn value_iteration_counts_failures() {
    for failure_reward in [0.0, -5.0] {
        let model = edge(failure_reward);
        let mdp = BeliefMdp::new(&model);
        let policy =
            value_iteration::solve(&mdp, &value_iteration::Settings::default(), &Silent).unwrap();
        assert!(policy.converged);
        let options = Options {
            episodes: 20_000,
            seed: 3,
        };
        let earned = evaluate(
            &Scenario::assumed(&model),
            &mdp.filter(),
            &policy,
            options,
            &Silent,
        );
        assert!(
            earned.failed > 0.5,
            "failures matter here: {}",
            earned.failed
        );
        let apart = (policy.start_value() - earned.discounted.mean).abs();
        assert!(
            apart < 4.0 * earned.discounted.stderr + 0.005,
            "failing pays {failure_reward}: planned {}, earned {:?}",
            policy.start_value(),
            earned.discounted
        );
    }
}

/// What lies close to a limit is worth staying at only where failing costs nothing.
#[test]
fn the_price_of_failing_changes_what_is_done() {
    let action_at = |failure_reward: f64, x: f64| {
        let mdp = BeliefMdp::new(&edge(failure_reward));
        let policy =
            value_iteration::solve(&mdp, &value_iteration::Settings::default(), &Silent).unwrap();
        policy.action(&Belief {
            stratum: mdp.strata() - 1,
            mode: 0,
            mean: vec![x],
        })
    };
    assert_eq!(action_at(0.0, 1.0), 1);
    assert_eq!(action_at(-20.0, 1.0), 0);
}

struct Always(ActionId);

impl Policy for Always {
    fn action(&self, _: &Belief) -> ActionId {
        self.0
    }
}

/// From a certain start, pushed up at 0.3 a step without noise, `x` is 1.4, 1.84, 2.324: every life lasts three steps.
#[test]
fn lives_are_counted_exactly() {
    let mut model = edge(0.0);
    model.motion.noise *= 0.0;
    model.start[0].covariance *= 0.0;
    let filter = BeliefMdp::new(&model).filter();
    let options = LifeOptions {
        runs: 2,
        steps: 10,
        seed: 1,
    };
    let life = life(
        &Scenario::assumed(&model),
        &filter,
        &Always(1),
        options,
        &Silent,
    );
    assert_eq!((life.steps(), life.failures(), life.early()), (20, 6, 6));
    let mean = life.mean().unwrap();
    assert!((mean.mean - 20.0 / 6.0).abs() < 1e-12);
    assert!((mean.stderr - mean.mean / 6.0_f64.sqrt()).abs() < 1e-12);
    assert_eq!(life.unfailing(), 0);
}

fn pole(name: &str, effort: f64) -> (Model, BeliefMdp, PolicySearch) {
    let model = find(name).expect("a built-in model").model;
    let mdp = BeliefMdp::new(&model);
    let settings = PolicySearch {
        effort,
        ..PolicySearch::survival()
    };
    (model, mdp, settings)
}

/// The belief's own probability of failing foretells the mean life in the linear world: 20 runs of 30,000 steps see about 15
/// failures, whose count is within a factor 2.5 of its expectation with more than 99% probability.
#[test]
fn the_probability_of_failing_foretells_life() {
    let (mut model, _, settings) = pole("cart-pole-noisy", 0.02);
    // The believed start is the file's true one. From the one it has there, most poles would have fallen at once, and the belief about
    // the others does not know that they have not.
    let truth = find("cart-pole-noisy").expect("a built-in model").truth;
    model.start = truth.start.expect("the pole starts upright");
    // Limits closer by a fifth make lives short enough to be counted.
    for (_, side) in &mut model.episode.alive.sides {
        *side = Interval::new(0.8 * side.low, 0.8 * side.high);
    }
    let mdp = BeliefMdp::new(&model);
    let automaton = search(&mdp, &settings, 1, &Silent).unwrap();
    assert_eq!(automaton.nodes.len(), 2);
    let policy = AutomatonRunner::new(&automaton);
    let sample = Sample {
        runs: 100,
        steps: 3000,
        seed: 5,
    };
    let foretold = Runs::from_start(&mdp).failure(&policy, sample);
    let options = LifeOptions {
        runs: 20,
        steps: 30_000,
        seed: 11,
    };
    let counted = life(
        &Scenario::assumed(&model),
        &automaton.updater,
        &policy,
        options,
        &Silent,
    );
    let ratio = counted.failures() as f64 / counted.steps() as f64 / foretold;
    assert!(
        (0.4..2.5).contains(&ratio),
        "foretold {foretold:e}, counted {counted:?}"
    );
}

#[cfg(feature = "parallel")]
#[test]
fn planning_does_not_depend_on_threads() {
    let (_, mdp, settings) = pole("cart-pole", 0.002);
    let plan = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| search(&mdp, &settings, 1, &Silent).unwrap())
    };
    let alone = plan(1);
    assert_eq!(alone.nodes.len(), 6);
    assert_eq!(alone, plan(2));
}

#[test]
fn models_without_a_planner_are_told_what_to_change() {
    let (mut model, mdp, settings) = pole("cart-pole", 0.002);
    let refusal = |result: Result<_, Error>| match result {
        Err(Error::Unsupported { reason, .. }) => reason,
        other => panic!("{other:?}"),
    };
    let grid =
        value_iteration::solve(&mdp, &value_iteration::Settings::default(), &Silent).map(|_| ());
    assert!(refusal(grid).contains("use policy-search"));
    let huge = value_iteration::Settings {
        points: Some(100),
        ..Default::default()
    };
    assert!(matches!(
        value_iteration::solve(&mdp, &huge, &Silent),
        Err(Error::TooLarge { .. })
    ));
    let off_centre = Interval::new(0.1, 2.4);
    model.episode.alive = Region::new(vec![(0, off_centre)]);
    let moved = search(&BeliefMdp::new(&model), &settings, 1, &Silent).map(|_| ());
    assert!(refusal(moved).contains("`position`"));
    model.episode.alive = Region::everywhere();
    assert!(settings.accepts(&model).is_err());
    let free = search(&BeliefMdp::new(&model), &settings, 1, &Silent).map(|_| ());
    assert!(refusal(free).contains("`alive`"));
}
