//! What the workspace depends on: licences and sources, as `deny.toml` allows them. Versions known to be unsafe are left to cargo-deny,
//! which asks a database. And what those need who depend on the crates of the workspace.
#![allow(clippy::unwrap_used)]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// A list of `deny.toml`.
fn allowed(section: &str, key: &str) -> Vec<String> {
    let text = std::fs::read_to_string(workspace().join("deny.toml")).unwrap();
    let rules: toml::Table = text.parse().unwrap();
    rules[section][key].clone().try_into().unwrap()
}

fn metadata(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO"))
        .current_dir(workspace())
        .args(["metadata", "--locked", "--format-version", "1"])
        .args(arguments)
        .output()
        .unwrap()
}

/// The platform that Rust programs made here run on.
fn platform() -> String {
    let said = Command::new("rustc").arg("-vV").output().unwrap().stdout;
    let said = String::from_utf8(said).unwrap();
    let host = said.lines().find_map(|line| line.strip_prefix("host: "));
    host.unwrap().to_owned()
}

/// Every package of the lock file, those of other platforms too. Without a network these may never have been fetched, and then it is
/// the packages of this platform.
fn packages() -> Vec<Value> {
    let mut output = metadata(&["--all-features"]);
    if !output.status.success() {
        let platform = platform();
        output = metadata(&[
            "--all-features",
            "--offline",
            "--filter-platform",
            &platform,
        ]);
    }
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "cargo metadata: {said}");
    let whole: Value = serde_json::from_slice(&output.stdout).unwrap();
    whole["packages"].as_array().unwrap().clone()
}

/// Whether a licence expression can be met with the licences allowed. Old manifests write `/` for `OR`.
fn can_be_met(expression: &str, allowed: &[String]) -> bool {
    let spaced = expression.replace('/', " OR ");
    let spaced = spaced.replace('(', " ( ").replace(')', " ) ");
    let mut words = spaced.split_whitespace().peekable();
    let met = any(&mut words, allowed);
    met && words.next().is_none()
}

type Words<'a> = std::iter::Peekable<std::str::SplitWhitespace<'a>>;

fn any(words: &mut Words, allowed: &[String]) -> bool {
    let mut met = all(words, allowed);
    while words.next_if_eq(&"OR").is_some() {
        met |= all(words, allowed);
    }
    met
}

fn all(words: &mut Words, allowed: &[String]) -> bool {
    let mut met = one(words, allowed);
    while words.next_if_eq(&"AND").is_some() {
        met &= one(words, allowed);
    }
    met
}

fn one(words: &mut Words, allowed: &[String]) -> bool {
    if words.next_if_eq(&"(").is_some() {
        let met = any(words, allowed);
        return words.next() == Some(")") && met;
    }
    let Some(mut licence) = words.next().map(str::to_owned) else {
        return false;
    };
    if words.next_if_eq(&"WITH").is_some() {
        licence = format!("{licence} WITH {}", words.next().unwrap_or_default());
    }
    allowed.contains(&licence)
}

#[test]
fn licence_expressions_are_read_as_they_are_meant() {
    let allowed = ["MIT", "Apache-2.0", "Unicode-3.0"].map(str::to_owned);
    for (expression, met) in [
        ("MIT", true),
        ("GPL-3.0-only", false),
        ("MIT OR GPL-3.0-only", true),
        ("GPL-3.0-only/MIT", true),
        ("MIT AND GPL-3.0-only", false),
        ("(MIT OR Apache-2.0) AND Unicode-3.0", true),
        ("(MIT OR Apache-2.0) AND GPL-3.0-only", false),
        ("GPL-3.0-only OR MIT AND Apache-2.0", true),
        ("Apache-2.0 WITH LLVM-exception", false),
        ("Apache-2.0 WITH LLVM-exception OR MIT", true),
        ("(MIT", false),
        ("MIT MIT", false),
        ("", false),
    ] {
        assert_eq!(can_be_met(expression, &allowed), met, "{expression:?}");
    }
}

#[test]
fn every_dependency_has_a_licence_and_a_source_that_are_allowed() {
    let licences = allowed("licenses", "allow");
    let registries = allowed("sources", "allow-registry");
    let packages = packages();
    assert!(packages.len() > 50, "only {} packages", packages.len());
    let wrong: Vec<String> = packages
        .iter()
        .filter_map(|package| {
            let licence = package["license"].as_str().unwrap_or_default();
            let known = package["source"].as_str().is_none_or(|source| {
                registries
                    .iter()
                    .any(|url| source == format!("registry+{url}"))
            });
            let name = &package["name"];
            match (can_be_met(licence, &licences), known) {
                (true, true) => None,
                (false, _) => Some(format!("{name}: licence {licence:?}")),
                (true, false) => Some(format!("{name}: source {}", package["source"])),
            }
        })
        .collect();
    assert!(wrong.is_empty(), "deny.toml does not allow {wrong:#?}");
}

#[test]
fn every_crate_of_the_workspace_says_what_it_is_and_carries_its_licences() {
    let packages = packages();
    let own: Vec<&Value> = packages
        .iter()
        .filter(|package| package["source"].is_null())
        .collect();
    assert!(own.len() >= 2, "{own:?}");
    for package in own {
        let name = &package["name"];
        for key in [
            "description",
            "documentation",
            "license",
            "readme",
            "rust_version",
        ] {
            let text = package[key].as_str().unwrap_or_default();
            assert!(!text.is_empty(), "{name} has no {key}");
        }
        for (key, most) in [("authors", 1), ("keywords", 5), ("categories", 5)] {
            let count = package[key].as_array().unwrap().len();
            assert!((1..=most).contains(&count), "{name}: {count} {key}");
        }
        assert!(package["metadata"]["docs"]["rs"].is_object(), "{name}");
        assert_eq!(package["version"], env!("CARGO_PKG_VERSION"), "{name}");
        let folder = Path::new(package["manifest_path"].as_str().unwrap())
            .parent()
            .unwrap();
        for file in ["README.md", "LICENSE-MIT", "LICENSE-APACHE"] {
            assert!(folder.join(file).exists(), "{name} has no {file}");
        }
        for dependency in package["dependencies"].as_array().unwrap() {
            let requirement = dependency["req"].as_str().unwrap();
            let (other, kind) = (&dependency["name"], &dependency["kind"]);
            assert!(
                requirement != "*" || !kind.is_null(),
                "{name}: {other} of any version"
            );
        }
    }
}
