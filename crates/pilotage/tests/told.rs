//! Agents that are told at which of several starts an episode begins.
#![allow(clippy::unwrap_used)]

use pilotage::scenario;

#[test]
fn a_start_that_is_told_is_the_only_one() {
    let lost = scenario::find("u-maze").unwrap().model;
    for number in 1..=3 {
        let name = format!("u-maze@{number}");
        let told = scenario::find(&name).unwrap().model;
        assert_eq!(told.name, name);
        assert_eq!(told.start.len(), 1);
        assert_eq!(told.start[0].mean, lost.start[number - 1].mean);
        assert_eq!(told.start[0].weight, 1.0);
        assert_ne!(told.fingerprint(), lost.fingerprint());
    }
}

/// What is told is part of the text that goes with a policy whose belief is kept by the laws of its model.
#[test]
fn a_belief_that_was_told_its_start_is_read_again_as_that() {
    let told = scenario::find("u-maze@2").unwrap().model;
    let text = told.text.text.as_deref().unwrap();
    let again = scenario::read(text, "again").unwrap().model;
    assert_eq!(again.fingerprint(), told.fingerprint());
}

#[test]
fn there_has_to_be_such_a_start() {
    let message = |name: &str| scenario::find(name).unwrap_err().to_string();
    for (name, what) in [
        (
            "u-maze@4",
            "u-maze cannot be told a start: there is no start 4: there are 3, counted from 1",
        ),
        ("u-maze@0", "there is no start 0"),
        ("u-maze@two", "no built-in model and no file has this name"),
        ("no-maze@2", "no built-in model and no file has this name"),
    ] {
        assert!(message(name).contains(what), "{}", message(name));
    }
}

#[test]
fn a_file_may_tell_it_itself_but_not_twice() {
    let text = scenario::builtin("u-maze").unwrap();
    let told = scenario::read(&format!("told = 3\n{text}"), "told")
        .unwrap()
        .model;
    assert_eq!(
        told.fingerprint(),
        scenario::find("u-maze@3").unwrap().model.fingerprint()
    );
    let elsewhere = format!(
        "told = 3\n{text}\nstart = {{ mean = [1.5, 1.5], covariance = [[0.3, 0.0], [0.0, 0.3]] }}\n"
    );
    let error = scenario::read(&elsewhere, "told").unwrap_err();
    assert_eq!(error.place.unwrap().line, 1);
    assert!(
        error
            .message
            .contains("`told` says where an episode begins"),
        "{}",
        error.message
    );
}
