//! docs/policy-format.md is enough to run a policy: the program that was written from it alone does what the library does.
//!
//! Where there is no Python 3 the comparisons say so and are left out.
#![allow(clippy::print_stdout, clippy::unwrap_used)]

mod common;

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use common::automata::{any_automaton, sealed};
use common::scenario;
use pilotage::belief::Reading;
use pilotage::model::Then;
use pilotage::policy::{Automaton, AutomatonRunner, GraphRunner, Saved};
use pilotage::progress::Silent;
use pilotage::random::{Role, normal, stream};
use pilotage::scenario::Scenario;
use pilotage::solve::{Arkaq, Form, Kafaq, PolicySearch, Registry, Request, Solver, solve};
use pilotage::world::{Observation, ProblemWorld, Streams, World};
use proptest::prelude::*;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn page() -> String {
    std::fs::read_to_string(root().join("docs/policy-format.md")).unwrap()
}

/// The block of the page that begins with so many backticks and this word.
fn block(page: &str, word: &str) -> String {
    let (_, rest) = page.split_once(&format!("```{word}\n")).unwrap();
    rest.split_once("```").unwrap().0.to_owned()
}

/// A step of a runner: belief, node and action.
#[derive(Debug, PartialEq)]
struct Row {
    level: usize,
    mode: usize,
    mean: Vec<f64>,
    node: usize,
    action: String,
}

/// What follows a step.
#[derive(Debug, Clone, PartialEq)]
enum Event {
    Sensed(Vec<f64>),
    /// The reading is missing.
    Silence,
    /// A new episode.
    Start,
}

/// The rows of the library's own runner.
fn run(automaton: &Automaton, events: &[Event]) -> Vec<Row> {
    let mut controller = AutomatonRunner::new(automaton);
    let row = |controller: &AutomatonRunner| {
        let (belief, (node, action)) = (controller.belief(), controller.decide());
        let row = Row {
            level: belief.stratum,
            mode: belief.mode,
            mean: belief.mean.clone(),
            node,
            action: automaton.actions[action].clone(),
        };
        (row, action)
    };
    let (first, mut action) = row(&controller);
    let mut rows = vec![first];
    for event in events {
        match event {
            Event::Sensed(reading) => controller.observe(action, reading),
            Event::Silence => controller.observe(action, Reading::Nothing),
            Event::Start => controller.reset(),
        }
        let (next, decided) = row(&controller);
        rows.push(next);
        action = decided;
    }
    rows
}

/// What the page's runner makes of a policy file and lines of input; `None` where there is no Python 3.
fn run_script(file: &str, input: String) -> Option<String> {
    let version = Command::new("python3").arg("--version").output();
    if !version.is_ok_and(|version| version.status.success()) {
        println!("left out: there is no python3 here");
        return None;
    }
    let folder = tempfile::tempdir().unwrap();
    let policy = folder.path().join("policy.json");
    std::fs::write(&policy, file).unwrap();
    let mut child = Command::new("python3")
        .arg("-B")
        .arg(root().join("scripts/run_policy.py"))
        .arg(&policy)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stdin = child.stdin.take().unwrap();
    let writer = std::thread::spawn(move || stdin.write_all(input.as_bytes()));
    let output = child.wait_with_output().unwrap();
    writer.join().unwrap().unwrap();
    assert!(output.status.success());
    Some(String::from_utf8(output.stdout).unwrap())
}

/// The text of the page's runner for an automaton.
fn run_page(automaton: &Automaton, events: &[Event]) -> Option<String> {
    let mut readings = String::new();
    for event in events {
        let line = match event {
            Event::Sensed(reading) => {
                let numbers: Vec<String> = reading.iter().map(f64::to_string).collect();
                numbers.join(",")
            }
            Event::Silence => "nothing".to_owned(),
            Event::Start => "start".to_owned(),
        };
        readings.push_str(&line);
        readings.push('\n');
    }
    run_script(&automaton.to_json().unwrap(), readings)
}

fn rows(csv: &str, states: usize) -> Vec<Row> {
    let row = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        let index = |cell: &str| cell.parse().unwrap();
        let (mean, rest) = cells[3..].split_at(states);
        Row {
            level: index(cells[1]),
            mode: index(cells[2]),
            mean: mean.iter().map(|x| x.parse().unwrap()).collect(),
            node: index(rest[0]),
            action: rest[1].to_owned(),
        }
    };
    csv.lines().skip(1).map(row).collect()
}

/// The same nodes and actions at every step, means equal to 1e-12.
fn compare(automaton: &Automaton, events: &[Event]) {
    let library = run(automaton, events);
    let Some(csv) = run_page(automaton, events) else {
        return;
    };
    let page = rows(&csv, automaton.states.len());
    assert_eq!(library.len(), page.len());
    for (step, (ours, theirs)) in library.iter().zip(&page).enumerate() {
        let apart = ours.mean.iter().zip(&theirs.mean);
        let apart = apart.map(|(a, b)| (a - b).abs() / a.abs().max(1.0));
        assert!(
            apart.fold(0.0, f64::max) <= 1e-12
                && (ours.level, ours.mode, ours.node) == (theirs.level, theirs.mode, theirs.node)
                && ours.action == theirs.action,
            "{} by {}, step {step}: {ours:?}, and by the page {theirs:?}",
            automaton.problem,
            automaton.solver
        );
    }
}

/// What the world of a scenario lets an automaton sense in so many steps, of which every seventh reading is lost on the way.
fn events(scenario: &Scenario, automaton: &Automaton, steps: usize) -> Vec<Event> {
    let mut world = ProblemWorld::new(scenario);
    let mut controller = AutomatonRunner::new(automaton);
    let mut draws = Streams::new(4, 0);
    let mut observation = Observation::new(automaton.updater.readings());
    world.reset(&mut draws);
    let mut events = Vec::new();
    let mut age = 0;
    for _ in 0..steps {
        let (_, action) = controller.decide();
        let step = world.step(action, &mut draws, &mut observation);
        age += 1;
        let over = step.then == Then::End || age == 40;
        if over {
            world.reset(&mut draws);
            age = 0;
        }
        if over || step.then == Then::Restart {
            controller.reset();
            events.push(Event::Start);
        } else {
            if events.len() % 7 == 6 {
                observation.silence();
            }
            controller.observe(action, observation.reading());
            let sensed = observation.reading().values();
            events.push(sensed.map_or(Event::Silence, |values| Event::Sensed(values.to_vec())));
        }
    }
    events
}

fn solver(name: &str) -> Solver {
    match name {
        "kafaq" => Solver::learner(Kafaq {
            epoch: 1_000,
            epoch_per_cell: 2,
            epoch_limit: 6,
            trial: 20,
            cells_along: 32,
            ..Default::default()
        }),
        "arkaq" => Solver::learner(Arkaq {
            vigilances: vec![0.6],
            epoch: 500,
            epoch_per_entry: 1,
            epoch_limit: 4,
            settle: 300,
            trial: 10,
            ..Default::default()
        }),
        "policy-search" => Solver::planner(PolicySearch {
            effort: 0.01,
            ..Default::default()
        }),
        other => Registry::builtin()
            .find(other)
            .unwrap()
            .solver(&[])
            .unwrap(),
    }
}

fn solved(scenario: &Scenario, name: &str, form: Form) -> Automaton {
    let request = Request {
        runs: 50,
        ..Request::form(form)
    };
    let solution = solve(&solver(name), scenario, &request, &Silent).unwrap();
    solution.automaton().unwrap().clone()
}

/// The corridor with an action that does not disturb the state: two noise classes.
fn still() -> Scenario {
    let mut scenario = scenario("corridor-blind");
    let noise = &scenario.model.motion.noise * 0.0;
    scenario.model.actions[2].motion_noise = Some(noise);
    scenario
}

/// A hallway whose gate opens at step 6, whose floor moves from step 9 on, and whose sensor falls silent now and then.
fn changing() -> Scenario {
    let later = r#"
[[later]]
from = 9
motion = { A = [[0.9]], B = [[1.5]] }
sensor = { H = [[2.0]], present = 1.0 }
[[event]]
action = "STAY"
mode = "outside"
in = { x = [3.0, 10.0] }
steps = { from = 6, until = 30 }
becomes = "inside"
[belief]
level_limit = 20
[[reward]]
mode = "inside"
"#;
    common::hallway(&[
        ("bounds =", "modes = [\"outside\", \"inside\"]\nbounds ="),
        ("noise = [[0.4]]", "noise = [[0.4]]\npresent = 0.8"),
        ("\n[[reward]]\nin = { x = [6.0, 7.0] }\n", later),
    ])
}

/// One of everything that a file can say, found on the way.
#[test]
fn the_page_runs_policies_as_the_library_does() {
    use Form::{Nearest, Segments};
    let mut said = [false; 11];
    for (scenario, kind, form) in [
        (scenario("corridor-blind"), "value-iteration", Nearest),
        (scenario("corridor-declare"), "value-iteration", Segments),
        (still(), "value-iteration", Nearest),
        (changing(), "value-iteration", Nearest),
        (scenario("tiger"), "value-iteration", Nearest),
        (scenario("load-unload"), "value-iteration", Nearest),
        (scenario("shuttle-blind"), "value-iteration", Segments),
        (scenario("maze-2d"), "value-iteration", Nearest),
        (scenario("u-maze"), "value-iteration", Segments),
        (scenario("cart-pole"), "policy-search", Nearest),
        (scenario("cart-load-unload"), "kafaq", Segments),
        (scenario("cart-load-unload"), "arkaq", Nearest),
        (scenario("cart-pole-sd"), "kafaq", Segments),
    ] {
        let automaton = solved(&scenario, kind, form);
        compare(&automaton, &events(&scenario, &automaton, 400));
        let file: serde_json::Value = serde_json::from_str(&automaton.to_json().unwrap()).unwrap();
        let policy = &file["policy"];
        for (said, says) in said.iter_mut().zip([
            policy["matching"] == "segments",
            policy["coordinates"].is_array(),
            policy["memory"]["switches"].is_array(),
            policy["memory"]["recall"].is_object(),
            policy["filter"]["walls"]["bounds"].is_array(),
            policy["filter"]["walls"]["map"]["rows"].is_array(),
            policy["scale"]
                .as_array()
                .unwrap()
                .iter()
                .any(|s| *s != 1.0),
            policy["filter"]["classes"]
                .as_array()
                .unwrap()
                .iter()
                .any(|c| *c != 0),
            policy["filter"]["later"].is_array(),
            policy["filter"]["levels"]
                .as_array()
                .unwrap()
                .iter()
                .any(|level| level["time"] == 9),
            policy["memory"]["switches"][0]["steps"] == serde_json::json!([6, 30]),
        ]) {
            *said |= says;
        }
    }
    assert_eq!(said, [true; 11]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    /// Automata that nobody would make, on readings from everywhere: walls on the way, levels and modes without nodes, means far away.
    #[test]
    fn the_page_runs_any_automaton_as_the_library_does(
        automaton in any_automaton(-5.0..5.0_f64, 1..20),
        seed in any::<u64>(),
    ) {
        let mut rng = stream(seed, 0, Role::Sensor);
        let events: Vec<Event> = (0..200)
            .map(|step| {
                let spread = if step % 9 == 0 { 1e3 } else { 1.5 };
                let reading = (0..automaton.updater.readings()).map(|_| 1.0 + spread * normal(&mut rng));
                match step % 50 {
                    49 => Event::Start,
                    7 | 31 => Event::Silence,
                    _ => Event::Sensed(reading.collect()),
                }
            })
            .collect();
        compare(&automaton, &events);
    }
}

/// The example of the page is a policy, and does what the page says.
#[test]
fn the_example_of_the_page_is_true() {
    let page = page();
    let automaton = Automaton::from_json(&block(&page, "json"), "docs/policy-format.md").unwrap();
    let events = [2.0, 3.0, 2.5].map(|reading| Event::Sensed(vec![reading]));
    let says = block(&page, "csv");
    assert_eq!(rows(&says, 1), run(&automaton, &events));
    if let Some(csv) = run_page(&automaton, &events) {
        assert_eq!(says, csv);
    }
}

/// The graph of the page is one, and the page's runner goes through it as the library does.
#[test]
fn the_page_runs_graphs_as_the_library_does() {
    let page = page();
    let policy = block(page.split("### A policy graph").nth(1).unwrap(), "json");
    let policy: serde_json::Value = serde_json::from_str(&policy).unwrap();
    let file = sealed(serde_json::json!({
        "format": 2, "pilotage": "0.2.0", "checksum": "", "policy": policy
    }));
    let Saved::Graph(graph) = Saved::from_json(&file, "docs/policy-format.md").unwrap() else {
        panic!("the page's graph is none");
    };
    let words = "left nothing right left start left nothing right right left";
    let mut runner = GraphRunner::new(&graph);
    let mut says = "step,node,action\n".to_owned();
    for (step, word) in ["start"].into_iter().chain(words.split(' ')).enumerate() {
        let signal = graph.signals.iter().position(|signal| signal == word);
        match (word, signal) {
            ("start", _) => runner.reset(),
            (_, Some(signal)) => runner.observe(Reading::Symbol(signal as u32)),
            (_, None) => runner.observe(Reading::Nothing),
        }
        let (node, action) = runner.decide();
        says += &format!("{step},{node},{}\n", graph.actions[action]);
    }
    if let Some(csv) = run_script(&file, words.replace(' ', "\n") + "\n") {
        assert_eq!(says, csv);
    }
}

/// Every key of the format is explained by the page.
#[test]
fn the_page_names_every_key() {
    fn keys(schema: &serde_json::Value, found: &mut Vec<String>) {
        match schema {
            serde_json::Value::Object(object) => {
                if let Some(serde_json::Value::Object(properties)) = object.get("properties") {
                    found.extend(properties.keys().cloned());
                }
                object.values().for_each(|value| keys(value, found));
            }
            serde_json::Value::Array(list) => list.iter().for_each(|value| keys(value, found)),
            _ => {}
        }
    }
    let page = page();
    let mut found = Vec::new();
    keys(pilotage::policy::schema().as_value(), &mut found);
    for key in found {
        assert!(page.contains(&key), "{key}");
    }
}
