//! The program as a person meets it: what it prints, what it refuses, what it leaves behind.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::Path;

use assert_cmd::Command;
use assert_cmd::cargo::cargo_bin_cmd;
use serde_json::Value;

fn pilotage(arguments: &[&str]) -> Command {
    let mut command = cargo_bin_cmd!("pilotage");
    command.args(arguments);
    command
}

fn printed(arguments: &[&str]) -> String {
    let output = pilotage(arguments).assert().success().get_output().clone();
    assert!(output.stderr.is_empty(), "{arguments:?} writes to stderr");
    String::from_utf8(output.stdout).unwrap()
}

/// What a command that must fail says; it prints nothing on standard output.
fn refused(arguments: &[&str]) -> String {
    let output = pilotage(arguments).assert().failure().get_output().clone();
    assert!(output.stdout.is_empty(), "{arguments:?} prints a result");
    String::from_utf8(output.stderr).unwrap()
}

/// The JSON a command prints, the seconds apart, as text.
fn json(arguments: &[&str]) -> String {
    let text = printed(arguments);
    assert_eq!(text.lines().count(), 1, "{text}");
    let mut object: Value = serde_json::from_str(&text).unwrap();
    let seconds = object.as_object_mut().unwrap().remove("seconds");
    assert!(seconds.is_some(), "{text}");
    object.to_string()
}

#[test]
fn a_seed_gives_the_same_bytes_with_one_thread_and_with_many() {
    for problem in ["corridor-blind", "corridor-declare", "tiger"] {
        for (solver, settings) in [
            ("value-iteration", "points=201"),
            ("kbvi", "last_horizon=5"),
            ("qmdp", "points=201"),
        ] {
            let with = |threads: &str, seed: &str| {
                json(&[
                    "solve",
                    problem,
                    "--with",
                    solver,
                    "--set",
                    settings,
                    "--episodes",
                    "3000",
                    "--seed",
                    seed,
                    "--threads",
                    threads,
                    "--json",
                ])
            };
            let one = with("1", "7");
            assert_eq!(one, with("4", "7"), "{problem} with {solver}");
            assert_ne!(one, with("4", "8"), "{problem} with {solver}");
        }
    }
}

#[test]
fn a_saved_policy_earns_what_it_earned_when_it_was_found() {
    let folder = tempfile::tempdir().unwrap();
    let policy = folder.path().join("policy.json");
    let policy = policy.to_str().unwrap();
    let found: Value = serde_json::from_str(&json(&[
        "solve",
        "corridor-blind",
        "--episodes",
        "2000",
        "--seed",
        "7",
        "--out",
        policy,
        "--json",
    ]))
    .unwrap();
    let run: Value = serde_json::from_str(&json(&[
        "simulate",
        "corridor-blind",
        "--policy",
        policy,
        "--episodes",
        "2000",
        "--seed",
        "7",
        "--json",
    ]))
    .unwrap();
    for key in ["evaluation", "nodes", "planned_value", "problem", "solver"] {
        assert_eq!(found[key], run[key], "{key}");
    }
}

#[test]
fn compiling_the_corridor_loses_nothing() {
    let text = printed(&[
        "solve",
        "corridor-declare",
        "--episodes",
        "4000",
        "--value-lost",
        "--json",
    ]);
    let report: Value = serde_json::from_str(&text).unwrap();
    let (lost, error) = (
        &report["value_lost"]["mean"],
        &report["value_lost"]["stderr"],
    );
    // Paired: most episodes are the same. Three standard errors: one seed in 370 would fail by chance.
    assert!(error.as_f64().unwrap() < 0.05, "{text}");
    assert!(
        lost.as_f64().unwrap() <= 3.0 * error.as_f64().unwrap(),
        "{text}"
    );
}

#[test]
fn drawing_writes_an_automaton_and_a_map() {
    let folder = tempfile::tempdir().unwrap();
    let policy = folder.path().join("p.json");
    let policy = policy.to_str().unwrap();
    printed(&["solve", "tiger", "--episodes", "100", "--out", policy]);
    printed(&["draw", policy]);
    for drawing in ["p-automaton.svg", "p-map.svg"] {
        let text = fs::read_to_string(folder.path().join(drawing)).unwrap();
        assert!(
            text.starts_with("<svg") && text.trim_end().ends_with("</svg>"),
            "{drawing}"
        );
        assert!(text.contains("LISTEN"), "{drawing}");
    }
}

#[test]
fn output_that_people_read_stays_as_it_is() {
    insta::assert_snapshot!("list", printed(&["list"]));
    insta::assert_snapshot!("check", printed(&["check", "corridor-blind"]));
    let solved = printed(&[
        "solve",
        "corridor-declare",
        "--episodes",
        "1000",
        "--seed",
        "7",
    ]);
    let timeless: Vec<&str> = solved
        .lines()
        .filter(|line| !line.contains(" s to solve"))
        .collect();
    insta::assert_snapshot!("solve", timeless.join("\n"));
}

#[test]
fn every_verb_explains_itself() {
    for verb in ["list", "check", "solve", "simulate", "draw", "reproduce"] {
        assert!(
            printed(&[verb, "--help"]).contains("Usage: pilotage"),
            "{verb}"
        );
    }
}

/// A model file with `wrong` in the place of `right`.
fn spoilt(folder: &Path, right: &str, wrong: &str) -> String {
    let text = pilotage_model("corridor.toml");
    assert!(text.contains(right), "{right}");
    let path = folder.join("spoilt.toml");
    fs::write(&path, text.replacen(right, wrong, 1)).unwrap();
    path.to_str().unwrap().to_owned()
}

fn pilotage_model(file: &str) -> String {
    let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("../pilotage/models");
    fs::read_to_string(models.join(file)).unwrap()
}

#[test]
fn a_bad_model_is_one_message_with_place_and_hint_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("policy.json");
    for (right, wrong, says) in [
        ("discount = ", "discout = ", "discount"),
        ("discount = 0.75", "discount = 1.5", "discount"),
        ("A = [[1.0]]", "A = [[1.0, 2.0]]", "A"),
        ("noise = [[0.25]]", "noise = [[-0.25]]", "semi-definite"),
        ("covariance = [[0.30]]", "covariance = [[nan]]", "finite"),
        (
            "in = { x = [3.0, 4.0] }",
            "in = { x = [4.0, 3.0] }",
            "region",
        ),
    ] {
        let file = spoilt(folder.path(), right, wrong);
        for verb in [
            vec!["check", &file],
            vec!["solve", &file, "--out", out.to_str().unwrap()],
            vec!["solve", &file, "--json"],
        ] {
            let message = refused(&verb);
            assert_eq!(message.matches("error:").count(), 1, "{message}");
            assert!(message.contains("spoilt.toml:"), "{message}");
            assert!(message.contains("help:"), "{message}");
            assert!(message.contains(says), "{wrong}: {message}");
            assert!(!out.exists(), "{message}");
        }
    }
}

#[test]
fn what_cannot_be_done_is_one_message() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    fs::write(at("bytes.toml"), [0xff, 0xfe, 0x00]).unwrap();
    fs::write(at("broken.json"), "{\"format\":").unwrap();
    printed(&[
        "solve",
        "tiger",
        "--episodes",
        "10",
        "--out",
        &at("tiger.json"),
    ]);
    let cells = at("cells.json");
    printed(&[
        "solve",
        "light-dark-binary",
        "--set",
        "beliefs=2",
        "--set",
        "rounds=1",
        "--runs",
        "5",
        "--nodes",
        "2",
        "--episodes",
        "5",
        "--out",
        &cells,
    ]);
    let rows: &[(&[&str], &str)] = &[
        (&["check", &at("missing.toml")], "missing.toml"),
        (&["check", &at("bytes.toml")], "bytes.toml"),
        (&["solve", "coridor"], "did you mean `corridor`?"),
        (
            &["solve", "corridor-blind", "--with", "value-iterat"],
            "did you mean `value-iteration`?",
        ),
        (
            &["solve", "corridor-blind", "--policy", "segment"],
            "did you mean `segments`?",
        ),
        (
            &[
                "solve",
                "corridor-blind",
                "--policy",
                "grid",
                "--out",
                &at("p.json"),
            ],
            "cannot be saved",
        ),
        (
            &["solve", "corridor-blind", "--episodes", "0"],
            "at least 1",
        ),
        (
            &["solve", "corridor-blind", "--with", "kafaq", "--grid", "41"],
            "--grid is for --with value-iteration or --with qmdp or --with mls or --with codebook; kafaq has the settings `",
        ),
        (
            &["solve", "corridor-blind", "--set", "lambda=0.5"],
            "lambda is for --with kafaq or --with arkaq; value-iteration has the settings `memory`, `points`",
        ),
        (
            &["solve", "corridor-blind", "--set", "point=41"],
            "did you mean `points`?",
        ),
        (
            &[
                "solve",
                "corridor-blind",
                "--effort",
                "nan",
                "--with",
                "policy-search",
            ],
            "--effort NaN is no value of it",
        ),
        (
            &[
                "solve",
                "scalar-lqg",
                "--with",
                "lqg",
                "--out",
                &at("control.json"),
            ],
            "lqg finds a free control for scalar-lqg",
        ),
        (
            &[
                "solve",
                "scalar-lqg",
                "--with",
                "lqg",
                "--checkpoint",
                &at("c.json"),
            ],
            "--checkpoint and --curves are for learners",
        ),
        (
            &["solve", "corridor-blind", "--with", "lqg"],
            "lqg does not accept corridor",
        ),
        (
            &["solve", "maze-2d", "--grid", "2000", "--memory", "16"],
            "MiB",
        ),
        (
            &["simulate", "corridor-blind", "--policy", &at("tiger.json")],
            "tiger",
        ),
        (
            &["simulate", "corridor-blind", "--policy", &at("broken.json")],
            "broken.json",
        ),
        (
            &[
                "simulate",
                "tiger",
                "--policy",
                &at("tiger.json"),
                "--wake-up",
            ],
            "start",
        ),
        (
            &[
                "simulate",
                "light-dark-binary",
                "--policy",
                &cells,
                "--wake-up",
            ],
            "without --wake-up",
        ),
        (&["draw", &at("missing.json")], "missing.json"),
    ];
    for (arguments, says) in rows {
        let message = refused(arguments);
        assert_eq!(
            message.matches("error:").count(),
            1,
            "{arguments:?}: {message}"
        );
        assert!(message.contains(says), "{arguments:?}: {message}");
        assert!(!message.contains("panicked"), "{message}");
    }
    for file in ["p.json", "control.json", "c.json"] {
        assert!(!Path::new(&at(file)).exists(), "{file}");
    }
}

#[test]
fn a_reader_that_goes_away_is_not_an_error() {
    let mut child = std::process::Command::new(assert_cmd::cargo::cargo_bin!("pilotage"))
        .args(["check", "--schema"])
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success());
    assert!(output.stderr.is_empty());
}

/// The file the README shows is a model, and the commands below it work.
#[test]
fn the_model_of_the_readme_can_be_solved() {
    let readme =
        fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../README.md")).unwrap();
    let (_, rest) = readme.split_once("```toml\n").unwrap();
    let (model, _) = rest.split_once("```").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("hallway.toml");
    let policy = folder.path().join("policy.json");
    fs::write(&file, model).unwrap();
    let (file, policy) = (file.to_str().unwrap(), policy.to_str().unwrap());
    printed(&["check", file]);
    printed(&["solve", file, "--episodes", "100", "--out", policy]);
    printed(&["draw", policy, "--problem", file]);
}

/// A policy graph is solved for, kept, run and drawn like any other policy, and where there is none it is said what would do.
#[test]
fn a_policy_graph_goes_the_whole_way() {
    let folder = tempfile::tempdir().unwrap();
    let policy = folder.path().join("graph.json");
    let policy = policy.to_str().unwrap();
    let solve = [
        "solve",
        "light-dark-binary",
        "--policy",
        "graph",
        "--nodes",
        "8",
        "--set",
        "beliefs=150",
        "--set",
        "rounds=3",
        "--episodes",
        "300",
    ];
    let shown = printed(&[&solve[..], &["--out", policy]].concat());
    for part in [
        "solved with point-based",
        "on bright go to ",
        "planned",
        "rule of thumb",
    ] {
        assert!(shown.contains(part), "{shown}");
    }
    let told: Value = serde_json::from_str(&json(&[&solve[..], &["--json"]].concat())).unwrap();
    assert_eq!(told["policy"], "graph");
    assert!(told["nodes"].as_u64().unwrap() <= 8);

    let simulate = ["simulate", "light-dark-binary", "--policy", policy];
    let again = json(&[&simulate[..], &["--episodes", "300", "--json"]].concat());
    let again: Value = serde_json::from_str(&again).unwrap();
    assert_eq!(again["policy"], "graph");
    assert_eq!(again["evaluation"], told["evaluation"]);
    assert_eq!(again["planned_value"], told["planned_value"]);
    let lost = refused(&[&simulate[..], &["--wake-up"]].concat());
    assert!(lost.contains("keeps no belief"), "{lost}");
    let elsewhere = refused(&[&simulate[..], &["--world", "light-dark-5"]].concat());
    assert!(
        elsewhere.contains("choose a world with the same"),
        "{elsewhere}"
    );

    let drawn = printed(&["draw", policy]);
    assert!(drawn.trim_end().ends_with("graph-graph.svg"), "{drawn}");
    let drawn = fs::read_to_string(drawn.trim_end()).unwrap();
    assert!(drawn.contains("Policy graph of light-dark-binary"));

    let continuous = refused(&["solve", "light-dark-5", "--policy", "graph"]);
    for part in ["needs a discrete sensor", "such as tree"] {
        assert!(continuous.contains(part), "{continuous}");
    }
    let other = refused(&[
        "solve",
        "light-dark-binary",
        "--with",
        "codebook",
        "--policy",
        "graph",
    ]);
    assert!(other.contains("use point-based"), "{other}");
    let size = refused(&["solve", "corridor", "--policy", "grid", "--nodes", "3"]);
    assert!(size.contains("choose --policy tree or graph"), "{size}");
}
