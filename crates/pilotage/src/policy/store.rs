//! Policies as files: versioned JSON with a checksum, written whole or not at all.

use std::path::Path;

use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};
use serde_json::value::RawValue;

use super::check::{Checked, Fault};
use super::file::{FORMAT, File, GraphTable, PolicyTable};
use super::layout::{Quoted, lay_out};
use crate::digest::Digest;
use crate::error::{Error, Result, is_unseen};
use crate::files::{read_text, write_whole};
use crate::model::{Fingerprint, Model};
use crate::policy::{Automaton, PolicyGraph, Saved};

/// Longest policy file that is read, MiB. What is read takes a few times as much memory.
const MOST_MEBIBYTES: u64 = 32;

/// What a file of every format begins with.
#[derive(Deserialize)]
struct Header {
    format: u64,
    pilotage: String,
}

/// What tells a policy graph from an automaton.
#[derive(Deserialize)]
struct Kind {
    signals: Option<IgnoredAny>,
}

/// The checksum of the text of a policy.
fn checksum(policy: &str) -> String {
    let mut quoted = Quoted::default();
    let space = |c: char| matches!(c, ' ' | '\t' | '\n' | '\r');
    let mut digest = Digest::new();
    for token in policy.split(|c| !quoted.after(c) && space(c)) {
        digest.write(token.as_bytes());
    }
    digest.to_string()
}

impl Automaton {
    /// The automaton as the text of a policy file, as `docs/policy-format.md` describes it.
    ///
    /// # Errors
    /// [`Error::Policy`] for one that could not be read again: without nodes, with numbers that are not finite or larger than
    /// [`crate::belief::LARGEST`], with parts that do not fit together, or larger than 32 MiB.
    pub fn to_json(&self) -> Result<String> {
        let table = PolicyTable::new(self).and_then(|table| {
            table.check()?;
            Ok(table)
        });
        write(&self.problem, table)
    }

    /// Reads the text of a policy file; `origin` names it in errors.
    ///
    /// # Errors
    /// [`Error::Policy`] for text that is no policy file, of another format, damaged, whose numbers do not fit together, or that holds a
    /// policy graph.
    pub fn from_json(text: &str, origin: &str) -> Result<Self> {
        automaton(Saved::from_json(text, origin)?, origin)
    }

    /// Reads a policy file.
    ///
    /// # Errors
    /// [`Error::Io`] where it cannot be read as text, otherwise as [`Automaton::from_json`].
    pub fn load(path: &Path) -> Result<Self> {
        automaton(Saved::load(path)?, &path.display().to_string())
    }

    /// Writes a policy file, whole or not at all.
    ///
    /// # Errors
    /// [`Error::Io`], otherwise as [`Automaton::to_json`].
    pub fn save(&self, path: &Path) -> Result<()> {
        write_whole(path, self.to_json()?.as_bytes())
    }

    /// Whether it was made for this very problem.
    ///
    /// # Errors
    /// [`Error::Policy`] naming both problems where not.
    pub fn check_problem(&self, model: &Model, origin: &str) -> Result<()> {
        check_problem((&self.problem, self.fingerprint), model, origin)
    }

    /// Whether it can act in the world of a model, be it made for another one: the same actions and state variables in the same order, and
    /// as many readings.
    ///
    /// # Errors
    /// [`Error::Policy`] with the first difference.
    pub fn check_world(&self, world: &Model, origin: &str) -> Result<()> {
        let actions: Vec<&str> = world.actions.iter().map(|a| a.name.as_str()).collect();
        let states: Vec<&str> = world.state.iter().map(|v| v.name.as_str()).collect();
        check_names("actions", &self.actions, &actions, (world, origin))?;
        check_names("state variables", &self.states, &states, (world, origin))?;
        if self.updater.readings() != world.observation_dim() {
            return Err(Error::Policy {
                origin: origin.to_owned(),
                reason: format!(
                    "the world of {} gives {} readings, which this policy's filter does not fit; choose a world with the same sensor",
                    world.name,
                    world.observation_dim()
                ),
            });
        }
        Ok(())
    }
}

impl PolicyGraph {
    /// The graph as the text of a policy file, as `docs/policy-format.md` describes it.
    ///
    /// # Errors
    /// [`Error::Policy`] for one that could not be read again: without nodes, with ways that lead nowhere or shares that are none, or larger
    /// than 32 MiB.
    pub fn to_json(&self) -> Result<String> {
        let table = GraphTable::new(self);
        write(&self.problem, table.check().map(|()| table))
    }

    /// Writes a policy file, whole or not at all.
    ///
    /// # Errors
    /// [`Error::Io`], otherwise as [`PolicyGraph::to_json`].
    pub fn save(&self, path: &Path) -> Result<()> {
        write_whole(path, self.to_json()?.as_bytes())
    }

    /// Whether it can act in the world of a model, be it made for another one: the same actions and signals in the same order.
    ///
    /// # Errors
    /// [`Error::Policy`] with the first difference.
    pub fn check_world(&self, world: &Model, origin: &str) -> Result<()> {
        let actions: Vec<&str> = world.actions.iter().map(|a| a.name.as_str()).collect();
        let signals: Vec<&str> = world.laws.symbols.iter().map(String::as_str).collect();
        check_names("actions", &self.actions, &actions, (world, origin))?;
        check_names("signals", &self.signals, &signals, (world, origin))
    }
}

impl Saved {
    /// Reads the text of a policy file; `origin` names it in errors.
    ///
    /// # Errors
    /// [`Error::Policy`] for text that is no policy file, of another format, damaged, or whose numbers do not fit together.
    pub fn from_json(text: &str, origin: &str) -> Result<Self> {
        read(text).map_err(|reason| Error::Policy {
            origin: origin.to_owned(),
            reason: in_a_line(&reason),
        })
    }

    /// Reads a policy file.
    ///
    /// # Errors
    /// [`Error::Io`] where it cannot be read as text, otherwise as [`Saved::from_json`].
    pub fn load(path: &Path) -> Result<Self> {
        let text = read_text(path, MOST_MEBIBYTES).map_err(|source| Error::Io {
            path: path.to_owned(),
            source,
        })?;
        Self::from_json(&text, &path.display().to_string())
    }

    /// Whether it was made for this very problem.
    ///
    /// # Errors
    /// [`Error::Policy`] naming both problems where not.
    pub fn check_problem(&self, model: &Model, origin: &str) -> Result<()> {
        check_problem((self.problem(), self.fingerprint()), model, origin)
    }

    /// Whether it can act in the world of a model, be it made for another one.
    ///
    /// # Errors
    /// As [`Automaton::check_world`] and [`PolicyGraph::check_world`].
    pub fn check_world(&self, world: &Model, origin: &str) -> Result<()> {
        match self {
            Self::Automaton(automaton) => automaton.check_world(world, origin),
            Self::Graph(graph) => graph.check_world(world, origin),
        }
    }
}

/// The automaton, where a policy is one.
fn automaton(policy: Saved, origin: &str) -> Result<Automaton> {
    match policy {
        Saved::Automaton(automaton) => Ok(automaton),
        Saved::Graph(_) => Err(Error::Policy {
            origin: origin.to_owned(),
            reason: "this policy is a graph, and an automaton is needed; solve again in the form tree, nearest or segments".to_owned(),
        }),
    }
}

fn check_problem(
    (problem, fingerprint): (&str, Fingerprint),
    model: &Model,
    origin: &str,
) -> Result<()> {
    let reason = if problem != model.name {
        format!(
            "this policy is for {problem}, not for {}; solve {} to get one",
            model.name, model.name
        )
    } else if !fingerprint.comparable(&model.fingerprint()) {
        format!(
            "this policy names its problem by the fingerprint {fingerprint}, which this version cannot compare with that of {}, {}; solve it again",
            model.name,
            model.fingerprint()
        )
    } else if fingerprint != model.fingerprint() {
        format!(
            "{} has changed since this policy was made; solve it again",
            model.name
        )
    } else {
        return Ok(());
    };
    Err(Error::Policy {
        origin: origin.to_owned(),
        reason,
    })
}

/// Whether a policy's own names are those of a world.
fn check_names(
    what: &str,
    own: &[String],
    others: &[&str],
    (world, origin): (&Model, &str),
) -> Result<()> {
    if own == others {
        return Ok(());
    }
    let others = match others {
        [] => "none".to_owned(),
        others => others.join(", "),
    };
    Err(Error::Policy {
        origin: origin.to_owned(),
        reason: format!(
            "this policy has the {what} {}, and the world of {} has {others}; choose a world with the same",
            own.join(", "),
            world.name,
        ),
    })
}

/// The text of the file of a policy.
fn write<T: Serialize>(problem: &str, table: Checked<T>) -> Result<String> {
    let fail = |reason: String| Error::Policy {
        origin: problem.to_owned(),
        reason: format!("the policy cannot be kept in a file: {reason}"),
    };
    let table = table.map_err(|fault| fail(fault.to_string()))?;
    let json = |error: serde_json::Error| fail(error.to_string());
    let policy = serde_json::to_string(&table).map_err(json)?;
    let file = File {
        format: FORMAT,
        pilotage: env!("CARGO_PKG_VERSION").to_owned(),
        checksum: checksum(&policy),
        policy: RawValue::from_string(policy).map_err(json)?,
    };
    let text = lay_out(&serde_json::to_string(&file).map_err(json)?);
    if is_too_long(&text) {
        return Err(fail(format!(
            "{} bytes are more than the {MOST_MEBIBYTES} MiB that are read again; give the model fewer levels (`level_tolerance` in [belief]) or the policy fewer nodes",
            text.len()
        )));
    }
    Ok(text)
}

fn read(text: &str) -> std::result::Result<Saved, String> {
    if is_too_long(text) {
        return Err(format!(
            "longer than the {MOST_MEBIBYTES} MiB that a policy file of pilotage can have"
        ));
    }
    // The format comes first: another one has other keys.
    let header: Header = serde_json::from_str(text).map_err(|error| {
        format!(
            "not a policy file of pilotage ({error}); make one with `pilotage solve PROBLEM --out FILE`"
        )
    })?;
    if header.format != FORMAT {
        let newer = match header.format > FORMAT {
            true => "use that version, or solve again",
            false => "solve again to renew it",
        };
        return Err(format!(
            "policy format {} was written by pilotage {}; this is pilotage {} and reads format {FORMAT}; {newer}",
            header.format,
            header.pilotage,
            env!("CARGO_PKG_VERSION")
        ));
    }
    let damaged = |what: String| format!("damaged policy file: {what}; solve again to renew it");
    let json = |error: serde_json::Error| damaged(error.to_string());
    let fault = |fault: Fault| damaged(fault.to_string());
    let file: File<&RawValue> = serde_json::from_str(text).map_err(json)?;
    let policy = file.policy.get();
    if file.checksum != checksum(policy) {
        return Err(format!(
            "damaged policy file: its checksum is {}, and that of its policy {}; solve again to renew it or, if it was edited on purpose, correct the former",
            file.checksum,
            checksum(policy)
        ));
    }
    // Whatever is no object is refused by the tables themselves.
    let kind = serde_json::from_str::<Kind>(policy);
    if kind.is_ok_and(|kind| kind.signals.is_some()) {
        let table: GraphTable = serde_json::from_str(policy).map_err(json)?;
        table.check().map_err(fault)?;
        return Ok(Saved::Graph(table.graph()));
    }
    let table: PolicyTable = serde_json::from_str(policy).map_err(json)?;
    table.check().map_err(fault)?;
    let automaton = table.automaton().map_err(fault)?;
    Ok(Saved::Automaton(automaton))
}

fn is_too_long(text: &str) -> bool {
    text.len() as u64 > MOST_MEBIBYTES << 20
}

/// The text in one line, with what is unseen in it, which may come from the file, made visible.
fn in_a_line(text: &str) -> String {
    let shown = |c: char| match is_unseen(c) {
        true => c.escape_unicode().to_string(),
        false => c.to_string(),
    };
    text.chars().map(shown).collect()
}
