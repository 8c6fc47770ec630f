//! The README is true: what it shows is what the program prints and draws.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Set to write what the program prints and draws into README and docs/images, instead of comparing.
const UPDATE: &str = "PILOTAGE_UPDATE_README";

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn read(file: &str) -> String {
    fs::read_to_string(workspace().join(file)).unwrap()
}

/// What stands between two marks.
fn between<'a>(text: &'a str, from: &str, to: &str) -> &'a str {
    let (_, rest) = text.split_once(from).unwrap();
    rest.split_once(to).unwrap().0
}

/// What a command prints in a folder.
fn run(folder: &Path, command: &str) -> String {
    let mut words = command.split(' ');
    assert_eq!(words.next(), Some("pilotage"), "{command}");
    let output = Command::new(env!("CARGO_BIN_EXE_pilotage"))
        .current_dir(folder)
        .args(words)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command}: {said}");
    String::from_utf8(output.stdout).unwrap()
}

fn timeless(text: &str) -> Vec<&str> {
    let timed = |line: &&str| !line.contains(" s to solve");
    text.trim_end().lines().filter(timed).collect()
}

#[test]
fn what_it_shows_is_what_the_program_prints_and_draws() {
    let update = std::env::var_os(UPDATE).is_some();
    let folder = tempfile::tempdir().unwrap();
    let mut readme = read("README.md");
    let section = between(&readme, "## What you get\n", "\n## ").to_owned();

    let transcript = between(&section, "```text\n$ ", "```");
    let mut printed = String::new();
    for part in transcript.split("\n$ ") {
        let (command, shown) = part.split_once('\n').unwrap();
        let current = run(folder.path(), command);
        if !update {
            assert_eq!(timeless(shown), timeless(&current), "{command}");
        }
        printed += &format!("$ {command}\n{current}\n");
    }
    if update && timeless(&printed) != timeless(&format!("$ {transcript}")) {
        let printed = printed.trim_end();
        readme = readme.replace(&format!("$ {transcript}"), &format!("{printed}\n"));
        fs::write(workspace().join("README.md"), readme).unwrap();
    }

    // Commands in the text.
    let (_, text) = section.rsplit_once("```").unwrap();
    for command in text.split('`').filter(|code| code.starts_with("pilotage ")) {
        run(folder.path(), command);
    }
    for picture in fs::read_dir(workspace().join("docs/images")).unwrap() {
        let committed = picture.unwrap().path();
        let drawn = folder.path().join(committed.file_name().unwrap());
        assert!(
            drawn.exists(),
            "no command of the README draws {committed:?}"
        );
        if update {
            fs::copy(drawn, committed).unwrap();
        } else {
            assert!(
                fs::read_to_string(drawn).unwrap() == fs::read_to_string(&committed).unwrap(),
                "{committed:?} is no longer what the README's commands draw; run this test once with {UPDATE}=1"
            );
        }
    }
}

#[test]
fn it_installs_the_program_before_it_uses_it() {
    let readme = read("README.md");
    let install = "cargo install --path crates/pilotage-cli";
    let used = ["\npilotage ", "$ pilotage ", "`pilotage "];
    let first = used.iter().filter_map(|command| readme.find(command)).min();
    assert!(readme.find(install).unwrap() < first.unwrap());

    let manifest = read("Cargo.toml");
    let rust = between(&manifest, "rust-version = \"", "\"");
    assert!(readme.contains(&format!("Rust {rust} or newer")), "{rust}");
}

#[test]
fn its_rust_is_that_of_the_crate_whose_documentation_runs_it() {
    let [whole, of_crate] = ["README.md", "crates/pilotage/README.md"].map(read);
    let snippet = |text| between(text, "```rust\n", "```").to_owned();
    assert_eq!(snippet(&whole), snippet(&of_crate));
}

#[test]
fn citation_and_changelog_know_this_version() {
    let version = env!("CARGO_PKG_VERSION");
    assert!(read("CITATION.cff").contains(&format!("\nversion: {version}\n")));
    assert!(read("CHANGELOG.md").contains(&format!("\n## {version}")));
}

/// Links into the repository that lead nowhere.
#[test]
fn what_it_links_to_is_there() {
    for file in [
        "README.md",
        "ARCHITECTURE.md",
        "CONTRIBUTING.md",
        "CHANGELOG.md",
        "SECURITY.md",
        "docs/releasing.md",
    ] {
        let path = workspace().join(file);
        let text = fs::read_to_string(&path).unwrap();
        for target in text.split("](").skip(1) {
            let target = target.split([')', '#']).next().unwrap();
            let outside = target.is_empty() || target.contains("://");
            assert!(
                outside || path.with_file_name(target).exists(),
                "{file} links to {target}"
            );
        }
    }
}
