//! KAFAQ-learning: what it finds, what it may not know, and that a stopped run ends like one that was not.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use pilotage::belief::BeliefMdp;
use pilotage::model::{Interval, Model};
use pilotage::policy::{Automaton, AutomatonRunner, Place};
use pilotage::progress::Silent;
use pilotage::scenario::{self, Scenario};
use pilotage::simulate::{LifeOptions, Options, compare, evaluate, life};
use pilotage::solve::Run;
use pilotage::solve::kafaq::{self, Learned, Rules, Settings};
use pilotage::solve::value_iteration;
use pilotage::world::{ProblemWorld, World};
use pilotage::{Error, Result};

fn scenario(name: &str) -> Scenario {
    scenario::find(name).unwrap_or_else(|error| panic!("{error}"))
}

fn learn_in(
    world: &Scenario,
    told: &Model,
    settings: &Settings,
    checkpoint: Option<&Path>,
) -> Result<Learned> {
    let worlds = || -> Box<dyn World> { Box::new(ProblemWorld::new(world)) };
    kafaq::learn(told, &worlds, settings, checkpoint, &Silent)
}

fn learn(scenario: &Scenario, settings: &Settings) -> Learned {
    learn_in(scenario, &scenario.model, settings, None).unwrap()
}

/// Settings of a run that ends soon, wherever it has come.
fn hurried(seed: u64) -> Settings {
    Settings {
        seed,
        epoch: 1_000,
        epoch_per_cell: 2,
        epoch_limit: 6,
        trial: 20,
        ..Settings::default()
    }
}

fn places(automaton: &Automaton) -> Vec<(Vec<f64>, Vec<f64>, usize, usize)> {
    let place = |place: &Place| match place {
        Place::Segment { lower, upper, .. } => (lower.clone(), upper.clone()),
        Place::Point(point) => (point.clone(), point.clone()),
    };
    let nodes = automaton.nodes.iter();
    nodes
        .map(|node| {
            let (lower, upper) = place(&node.place);
            (lower, upper, node.mode, node.action)
        })
        .collect()
}

#[test]
fn the_hallway_is_learned_in_three_regions_as_well_as_it_can_be_planned() {
    let options = Options {
        episodes: 1_000,
        seed: 77,
    };
    for name in ["basic", "basic-inner"] {
        let scenario = scenario(name);
        let learned = learn(&scenario, &Settings::default());
        assert!(learned.converged, "{name}");
        assert!(
            learned.automaton.nodes.len() <= 3,
            "{name}: {:?}",
            places(&learned.automaton)
        );
        let plan = value_iteration::solve(
            &BeliefMdp::new(&scenario.model),
            &value_iteration::Settings::default(),
            &Silent,
        )
        .unwrap();
        let best = evaluate(&scenario, &plan.mdp().filter(), &plan, options, &Silent);
        let controller = AutomatonRunner::new(&learned.automaton);
        let earned = evaluate(
            &scenario,
            &learned.automaton.updater,
            &controller,
            options,
            &Silent,
        );
        assert!(
            earned.discounted.mean >= 0.97 * best.discounted.mean,
            "{name}: {earned:?} against {best:?}"
        );
    }
}

#[test]
fn a_hidden_load_becomes_nodes_at_the_same_place_with_opposite_actions() {
    let scenario = scenario("cart-load-unload");
    let learned = learn(&scenario, &Settings::default());
    let nodes = places(&learned.automaton);
    let opposite = nodes.iter().any(|a| {
        nodes
            .iter()
            .any(|b| a.2 != b.2 && a.3 != b.3 && a.0[0] < b.1[0] && b.0[0] < a.1[0])
    });
    assert!(learned.converged && opposite, "{nodes:?}");
    // A policy without memory cannot do both: going back and forth surely earns more than the best of going one way.
    let one_way = |action: usize| {
        let mut automaton = learned.automaton.clone();
        automaton.nodes.truncate(1);
        automaton.nodes[0].action = action;
        automaton
    };
    for action in 0..2 {
        let difference = compare(
            &scenario,
            &learned.automaton.updater,
            &AutomatonRunner::new(&learned.automaton),
            &AutomatonRunner::new(&one_way(action)),
            Options {
                episodes: 300,
                seed: 5,
            },
            &Silent,
        );
        assert!(difference.mean > 10.0 * difference.stderr, "{difference:?}");
    }
}

/// With two actions that do the same, every split is an error. Each of the five runs makes at most a few hundred tests at error rate
/// 0.001 on evidence that a proposal was chosen without; a split must also be worth having, which chance alone does not give.
#[test]
fn nothing_is_split_where_all_actions_are_alike() {
    let mut same = scenario("basic");
    let model = &mut same.model;
    model.actions[1].control = model.actions[0].control.clone();
    model.rewards.retain(|reward| reward.actions.is_none());
    for seed in 1..=5 {
        let learned = learn(
            &same,
            &Settings {
                seed,
                ..Settings::default()
            },
        );
        assert_eq!(learned.automaton.nodes.len(), 1, "seed {seed}");
    }
}

#[test]
fn a_run_is_its_seed() {
    let scenario = scenario("cart-load-unload");
    let [first, again, other] = [3, 3, 4].map(|seed| learn(&scenario, &hurried(seed)));
    assert_eq!(first, again);
    assert_ne!(first.learning.curve, other.learning.curve);
}

/// The learner is told another model's rewards, events and modes than those of the world it acts in, and does not care.
#[test]
fn rewards_and_map_are_learned_and_not_read() {
    let world = scenario("cart-load-unload");
    let mut told = world.model.clone();
    told.rewards = scenario("basic").model.rewards;
    told.events.clear();
    told.modes = vec![String::new()];
    let honest = learn_in(&world, &world.model, &hurried(1), None).unwrap();
    let misled = learn_in(&world, &told, &hurried(1), None).unwrap();
    assert_eq!(honest.learning.curve, misled.learning.curve);
    assert_eq!(places(&honest.automaton), places(&misled.automaton));
}

#[test]
fn an_automaton_runs_from_its_file_as_it_was_learned() {
    let scenario = scenario("cart-load-unload");
    let learned = learn(&scenario, &hurried(2));
    let read = Automaton::from_json(&learned.automaton.to_json().unwrap(), "x").unwrap();
    assert_eq!(read, learned.automaton);
    assert!(read.check_problem(&scenario.model, "x").is_ok());
    assert_eq!(read.modes.len(), 3, "{:?}", read.modes);
}

#[test]
fn the_printed_rules_run_and_make_dust() {
    let scenario = scenario("basic");
    let settings = Settings {
        rules: Rules::Printed,
        ..Settings::default()
    };
    let learned = learn(&scenario, &settings);
    assert!(
        learned.automaton.nodes.len() > 100,
        "{}",
        learned.automaton.nodes.len()
    );
    assert!(!learned.converged);
    assert_eq!(learned, learn(&scenario, &settings));
}

#[test]
fn a_resumed_run_ends_like_one_that_was_never_stopped() {
    let scenario = scenario("cart-load-unload");
    let settings = hurried(5);
    let straight = learn(&scenario, &settings);
    let worlds = || -> Box<dyn World> { Box::new(ProblemWorld::new(&scenario)) };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.json");
    for pieces in [1, 5, 9] {
        let mut run =
            Run::new(kafaq::course(&scenario.model, &worlds, &settings).unwrap()).unwrap();
        for _ in 0..pieces {
            let _ = run.step(&Silent).unwrap();
        }
        run.save(&path).unwrap();
        assert_eq!(
            learn_in(&scenario, &scenario.model, &settings, Some(&path)).unwrap(),
            straight
        );
        std::fs::remove_file(&path).unwrap();
    }
}

/// Set in a child process: the checkpoint it works on.
const CHILD: &str = "PILOTAGE_TEST_CHECKPOINT";

fn lengthy() -> Settings {
    Settings {
        epoch_limit: 40,
        epoch: 10_000,
        ..hurried(6)
    }
}

/// Does nothing unless it is the child of the next test.
#[test]
fn child_that_is_killed() {
    if let Some(path) = std::env::var_os(CHILD) {
        learn_in(
            &scenario("cart-load-unload"),
            &scenario("cart-load-unload").model,
            &lengthy(),
            Some(Path::new(&path)),
        )
        .unwrap();
    }
}

#[test]
fn a_run_survives_being_killed_at_any_moment() {
    let scenario = scenario("cart-load-unload");
    let straight = learn(&scenario, &lengthy());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.json");
    let worlds = || -> Box<dyn World> { Box::new(ProblemWorld::new(&scenario)) };
    let mut killed = 0;
    for round in 0..200_u64 {
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "child_that_is_killed"])
            .env(CHILD, &path)
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        std::thread::sleep(Duration::from_millis(20 + round * 97 % 230));
        let done = child.try_wait().unwrap().is_some();
        if !done {
            child.kill().unwrap();
            killed += 1;
        }
        child.wait().unwrap();
        if path.exists() {
            // Whole, and of this run.
            let course = kafaq::course(&scenario.model, &worlds, &lengthy()).unwrap();
            Run::resume(course, &path).unwrap();
        }
        if done {
            break;
        }
    }
    assert!(killed > 0);
    assert_eq!(
        learn_in(&scenario, &scenario.model, &lengthy(), Some(&path)).unwrap(),
        straight
    );
}

/// A checkpoint after one piece of work.
fn checkpoint(scenario: &Scenario, settings: &Settings, path: &Path) {
    let worlds = || -> Box<dyn World> { Box::new(ProblemWorld::new(scenario)) };
    let mut run = Run::new(kafaq::course(&scenario.model, &worlds, settings).unwrap()).unwrap();
    let _ = run.step(&Silent).unwrap();
    run.save(path).unwrap();
}

fn refusal(scenario: &Scenario, settings: &Settings, path: &Path) -> String {
    let before = std::fs::read(path).unwrap();
    let error = learn_in(scenario, &scenario.model, settings, Some(path))
        .map(drop)
        .unwrap_err();
    assert!(matches!(error, Error::Checkpoint { .. }), "{error}");
    assert_eq!(std::fs::read(path).unwrap(), before, "the file was touched");
    error.to_string()
}

#[test]
fn checkpoints_of_other_runs_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.json");
    let basic = scenario("basic");
    checkpoint(&basic, &hurried(1), &path);
    assert!(
        refusal(&scenario("basic-inner"), &hurried(1), &path)
            .contains("problem basic, not of basic-inner")
    );
    let mut changed = basic.clone();
    changed.model.sensor.noise *= 2.0;
    assert!(refusal(&changed, &hurried(1), &path).contains("has changed"));
    assert!(refusal(&basic, &hurried(2), &path).contains("other settings or another seed"));
    let text = std::fs::read_to_string(&path).unwrap();
    for (good, bad, message) in [
        (
            "\"solver\":\"kafaq\"",
            "\"solver\":\"arkaq\"",
            "solver `arkaq`",
        ),
        ("\"checkpoint\":2", "\"checkpoint\":1", "format 1 of"),
        ("\"checkpoint\":2", "\"checkpoint\":99", "format 99"),
        (
            concat!("\"pilotage\":\"", env!("CARGO_PKG_VERSION")),
            "\"pilotage\":\"99.0.0",
            "pilotage 99.0.0",
        ),
        ("{\"checkpoint\"", "{\"check\"", "not a checkpoint"),
        ("{", "", "not a checkpoint"),
    ] {
        assert!(text.contains(good), "{good}");
        std::fs::write(&path, text.replacen(good, bad, 1)).unwrap();
        let refused = refusal(&basic, &hurried(1), &path);
        assert!(refused.contains(message), "{refused}");
    }
    // The first line as version 0.1.0 wrote it.
    let old = r#"{"checkpoint":1,"pilotage":"0.1.0","solver":"kafaq","problem":"basic","fingerprint":12345,"settings":{},"checksum":678}"#;
    std::fs::write(&path, format!("{old}\n{{}}\n")).unwrap();
    let refused = refusal(&basic, &hurried(1), &path);
    assert!(
        refused.contains("checkpoint format 1 of pilotage 0.1.0")
            && refused.contains("start afresh"),
        "{refused}"
    );
}

#[test]
fn a_damaged_checkpoint_is_refused_whatever_was_damaged() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.json");
    let basic = scenario("basic");
    checkpoint(&basic, &hurried(1), &path);
    let whole = std::fs::read(&path).unwrap();
    let state = whole.iter().position(|&byte| byte == b'\n').unwrap();
    let step = (whole.len() / 60).max(1);
    for length in (0..whole.len())
        .step_by(step)
        .chain([state, state + 1, whole.len() - 1])
    {
        std::fs::write(&path, &whole[..length]).unwrap();
        refusal(&basic, &hurried(1), &path);
    }
    for at in (state + 1..whole.len() - 1).step_by(step) {
        let mut damaged = whole.clone();
        damaged[at] ^= 1;
        std::fs::write(&path, &damaged).unwrap();
        assert!(refusal(&basic, &hurried(1), &path).contains("damaged"));
    }
    std::fs::write(&path, [0xff, 0xfe, 0x00]).unwrap();
    refusal(&basic, &hurried(1), &path);
}

#[test]
fn a_checkpoint_that_cannot_be_written_is_an_error_and_leaves_the_last() {
    let folder = tempfile::tempdir().unwrap();
    let gone = folder.path().join("no/such/folder/run.json");
    let basic = scenario("basic");
    let error = learn_in(&basic, &basic.model, &hurried(1), Some(&gone))
        .map(drop)
        .unwrap_err();
    assert!(matches!(error, Error::Io { .. }), "{error}");
    assert!(error.to_string().contains("run.json"));
}

#[test]
fn settings_out_of_range_are_refused_by_name() {
    type Spoil = fn(&mut Settings);
    let cases: [(&str, Spoil); 32] = [
        ("cell", |s| s.cell = 0.0),
        ("cell", |s| s.cell = f64::NAN),
        ("cell_limit", |s| s.cell_limit = 0),
        ("cell_stride", |s| s.cell_stride = -1.0),
        ("cells_along", |s| s.cells_along = 0),
        ("lambda", |s| s.lambda = 1.1),
        ("lambda", |s| s.lambda = f64::NAN),
        ("rate_power", |s| s.rate_power = 0.5),
        ("rate_power", |s| s.rate_power = 1.1),
        ("rate_floor", |s| s.rate_floor = 1.0),
        ("hot", |s| s.hot = 0.0),
        ("hot", |s| s.hot = f64::INFINITY),
        ("cold", |s| s.cold = 2.0),
        ("cold", |s| s.cold = 0.0),
        ("cooling", |s| s.cooling = 1.0),
        ("explore", |s| s.explore = -0.1),
        ("epoch", |s| s.epoch = 0),
        ("epoch_per_cell", |s| s.epoch_per_cell = 0),
        ("epoch_limit", |s| s.epoch_limit = 0),
        ("still", |s| s.still = 0.0),
        ("calm", |s| s.calm = 0),
        ("window", |s| s.window = 0),
        ("fade", |s| s.fade = 1.0),
        ("rare", |s| s.rare = 1.0),
        ("split_error", |s| s.split_error = 0.5),
        ("merge_error", |s| s.merge_error = 0.0),
        ("worth", |s| s.worth = 1.0),
        ("notable", |s| s.notable = 0.0),
        ("place", |s| s.place = -1.0),
        ("odds", |s| s.odds = vec![0.5, 1.0]),
        ("odds", |s| s.odds.clear()),
        ("trial", |s| s.trial = 1),
    ];
    let basic = scenario("basic");
    for (name, spoil) in cases {
        let mut settings = Settings::default();
        spoil(&mut settings);
        let error = learn_in(&basic, &basic.model, &settings, None)
            .map(drop)
            .unwrap_err();
        assert!(
            matches!(&error, Error::Setting { setting, .. } if *setting == name),
            "{name}: {error}"
        );
    }
}

#[test]
fn models_it_is_not_made_for_are_refused_with_a_reason() {
    let mut unbounded = scenario("basic");
    unbounded.model.state[0].bounds = Interval::ALL;
    for (scenario, reason) in [
        (unbounded, "`state.bounds`"),
        (scenario("load-unload"), "known exactly"),
    ] {
        let error = learn_in(&scenario, &scenario.model, &Settings::default(), None)
            .map(drop)
            .unwrap_err();
        assert!(matches!(error, Error::Unsupported { .. }), "{error}");
        assert!(
            error.to_string().contains(reason),
            "{}: {error}",
            scenario.model.name
        );
    }
    let coarse = Settings {
        cell_limit: 5,
        ..Settings::default()
    };
    let basic = scenario("basic");
    let error = learn_in(&basic, &basic.model, &coarse, None)
        .map(drop)
        .unwrap_err();
    assert!(error.to_string().contains("neighbourhoods"), "{error}");
}

/// Cart and pole: regions lie along the modes of the motion that do not die out by themselves, the fall and the drift.
#[test]
fn a_pole_is_balanced_by_a_few_regions_of_its_own_motion() {
    let scenario = scenario("cart-pole-sd");
    let coarse = Settings {
        cells_along: 32,
        ..Settings::default()
    };
    let learned = learn(&scenario, &coarse);
    assert!(learned.converged);
    let coordinates = learned.automaton.coordinates.as_ref().unwrap();
    for (row, value) in coordinates.rows.iter().zip([1.1177, 1.0]) {
        let row = nalgebra::RowDVector::from_row_slice(row);
        let apart = &row * &scenario.model.motion.a - &row * value;
        assert!(apart.amax() < 1e-4, "{value}: {apart}");
    }
    let options = LifeOptions {
        runs: 2,
        steps: 100_000,
        seed: 3,
    };
    let controller = AutomatonRunner::new(&learned.automaton);
    let life = life(
        &scenario,
        &learned.automaton.updater,
        &controller,
        options,
        &Silent,
    );
    assert_eq!(life.failures(), 0, "{life:?}");
    let json = learned.automaton.to_json().unwrap();
    let read = Automaton::from_json(&json, "x").unwrap();
    assert_eq!(read, learned.automaton);
    assert!(json.contains("\"mode 1.118\""), "{json}");
}
