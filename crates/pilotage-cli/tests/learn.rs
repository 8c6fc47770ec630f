//! `pilotage solve --with kafaq`: watched, stopped, resumed, drawn, and told wrong things.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::Duration;

use serde_json::Value;

fn pilotage(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pilotage"));
    command.current_dir(folder).args(arguments);
    command
}

fn run(folder: &Path, arguments: &[&str]) -> Output {
    pilotage(folder, arguments).output().unwrap()
}

fn refusal(folder: &Path, arguments: &[&str]) -> String {
    let output = run(folder, arguments);
    let text = String::from_utf8(output.stderr).unwrap();
    assert!(
        !output.status.success() && output.stdout.is_empty(),
        "{text}"
    );
    assert!(!text.contains("panicked"), "{text}");
    text
}

/// The object that a command prints, without its times.
fn result(output: &Output) -> Value {
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let mut result: Value = serde_json::from_slice(&output.stdout).unwrap();
    result.as_object_mut().unwrap().remove("seconds").unwrap();
    result
}

/// A run of a second or two.
const LENGTHY: [&str; 15] = [
    "solve",
    "cart-load-unload",
    "--with",
    "kafaq",
    "--json",
    "--episodes",
    "50",
    "--seed",
    "6",
    "--threads",
    "1",
    "--learn",
    "epoch=20000",
    "--learn",
    "epoch_limit=40",
];

#[test]
fn a_run_killed_again_and_again_ends_like_one_that_was_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let straight = run(
        folder.path(),
        &[&LENGTHY[..], &["--out", "straight.json"]].concat(),
    );
    let resumable = [
        &LENGTHY[..],
        &["--checkpoint", "run.json", "--out", "resumed.json"],
    ]
    .concat();
    let mut killed = 0;
    for round in 0..40_u64 {
        let mut child = pilotage(folder.path(), &resumable)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        // Moments from before the first checkpoint to well into a run, none of them a multiple of an epoch.
        std::thread::sleep(Duration::from_millis(7 + round * 61 % 173));
        if child.try_wait().unwrap().is_none() {
            // On Unix this is SIGKILL.
            child.kill().unwrap();
            killed += 1;
        }
        let ended = child.wait().unwrap();
        if ended.success() {
            break;
        }
        for entry in std::fs::read_dir(folder.path()).unwrap() {
            let name = entry.unwrap().file_name().into_string().unwrap();
            assert_ne!(name, "resumed.json", "written before the end");
        }
    }
    assert!(killed >= 3, "killed {killed} times only");
    let resumed = run(folder.path(), &resumable);
    assert_eq!(result(&resumed), result(&straight));
    let policy = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    assert_eq!(policy("resumed.json"), policy("straight.json"));
}

#[test]
fn what_was_learned_is_kept_run_and_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let solved = result(&run(
        here,
        &[
            "solve",
            "cart-load-unload",
            "--with",
            "kafaq",
            "--json",
            "--episodes",
            "200",
            "--out",
            "cart.json",
            "--curves",
            "cart.svg",
        ],
    ));
    assert_eq!(solved["converged"], true, "{solved}");
    assert_eq!(solved["policy"], "segments");
    assert!(solved["samples"].as_u64().unwrap() > 10_000);
    let lines = |file: &str, names: &[&str]| {
        let picture = std::fs::read_to_string(here.join(file)).unwrap();
        for name in names {
            assert!(picture.contains(name), "{file}: {name}");
        }
    };
    lines(
        "cart-returns.svg",
        &[
            "reward a step",
            "not adopted",
            "the place of the last event",
        ],
    );
    lines(
        "cart-values.svg",
        &["EAST at", "WEST at", "steps of experience"],
    );
    let simulated = result(&run(
        here,
        &[
            "simulate",
            "cart-load-unload",
            "--policy",
            "cart.json",
            "--json",
            "--episodes",
            "200",
        ],
    ));
    assert_eq!(simulated["evaluation"], solved["evaluation"]);
    let policy: Value =
        serde_json::from_slice(&std::fs::read(here.join("cart.json")).unwrap()).unwrap();
    let nodes = policy["policy"]["nodes"].as_array().unwrap();
    let visits: f64 = nodes
        .iter()
        .map(|node| node["visits"].as_f64().unwrap())
        .sum();
    assert!((visits - 1.0).abs() < 1e-9, "{visits}");
    assert!(run(here, &["draw", "cart.json"]).status.success());
    lines("cart-automaton.svg", &["EAST", "WEST"]);
    lines("cart-map.svg", &["after ("]);
}

#[test]
fn what_was_learned_acts_in_another_world_that_has_the_same_actions() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    result(&run(
        here,
        &[
            "solve",
            "basic",
            "--with",
            "kafaq",
            "--json",
            "--episodes",
            "20",
            "--out",
            "basic.json",
        ],
    ));
    let simulate = |extra: &[&'static str]| {
        let common = ["simulate", "basic", "--policy", "basic.json", "--json"];
        [&common[..], &["--episodes", "100"], extra].concat()
    };
    let at_home = result(&run(here, &simulate(&[])));
    let on_robot = result(&run(here, &simulate(&["--world", "robot-basic"])));
    assert_eq!(on_robot["problem"], "basic");
    assert_eq!(on_robot["world"], "robot-basic");
    assert_ne!(on_robot["evaluation"], at_home["evaluation"]);
    let refused = refusal(here, &simulate(&["--world", "maze-4x4"]));
    assert!(refused.contains("NORTH"), "{refused}");
    // The robot's file is another problem, and a policy is for one.
    let refused = refusal(here, &["simulate", "robot-basic", "--policy", "basic.json"]);
    assert!(refused.contains("not for robot-basic"), "{refused}");
}

#[test]
fn wrong_settings_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let cases = [
        ("lambda=2", "lambda = 2 is out of range: 0 to 1"),
        ("lamda=0.5", "did you mean `lambda`?"),
        ("cold=0", "cold = 0 is out of range"),
        ("rate_power=0.1", "rate_power = 0.1 is out of range"),
        ("split_error=0.7", "split_error = 0.7 is out of range"),
        ("cell_limit=0", "cell_limit = 0 is out of range: at least 1"),
        ("epoch_limit=-3", "epoch_limit = -3 is no value of it: "),
        ("hot=warm", "hot = warm is no value of it: "),
        ("rules=strict", "rules = strict is no value of it: "),
        ("lambda", "`lambda` is not KEY=VALUE"),
        ("seed=3", "--seed"),
    ];
    for (setting, message) in cases {
        let refused = refusal(
            folder.path(),
            &["solve", "basic", "--with", "kafaq", "--learn", setting],
        );
        assert!(refused.contains(message), "{setting}: {refused}");
    }
    let refused = refusal(folder.path(), &["solve", "basic", "--learn", "lambda=0.5"]);
    assert!(refused.contains("--with kafaq"), "{refused}");
    let refused = refusal(folder.path(), &["solve", "load-unload", "--with", "kafaq"]);
    assert!(refused.contains("add noise"), "{refused}");
}

/// Solves `basic` shortly with a checkpoint.
fn short(folder: &Path, extra: &[&str]) -> Command {
    let common = [
        "solve",
        "basic",
        "--with",
        "kafaq",
        "--json",
        "--episodes",
        "20",
        "--learn",
        "epoch_limit=3",
        "--learn",
        "trial=20",
        "--checkpoint",
        "run.json",
    ];
    pilotage(folder, &[&common[..], extra].concat())
}

#[test]
fn checkpoints_that_do_not_fit_are_refused_and_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.json");
    result(&short(folder.path(), &[]).output().unwrap());
    let whole = std::fs::read(&path).unwrap();
    let text = String::from_utf8(whole.clone()).unwrap();
    let checks = [
        (text.clone(), vec!["--seed", "9"], "another seed"),
        (
            text.clone(),
            vec!["--learn", "lambda=0.5"],
            "other settings",
        ),
        (
            text.replacen("\"basic\"", "\"maze-4x4\"", 1),
            vec![],
            "of the problem maze-4x4, not of basic",
        ),
        (
            text.replacen("\"kafaq\"", "\"arkaq\"", 1),
            vec![],
            "solver `arkaq`",
        ),
        (
            text.replacen(env!("CARGO_PKG_VERSION"), "99.0.0", 1),
            vec![],
            "pilotage 99.0.0",
        ),
        (
            text[..text.len() / 2].to_owned(),
            vec![],
            "damaged checkpoint",
        ),
        (
            text.replacen("\"samples\":", "\"samples\":1", 1),
            vec![],
            "checksum",
        ),
        (String::new(), vec![], "damaged checkpoint"),
        ("[1, 2]\n3\n".to_owned(), vec![], "not a checkpoint"),
    ];
    for (content, extra, message) in checks {
        std::fs::write(&path, &content).unwrap();
        let output = short(folder.path(), &extra).output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(
            !output.status.success() && said.contains(message),
            "{message}: {said}"
        );
        assert!(said.contains("run.json"), "{said}");
        assert_eq!(std::fs::read_to_string(&path).unwrap(), content, "touched");
    }
    std::fs::write(&path, whole).unwrap();
    result(&short(folder.path(), &[]).output().unwrap());
}

/// With a limit on the size of files, writing stops in the middle, as on a full disk.
#[cfg(unix)]
#[test]
fn a_full_disk_is_an_error_that_leaves_the_last_good_checkpoint() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.json");
    let binary = env!("CARGO_BIN_EXE_pilotage");
    let limited = |extra: &str| {
        // Blocks of 512 or 1024 bytes, by shell; a checkpoint is larger than eight of either. The signal that the system sends then is
        // ignored, so that the write itself fails.
        let script = format!(
            "trap '' XFSZ; ulimit -f 8; exec '{binary}' solve maze-4x4 --with kafaq --json --episodes 20 \
             --learn trial=20 --learn epoch_limit={extra} --checkpoint run.json"
        );
        Command::new("sh")
            .current_dir(folder.path())
            .args(["-c", &script])
            .output()
            .unwrap()
    };
    let refused = limited("3");
    let said = String::from_utf8(refused.stderr).unwrap();
    assert!(
        !refused.status.success() && said.contains("run.json"),
        "{said}"
    );
    assert!(!path.exists(), "half a file was left");
    let names: Vec<_> = std::fs::read_dir(folder.path()).unwrap().collect();
    assert!(names.is_empty(), "{names:?}");

    // A run that was stopped half-way, and then the disk is full.
    let arguments = [
        "solve",
        "maze-4x4",
        "--with",
        "kafaq",
        "--json",
        "--episodes",
        "20",
        "--learn",
        "trial=20",
        "--learn",
        "epoch_limit=150",
        "--checkpoint",
        "run.json",
    ];
    let mut child = pilotage(folder.path(), &arguments)
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    while !path.exists() {
        std::thread::sleep(Duration::from_millis(5));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let good = std::fs::read(&path).unwrap();
    let refused = limited("150");
    assert!(!refused.status.success());
    assert_eq!(std::fs::read(&path).unwrap(), good);
    assert!(run(folder.path(), &arguments).status.success());
}
