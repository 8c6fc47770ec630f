//! A module uses only those above it in the table of ARCHITECTURE.md, and what all share uses none of them.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::{Path, PathBuf};

/// Stands between the name of a module and the place of its sources in the table.
const PLACE: &str = "| `crates/pilotage/src/";

/// The modules of the library, from the first row of the table down.
fn table() -> Vec<String> {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../ARCHITECTURE.md");
    let page = fs::read_to_string(page).unwrap();
    let rows = page.lines().filter_map(|line| line.strip_prefix(PLACE));
    rows.map(|row| row.split('`').next().unwrap().to_owned())
        .collect()
}

/// Every source below a folder.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(sources(&path));
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            found.push(path);
        }
    }
    found.sort();
    found
}

/// The names in the crate's root that a line of code asks for, given how deep the module is that it stands in, and whether they are
/// surely there: in a module of tests, `super` leads less far.
fn named(line: &str, depth: usize) -> Vec<(&str, bool)> {
    let code = line.split("//").next().unwrap();
    let root = "super::".repeat(depth);
    let mut names = Vec::new();
    for (prefix, surely) in [("crate::", true), (root.as_str(), false)] {
        for (start, _) in code.match_indices(prefix) {
            // Not the end of a longer way: `$crate::`, or one more `super::`.
            let before = code[..start].chars().next_back();
            if before.is_some_and(|c| c == ':' || c == '$' || c == '_' || c.is_alphanumeric()) {
                continue;
            }
            let rest = &code[start + prefix.len()..];
            let end = rest.find(|c: char| c != '_' && !c.is_alphanumeric());
            names.push((&rest[..end.unwrap_or(rest.len())], surely));
        }
    }
    names
}

/// What is wrong with the arrows of a source, whose place is relative to `src`: file, line and what to do.
fn upward(file: &str, text: &str, order: &[String], shared: &[String]) -> Vec<String> {
    let way: Vec<&str> = file.trim_end_matches(".rs").split('/').collect();
    let depth = way.len() - usize::from(way.last() == Some(&"mod"));
    // What is shared stands above the table.
    let place = |module: &str| match shared.iter().any(|name| name == module) {
        true => Some(0),
        false => order.iter().position(|name| name == module).map(|i| i + 1),
    };
    let own = place(way[0]).unwrap_or_else(|| panic!("{file}: `{}` is not in the table", way[0]));
    let mut wrong = Vec::new();
    for (number, line) in text.lines().enumerate() {
        for (name, surely) in named(line, depth) {
            let at = format!("src/{file}:{}", number + 1);
            // Names such as `Error` are no modules.
            let is_module = surely && !name.starts_with(char::is_uppercase);
            match place(name) {
                Some(other) if other > own => wrong.push(format!(
                    "{at}: `{}` uses `{name}`, which stands below it in ARCHITECTURE.md",
                    way[0]
                )),
                None if is_module => wrong.push(format!(
                    "{at}: `{name}` is no module of the table; name one after `crate::`"
                )),
                _ => {}
            }
        }
    }
    wrong
}

#[test]
fn no_arrow_points_upwards() {
    let order = table();
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let files = sources(&source);
    let place = |path: &Path| {
        let inside = path.strip_prefix(&source).unwrap().to_str().unwrap();
        inside.replace('\\', "/")
    };
    // Files beside the root are shared, folders have a row each.
    let mut shared = Vec::new();
    for file in files.iter().map(|path| place(path)) {
        match file.split_once('/') {
            None => shared.push(file.trim_end_matches(".rs").to_owned()),
            Some((folder, _)) => assert!(
                order.iter().any(|module| module == folder),
                "src/{folder} has no row in ARCHITECTURE.md"
            ),
        }
    }
    let wrong: Vec<String> = files
        .iter()
        .filter(|path| place(path) != "lib.rs")
        .flat_map(|path| {
            let text = fs::read_to_string(path).unwrap();
            upward(&place(path), &text, &order, &shared)
        })
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn an_arrow_that_points_upwards_is_seen() {
    let list = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
    let order: Vec<String> = list(&["model", "belief", "policy"]);
    let shared: Vec<String> = list(&["error", "random"]);
    for (file, line, is_wrong) in [
        ("belief/mdp.rs", "use crate::model::Model;", false),
        ("belief/mdp.rs", "use crate::belief::Belief;", false),
        ("belief/mdp.rs", "use crate::error::Error;", false),
        ("belief/mdp.rs", "use crate::Error;", false),
        ("belief/mdp.rs", "use super::model;", false),
        ("belief/mdp.rs", "use crate::policy::Policy;", true),
        ("belief/mdp.rs", "use super::super::policy;", true),
        ("belief/mod.rs", "use super::policy::Policy;", true),
        ("belief/mdp.rs", "let p = crate::policy::of(1);", true),
        ("belief/mdp.rs", "/// See [`crate::policy`].", false),
        ("belief/mdp.rs", "use crate::{model, policy};", true),
        ("belief/mdp.rs", "use crate::prelude::*;", true),
        ("belief/mod.rs", "    use super::*;", false),
        ("policy/mod.rs", "use crate::belief::Belief;", false),
        ("error.rs", "use crate::model::Model;", true),
        ("error.rs", "use crate::random::Rng;", false),
    ] {
        let wrong = upward(file, &format!("\n{line}\n"), &order, &shared);
        assert_eq!(!wrong.is_empty(), is_wrong, "{file}: {line}");
        let at = format!("src/{file}:2: ");
        assert!(wrong.iter().all(|one| one.starts_with(&at)), "{wrong:?}");
    }
}
