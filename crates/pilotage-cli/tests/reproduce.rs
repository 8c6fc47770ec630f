//! `pilotage reproduce`: what it writes, that it goes on where it stopped, that a seed gives the same report.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::Path;

use assert_cmd::Command;
use assert_cmd::cargo::cargo_bin_cmd;

fn reproduce(out: &Path, only: &str, seed: &str) -> Command {
    let mut command = cargo_bin_cmd!("pilotage");
    command.args([
        "reproduce",
        "--quick",
        "--only",
        only,
        "--seed",
        seed,
        "--out",
    ]);
    command.arg(out);
    command
}

/// Few and fast ones, exact and simulated.
const SOME: &str = "table-4.1,figure-5.4,figure-4.8";

#[test]
fn a_report_is_a_page_markdown_figures_and_data() {
    let folder = tempfile::tempdir().unwrap();
    reproduce(folder.path(), SOME, "1").assert().success();
    let page = fs::read_to_string(folder.path().join("report.html")).unwrap();
    assert!(page.contains("Table 4.1") && page.contains("Figures 5.3 and 5.4"));
    let markdown = fs::read_to_string(folder.path().join("report.md")).unwrap();
    let named: Vec<&str> = markdown
        .split("](<figures/")
        .skip(1)
        .filter_map(|rest| Some(rest.split_once(">)")?.0))
        .collect();
    assert!(named.len() >= 3, "{named:?}");
    for name in named {
        assert!(folder.path().join("figures").join(name).exists(), "{name}");
    }
    let table = fs::read_to_string(folder.path().join("data/table-4.1.csv")).unwrap();
    assert_eq!(
        table
            .lines()
            .map(|line| line.rsplit(',').next().unwrap())
            .collect::<Vec<_>>(),
        ["here", "9", "9", "9", "8", "7"]
    );
}

#[test]
fn a_seed_gives_the_same_report_with_one_thread_and_with_many() {
    let texts: Vec<String> = [("1", "1"), ("1", "4"), ("2", "4")]
        .iter()
        .map(|(seed, threads)| {
            let folder = tempfile::tempdir().unwrap();
            reproduce(folder.path(), SOME, seed)
                .args(["--threads", threads])
                .assert()
                .success();
            fs::read_to_string(folder.path().join("report.html")).unwrap()
        })
        .collect();
    assert_eq!(texts[0], texts[1]);
    assert_ne!(texts[0], texts[2]);
}

/// What is kept of an earlier run is believed, unless it was edited or another program made it. A byte more at the end of a program is no
/// other behaviour, but enough to tell that it is another program.
#[cfg(target_os = "linux")]
#[test]
fn what_is_kept_is_believed_if_this_program_made_it_and_nobody_changed_it() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let copies = r#"cp "$0" same && cp "$0" other && echo >> other"#;
    Command::new("sh")
        .args(["-c", copies, env!("CARGO_BIN_EXE_pilotage")])
        .current_dir(here)
        .assert()
        .success();
    let file = here.join("report/data/table-4.1.json");
    // What is kept then, and since when.
    let run = |program: &str| {
        Command::new(here.join(program))
            .args("reproduce --quick --only table-4.1 --out report".split(' '))
            .current_dir(here)
            .assert()
            .success();
        let written = fs::metadata(&file).unwrap().modified().unwrap();
        (fs::read_to_string(&file).unwrap(), written)
    };
    let whole = run("same");
    assert!(run("same") == whole, "made again");

    let edited = whole.0.replacen("Table 4.1", "Edited", 1);
    assert!(edited != whole.0);
    fs::write(&file, edited).unwrap();
    assert!(run("same").0 == whole.0, "an edited finding is believed");
    let report = fs::read_to_string(here.join("report/report.md")).unwrap();
    assert!(!report.contains("Edited"));

    let other = run("other");
    assert!(
        other.0 != whole.0,
        "a finding of another program is believed"
    );
    let finding = |text: &str| {
        let kept: serde_json::Value = serde_json::from_str(text).unwrap();
        kept["finding"].clone()
    };
    assert_eq!(finding(&other.0), finding(&whole.0));
}

#[test]
fn a_name_that_is_none_brings_the_nearest() {
    let folder = tempfile::tempdir().unwrap();
    let output = reproduce(folder.path(), "tabel-4.1", "1")
        .assert()
        .failure()
        .get_output()
        .clone();
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(message.contains("did you mean `table-4.1`?"), "{message}");
    assert!(!folder.path().join("report.html").exists());
}

#[test]
fn a_folder_that_cannot_be_made_is_one_message() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    fs::write(&file, "").unwrap();
    let output = reproduce(&file.join("report"), "table-4.1", "1")
        .assert()
        .failure()
        .get_output()
        .clone();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(message.matches("error:").count(), 1, "{message}");
}
