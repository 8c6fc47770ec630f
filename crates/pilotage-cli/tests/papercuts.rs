//! Small things that cost a person time: names mistyped, settings not listed, commands shown that do not work.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use pilotage::solve::{Registry, SettingInfo};
use tempfile::TempDir;

fn run(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_pilotage"))
        .current_dir(folder)
        .args(arguments)
        .output()
        .unwrap()
}

fn printed(folder: &Path, arguments: &[&str]) -> String {
    let output = run(folder, arguments);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {said}");
    String::from_utf8(output.stdout).unwrap()
}

fn refused(folder: &Path, arguments: &[&str]) -> String {
    let output = run(folder, arguments);
    assert!(!output.status.success(), "{arguments:?}");
    String::from_utf8(output.stderr).unwrap()
}

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// What stands between two marks of a text, and the rest.
fn between<'a>(text: &'a str, from: &str, to: &str) -> (&'a str, &'a str) {
    let (_, rest) = text.split_once(from).unwrap();
    rest.split_once(to).unwrap()
}

fn readme() -> String {
    fs::read_to_string(workspace().join("README.md")).unwrap()
}

/// The model that the README shows.
fn hallway() -> String {
    between(&readme(), "```toml\n", "```").0.to_owned()
}

/// A folder with model files of these names.
fn folder_with(files: &[&str]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for file in files {
        let path = folder.path().join(file);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, hallway()).unwrap();
    }
    folder
}

/// Every solver with its settings, in the order in which they are listed.
fn solvers() -> Vec<(&'static str, Vec<SettingInfo>)> {
    let registry = Registry::builtin();
    let entries = registry.entries().iter();
    entries
        .map(|entry| (entry.name(), entry.settings()))
        .collect()
}

#[test]
fn help_lists_the_settings_of_every_solver_with_default_and_range() {
    let here = std::env::temp_dir();
    assert!(printed(&here, &["--help"]).contains("pilotage solve --help"));
    let help = printed(&here, &["solve", "--help"]);
    let lists: Vec<&str> = help.split("\nSettings of ").skip(1).collect();
    assert_eq!(lists.len(), solvers().len());
    for ((solver, settings), list) in solvers().into_iter().zip(lists) {
        assert!(list.starts_with(solver), "{list}");
        assert!(settings.len() >= 2, "{solver}");
        for SettingInfo {
            name,
            default,
            about,
        } in settings
        {
            let listed = list.lines().any(|line| {
                let words: Vec<&str> = line.split_whitespace().collect();
                words.len() > 2 && words[0] == name && words[1] == default
            });
            assert!(listed, "{solver}: {name} = {default}\n{list}");
            let range = [
                "at least",
                "at most",
                "more than",
                "in `[",
                "in `(",
                "`: `",
                " or `",
            ];
            let ranged = range.iter().any(|words| about.contains(words));
            assert!(ranged, "{solver}: {name} has no range: {about}");
        }
    }
}

#[test]
fn a_wrong_setting_lists_the_right_ones() {
    let here = std::env::temp_dir();
    for (learner, settings) in solvers() {
        if settings.iter().all(|info| info.name != "lambda") {
            continue;
        }
        for (wrong, meant) in [("lamda", Some("lambda")), ("zzzzzz", None), ("", None)] {
            let setting = format!("{wrong}=1");
            let said = refused(
                &here,
                &["solve", "basic", "--with", learner, "--learn", &setting],
            );
            match meant {
                Some(meant) => assert!(said.contains(&format!("did you mean `{meant}`?"))),
                None => assert!(!said.contains("did you mean"), "{said}"),
            }
            for SettingInfo { name, .. } in &settings {
                assert!(said.contains(&format!("`{name}`")), "{name}: {said}");
            }
            assert!(!said.contains("`seed`"), "--seed sets it: {said}");
        }
    }
}

#[test]
fn a_name_mistyped_brings_the_file_or_the_problem_that_was_meant() {
    let folder = folder_with(&[
        "hallway.toml",
        "tigger.toml",
        "deep/cellar.toml",
        "notes.txt",
    ]);
    for (typed, meant) in [
        ("hallwy", Some("hallway.toml")),
        ("hallway", Some("hallway.toml")),
        ("hallwy.toml", Some("hallway.toml")),
        ("HALLWAY.TOML", Some("hallway.toml")),
        ("hallway.tml", Some("hallway.toml")),
        ("deep/celar.toml", Some("deep/cellar.toml")),
        ("deep/celar", Some("deep/cellar.toml")),
        ("./hallwy.toml", Some("./hallway.toml")),
        // A problem that is built in, though a file is as near; and the other way about.
        ("tigeer", Some("tiger")),
        ("tigeer.toml", Some("tigger.toml")),
        ("coridor", Some("corridor")),
        ("coridor.toml", Some("corridor")),
        ("note", None),
        ("nowhere/hallway.toml", None),
        ("zzzzzzzzzzzz", None),
    ] {
        for verb in ["check", "solve"] {
            let said = refused(folder.path(), &[verb, typed]);
            assert_eq!(said.matches("error:").count(), 1, "{said}");
            match meant {
                Some(meant) => {
                    let hint = format!("did you mean `{meant}`?");
                    assert!(said.contains(&hint), "{typed}: {said}");
                }
                None => assert!(!said.contains("did you mean"), "{typed}: {said}"),
            }
        }
    }
}

/// Runs the command that stands between backquotes on the last line, as a shell does.
#[cfg(unix)]
#[test]
fn the_command_on_the_last_line_of_solve_draws() {
    let folder = folder_with(&[
        "hallway.toml",
        "my hall's.toml",
        "a/b $HOME.toml",
        "-dash.toml",
    ]);
    for (problem, out) in [
        ("tiger", "policy.json"),
        ("hallway.toml", "policy.json"),
        ("./hallway.toml", "a/policy of mine.json"),
        ("my hall's.toml", "it's \"mine\".json"),
        ("a/b $HOME.toml", "a/`b`.json"),
        ("./-dash.toml", "-out.json"),
    ] {
        let out_option = format!("--out={out}");
        let text = printed(
            folder.path(),
            &["solve", problem, "--episodes", "10", &out_option],
        );
        let last = text.trim_end().lines().last().unwrap();
        let (_, rest) = last.split_once("; `").unwrap();
        let command = rest.strip_suffix("` draws it").unwrap();
        let arguments = command.strip_prefix("pilotage ").unwrap();
        let drawn = Command::new("sh")
            .current_dir(folder.path())
            .args([
                "-c",
                &format!("'{}' {arguments}", env!("CARGO_BIN_EXE_pilotage")),
            ])
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&drawn.stderr);
        assert!(drawn.status.success(), "{command}: {said}");
        let picture = out.replace(".json", "-automaton.svg");
        assert!(folder.path().join(picture).exists(), "{command}");
    }
}

#[test]
fn work_that_is_short_says_nothing_in_a_pipe() {
    let output = run(
        &std::env::temp_dir(),
        &["solve", "corridor-blind", "--episodes", "100"],
    );
    assert!(output.status.success());
    assert_eq!(String::from_utf8(output.stderr).unwrap(), "");
}

#[test]
fn what_is_unusual_about_a_model_is_said_when_it_is_checked() {
    let folder = TempDir::new().unwrap();
    let text = pilotage::scenario::builtin("corridor-unbounded").unwrap();
    let usual = printed(folder.path(), &["check", "corridor-unbounded"]);
    assert!(!usual.contains("readings") && !usual.contains("clock"));
    let changed = text.replacen("[sensor]", "[sensor]\npresent = 0.9", 1)
        + "\n[[later]]\nfrom = 7\nsensor = { present = 0.5 }\n";
    fs::write(folder.path().join("changed.toml"), changed).unwrap();
    let said = printed(folder.path(), &["check", "changed.toml"]);
    for line in [
        "  readings  come with probability 0.9, later 0.5\n",
        "  clock     it matters which step of an episode it is, up to step 7\n",
    ] {
        assert!(said.contains(line), "{said}");
    }
}
