//! The JSON schema of model files: complete, and committed as it is.
#![allow(clippy::unwrap_used)]

use std::path::PathBuf;

use pilotage::scenario;
use serde_json::Value;

/// Set to write the schema instead of comparing it.
const UPDATE: &str = "PILOTAGE_UPDATE_SCHEMA";

#[test]
fn the_committed_schema_is_current() {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("models/model.schema.json");
    let current = scenario::schema();
    if std::env::var_os(UPDATE).is_some() {
        std::fs::write(
            &path,
            serde_json::to_string_pretty(&current).unwrap() + "\n",
        )
        .unwrap();
    }
    let committed: Value = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
    assert!(
        committed == *current.as_value(),
        "the schema has changed; run the tests once with {UPDATE}=1 and commit it"
    );
}

/// All keys that a JSON schema lets a file have.
fn keys_of_schema(schema: &Value, keys: &mut Vec<String>) {
    match schema {
        Value::Object(object) => {
            if let Some(Value::Object(properties)) = object.get("properties") {
                keys.extend(properties.keys().cloned());
            }
            object
                .values()
                .for_each(|value| keys_of_schema(value, keys));
        }
        Value::Array(list) => list.iter().for_each(|value| keys_of_schema(value, keys)),
        _ => {}
    }
}

/// All keys of a file, without those that it chooses itself: names of actions, state variables, readings and signals.
fn keys_of_file(table: &toml::Table, keys: &mut Vec<String>) {
    for (key, value) in table {
        keys.push(key.clone());
        match (key.as_str(), value) {
            ("actions", toml::Value::Table(actions)) => {
                actions
                    .values()
                    .filter_map(toml::Value::as_table)
                    .for_each(|action| keys_of_file(action, keys));
            }
            ("in" | "alive" | "uniform" | "step" | "read" | "symbols", _) => {}
            (_, toml::Value::Table(table)) => keys_of_file(table, keys),
            (_, toml::Value::Array(list)) => {
                list.iter()
                    .filter_map(toml::Value::as_table)
                    .for_each(|table| keys_of_file(table, keys));
            }
            _ => {}
        }
    }
}

#[test]
fn every_key_of_every_model_is_in_the_schema() {
    let mut known = Vec::new();
    keys_of_schema(scenario::schema().as_value(), &mut known);
    for name in scenario::names() {
        let table: toml::Table = scenario::builtin(name).unwrap().parse().unwrap();
        let mut used = Vec::new();
        keys_of_file(&table, &mut used);
        let missing: Vec<_> = used.iter().filter(|key| !known.contains(key)).collect();
        assert!(missing.is_empty(), "{name}: {missing:?}");
    }
}

#[test]
fn every_key_is_documented() {
    fn check(schema: &Value) {
        if let Some(Value::Object(properties)) = schema.get("properties") {
            for (key, property) in properties {
                assert!(
                    property.get("description").is_some(),
                    "`{key}` has no description"
                );
            }
        }
        match schema {
            Value::Object(object) => object.values().for_each(check),
            Value::Array(list) => list.iter().for_each(check),
            _ => {}
        }
    }
    check(scenario::schema().as_value());
}

#[test]
fn the_schema_knows_every_key_that_the_reader_knows() {
    let mut keys = Vec::new();
    keys_of_schema(scenario::schema().as_value(), &mut keys);
    let text = "format = 1\nzzzzzzzzzzzzzzzz = 1";
    let error = scenario::read(text, "x.toml").map(|_| ()).unwrap_err();
    let known: Vec<&str> = error.hint.split('`').skip(1).step_by(2).collect();
    assert_eq!(known.len(), 20, "{known:?}");
    assert!(
        known.iter().all(|key| keys.iter().any(|k| k == key)),
        "{known:?}"
    );
}
