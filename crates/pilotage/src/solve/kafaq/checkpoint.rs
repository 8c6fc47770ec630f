//! Checkpoints: the state of a learning run as a file, whole or not at all.
//!
//! Two lines of JSON. The first says whose run it is and has a checksum of the second, which is the state.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::settings::Settings;
use super::task::{SOLVER, Task, Worlds};
use super::{Run, State};
use crate::error::{Error, Result};
use crate::model::Model;
use crate::policy::write_whole;

/// Version of the file format.
const FORMAT: u32 = 1;

#[derive(Serialize, Deserialize)]
struct Header {
    checkpoint: u32,
    pilotage: String,
    solver: String,
    problem: String,
    fingerprint: u64,
    settings: Settings,
    checksum: u64,
}

impl<'a> Run<'a> {
    /// Writes the state of the run. Whatever happens, the file is then the old checkpoint or the new one.
    ///
    /// # Errors
    /// [`Error::Io`]; the old file is then untouched.
    pub fn save(&self, path: &Path) -> Result<()> {
        let fail = |error: serde_json::Error| Error::Io {
            path: path.to_owned(),
            source: error.into(),
        };
        let state = serde_json::to_string(&self.state).map_err(fail)?;
        let header = Header {
            checkpoint: FORMAT,
            pilotage: env!("CARGO_PKG_VERSION").to_owned(),
            solver: SOLVER.to_owned(),
            problem: self.task.mdp.model().name.clone(),
            fingerprint: self.task.fingerprint,
            settings: self.task.settings.clone(),
            checksum: checksum(&state),
        };
        let header = serde_json::to_string(&header).map_err(fail)?;
        write_whole(path, format!("{header}\n{state}\n").as_bytes())
    }

    /// Goes on with a run of the same model and settings.
    ///
    /// # Errors
    /// [`Error::Checkpoint`] for a file of another model, version, solver or other settings, and for a damaged one; [`Error::Io`] for one that
    /// cannot be read. The file is not touched.
    pub fn resume(
        model: &Model,
        worlds: &'a Worlds<'a>,
        settings: &Settings,
        path: &Path,
    ) -> Result<Self> {
        let bytes = std::fs::read(path).map_err(|source| Error::Io {
            path: path.to_owned(),
            source,
        })?;
        let task = Task::new(model, settings.clone(), worlds)?;
        let state = read(&bytes, &task).map_err(|reason| Error::Checkpoint {
            path: path.to_owned(),
            reason,
        })?;
        Ok(Self { task, state })
    }
}

fn read(bytes: &[u8], task: &Task<'_>) -> std::result::Result<State, String> {
    let damaged = |what: &str| format!("damaged checkpoint: {what}; delete it to start afresh");
    let text = std::str::from_utf8(bytes).map_err(|_| damaged("it is not text"))?;
    let (header, state) = text
        .split_once('\n')
        .ok_or_else(|| damaged("it ends too early"))?;
    // The version comes first: another version may have other keys.
    let value: serde_json::Value = serde_json::from_str(header)
        .map_err(|error| format!("not a checkpoint of pilotage ({error})"))?;
    let format = value.get("checkpoint").and_then(serde_json::Value::as_u64);
    let version = value.get("pilotage").and_then(serde_json::Value::as_str);
    let this = env!("CARGO_PKG_VERSION");
    match (format, version) {
        (Some(format), Some(version)) if format == u64::from(FORMAT) && version == this => {}
        (Some(format), Some(version)) => {
            return Err(format!(
                "checkpoint format {format} of pilotage {version}; this is pilotage {this}, which goes on with its own, format {FORMAT}; \
                 finish with that version or delete the file to start afresh"
            ));
        }
        _ => return Err("not a checkpoint of pilotage".to_owned()),
    }
    let solver = value
        .get("solver")
        .and_then(serde_json::Value::as_str)
        .unwrap_or("");
    if solver != SOLVER {
        return Err(format!(
            "a checkpoint of the solver `{solver}`, not of `{SOLVER}`"
        ));
    }
    let header: Header =
        serde_json::from_value(value).map_err(|error| damaged(&error.to_string()))?;
    let model = task.mdp.model();
    if header.problem != model.name {
        return Err(format!(
            "a checkpoint of the problem {}, not of {}",
            header.problem, model.name
        ));
    }
    if header.fingerprint != task.fingerprint {
        return Err(format!(
            "{} has changed since this checkpoint was written; delete it to start afresh",
            model.name
        ));
    }
    if header.settings != task.settings {
        return Err("a checkpoint of a run with other settings or another seed; resume with those, or delete it to start afresh".to_owned());
    }
    let state = state
        .strip_suffix('\n')
        .ok_or_else(|| damaged("it ends too early"))?;
    if checksum(state) != header.checksum {
        return Err(damaged("its checksum is wrong"));
    }
    serde_json::from_str(state).map_err(|error| damaged(&error.to_string()))
}

/// FNV-1a.
fn checksum(text: &str) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}
