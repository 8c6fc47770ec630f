//! The JSON schema of policy files: committed as it is, documented, and true of the policies that are written.
#![allow(clippy::unwrap_used)]

mod common;

use std::path::PathBuf;

use common::automata::{any_automaton, any_graph, number, one_node};
use pilotage::policy;
use proptest::prelude::*;
use serde_json::{Value, json};

/// Set to write the schema instead of comparing it.
const UPDATE: &str = "PILOTAGE_UPDATE_SCHEMA";

#[test]
fn the_committed_schema_is_current() {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../docs/policy.schema.json");
    let current = policy::schema();
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

#[test]
fn every_key_is_documented() {
    fn check(schema: &Value) {
        if let Some(Value::Object(properties)) = schema.get("properties") {
            for (key, property) in properties {
                // The only key of a kind is described by the kind.
                let kind = properties.len() == 1 && schema.get("description").is_some();
                assert!(
                    kind || property.get("description").is_some(),
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
    check(policy::schema().as_value());
}

/// Whether a value is as a schema says. A word of a schema that is not known here panics, so that nothing goes unchecked.
fn is_valid(schema: &Value, value: &Value, root: &Value) -> Result<(), String> {
    let wrong = |word: &str| Err(format!("{word} {schema} is not true of {value}"));
    let Value::Object(words) = schema else {
        return if schema == &json!(true) {
            Ok(())
        } else {
            wrong("")
        };
    };
    let all = |schemas: &Value| -> Vec<Result<(), String>> {
        let schemas = schemas.as_array().unwrap().iter();
        schemas
            .map(|schema| is_valid(schema, value, root))
            .collect()
    };
    for (word, says) in words {
        let (size, number) = (says.as_u64(), says.as_f64());
        let holds = match word.as_str() {
            "$schema" | "$defs" | "title" | "description" | "default" | "format" => true,
            "$ref" => {
                let path = says.as_str().unwrap().strip_prefix('#').unwrap();
                is_valid(root.pointer(path).unwrap(), value, root)?;
                true
            }
            "type" => match says {
                Value::String(kind) => is_of_type(kind, value),
                kinds => {
                    let mut kinds = kinds.as_array().unwrap().iter();
                    kinds.any(|kind| is_of_type(kind.as_str().unwrap(), value))
                }
            },
            "const" => says == value,
            "enum" => says.as_array().unwrap().contains(value),
            "anyOf" => all(says).iter().any(Result::is_ok),
            "oneOf" => all(says).iter().filter(|valid| valid.is_ok()).count() == 1,
            "required" => {
                let mut keys = says.as_array().unwrap().iter();
                keys.all(|key| value.get(key.as_str().unwrap()).is_some())
            }
            "properties" => {
                for (key, schema) in says.as_object().unwrap() {
                    if let Some(value) = value.get(key) {
                        is_valid(schema, value, root)?;
                    }
                }
                true
            }
            "additionalProperties" => {
                assert_eq!(says, &json!(false));
                let properties = words["properties"].as_object().unwrap();
                let mut keys = value.as_object().into_iter().flat_map(|value| value.keys());
                keys.all(|key| properties.contains_key(key))
            }
            "items" => {
                for item in value.as_array().into_iter().flatten() {
                    is_valid(says, item, root)?;
                }
                true
            }
            "prefixItems" => {
                let items = value.as_array().into_iter().flatten();
                for (schema, item) in says.as_array().unwrap().iter().zip(items) {
                    is_valid(schema, item, root)?;
                }
                true
            }
            "minItems" => value
                .as_array()
                .is_none_or(|list| list.len() as u64 >= size.unwrap()),
            "maxItems" => value
                .as_array()
                .is_none_or(|list| list.len() as u64 <= size.unwrap()),
            "minimum" => value.as_f64().is_none_or(|value| value >= number.unwrap()),
            "maximum" => value.as_f64().is_none_or(|value| value <= number.unwrap()),
            "pattern" => value
                .as_str()
                .is_none_or(|text| matches(says.as_str().unwrap(), text)),
            word => panic!("`{word}` is not known"),
        };
        if !holds {
            return wrong(word);
        }
    }
    Ok(())
}

fn is_of_type(kind: &str, value: &Value) -> bool {
    match kind {
        "null" => value.is_null(),
        "string" => value.is_string(),
        "number" => value.is_number(),
        "integer" => value.is_u64() || value.is_i64(),
        "array" => value.is_array(),
        "object" => value.is_object(),
        kind => panic!("`{kind}` is not known"),
    }
}

/// The two patterns of the schema.
fn matches(pattern: &str, text: &str) -> bool {
    let (start, end) = match pattern {
        r"^fnv1a64-[0-9a-f]{16}$" => ("fnv1a64", text.strip_prefix("fnv1a64-")),
        r"^v[0-9]+-[0-9a-f]{16}$" => ("v1", text.strip_prefix("v1-")),
        pattern => panic!("`{pattern}` is not known"),
    };
    let digits =
        |end: &str| end.len() == 16 && end.bytes().all(|b| b"0123456789abcdef".contains(&b));
    text.starts_with(start) && end.is_some_and(digits)
}

fn check(file: &Value) -> Result<(), String> {
    let schema = policy::schema();
    is_valid(schema.as_value(), file, schema.as_value())
}

/// The schema refuses what the reader refuses for its form.
#[test]
fn the_schema_tells_form_from_no_form() {
    let good: Value = serde_json::from_str(&one_node().to_json().unwrap()).unwrap();
    check(&good).unwrap();
    for (pointer, bad) in [
        ("/format", json!(1)),
        ("/format", json!("2")),
        ("/checksum", json!("fnv1a64-0")),
        ("/policy/fingerprint", json!("v1-0123456789abcdeg")),
        ("/policy/actions", json!([])),
        ("/policy/states/0", json!(1)),
        ("/policy/matching", json!("farthest")),
        ("/policy/nodes", json!([])),
        ("/policy/nodes/0/levels", json!([0])),
        ("/policy/nodes/0/levels", json!([0, 1, 2])),
        ("/policy/nodes/0/place", json!({})),
        (
            "/policy/nodes/0/place",
            json!({"point": [0.0], "segment": {}}),
        ),
        ("/policy/nodes/0/mode", json!(-1)),
        ("/policy/nodes/0/value", json!("1")),
        ("/policy/filter/A/0/0", json!(null)),
        ("/policy/filter/levels/0", json!({})),
        ("/policy/start/surprise", json!(1)),
    ] {
        let mut file = good.clone();
        match file.pointer_mut(pointer) {
            Some(place) => *place = bad,
            None => {
                let (table, key) = pointer.rsplit_once('/').unwrap();
                file.pointer_mut(table).unwrap()[key] = bad;
            }
        }
        assert!(check(&file).is_err(), "{pointer}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]

    #[test]
    fn every_policy_is_as_the_schema_says(automaton in any_automaton(number(), 1..12)) {
        let file: Value = serde_json::from_str(&automaton.to_json().unwrap()).unwrap();
        if let Err(wrong) = check(&file) {
            prop_assert!(false, "{}", wrong);
        }
    }

    #[test]
    fn every_graph_is_as_the_schema_says(graph in any_graph()) {
        let file: Value = serde_json::from_str(&graph.to_json().unwrap()).unwrap();
        if let Err(wrong) = check(&file) {
            prop_assert!(false, "{}", wrong);
        }
        let mut bad = file;
        bad["policy"]["nodes"][0]["mode"] = json!(0);
        prop_assert!(check(&bad).is_err());
    }
}
