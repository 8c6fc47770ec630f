//! Checkpoints: the state of a learning run as a file, whole or not at all.
//!
//! Two lines of JSON. The first says whose run it is and has a checksum of the second, which is the state.

use std::path::Path;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::digest::Digest;
use crate::error::{Error, Result};
use crate::files::{self, write_whole};
use crate::model::Fingerprint;

/// Version of the file format.
const FORMAT: u64 = 2;

/// Longest checkpoint that is read, MiB.
const MOST_MEBIBYTES: u64 = 1024;

#[derive(Serialize, Deserialize)]
struct Header<S> {
    checkpoint: u64,
    pilotage: String,
    solver: String,
    problem: String,
    fingerprint: Fingerprint,
    settings: S,
    checksum: String,
}

/// Whose run a checkpoint is.
pub struct Owner<'a, S> {
    /// Name of the learner.
    pub solver: &'static str,
    /// Name of the problem.
    pub problem: &'a str,
    /// Fingerprint of the problem.
    pub fingerprint: Fingerprint,
    /// Settings of the learner, its seed among them.
    pub settings: &'a S,
}

impl<S: Clone + PartialEq + Serialize + DeserializeOwned> Owner<'_, S> {
    /// Writes the state of a run. Whatever happens, the file is then the old checkpoint or the new one.
    pub fn save(&self, state: &impl Serialize, path: &Path) -> Result<()> {
        let fail = |error: serde_json::Error| Error::Io {
            path: path.to_owned(),
            source: error.into(),
        };
        let state = serde_json::to_string(state).map_err(fail)?;
        let header = Header {
            checkpoint: FORMAT,
            pilotage: env!("CARGO_PKG_VERSION").to_owned(),
            solver: self.solver.to_owned(),
            problem: self.problem.to_owned(),
            fingerprint: self.fingerprint,
            settings: self.settings.clone(),
            checksum: Digest::of(&state).to_string(),
        };
        let header = serde_json::to_string(&header).map_err(fail)?;
        write_whole(path, format!("{header}\n{state}\n").as_bytes())
    }

    /// Reads the state of a run of this owner.
    pub(crate) fn load<T: DeserializeOwned>(&self, path: &Path) -> Result<T> {
        let refuse = |reason: String| Error::Checkpoint {
            path: path.to_owned(),
            reason,
        };
        if !path.is_file() {
            let reason = "a checkpoint is read and written again and again, and this is no file; give the name of one";
            return Err(refuse(reason.to_owned()));
        }
        let bytes = files::read(path, MOST_MEBIBYTES).map_err(|source| Error::Io {
            path: path.to_owned(),
            source,
        })?;
        self.read(&bytes).map_err(refuse)
    }

    fn read<T: DeserializeOwned>(&self, bytes: &[u8]) -> std::result::Result<T, String> {
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
            (Some(format), Some(version)) if format == FORMAT && version == this => {}
            (Some(format), Some(version)) => {
                let version = version.escape_debug();
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
        if solver != self.solver {
            return Err(format!(
                "a checkpoint of the solver `{}`, not of `{}`",
                solver.escape_debug(),
                self.solver
            ));
        }
        let header: Header<S> =
            serde_json::from_value(value).map_err(|error| damaged(&error.to_string()))?;
        if header.problem != self.problem {
            return Err(format!(
                "a checkpoint of the problem {}, not of {}",
                header.problem.escape_debug(),
                self.problem
            ));
        }
        if header.fingerprint != self.fingerprint {
            return Err(format!(
                "{} has changed since this checkpoint was written; delete it to start afresh",
                self.problem
            ));
        }
        if header.settings != *self.settings {
            return Err("a checkpoint of a run with other settings or another seed; resume with those, or delete it to start afresh".to_owned());
        }
        let state = state
            .strip_suffix('\n')
            .ok_or_else(|| damaged("it ends too early"))?;
        if Digest::of(state).to_string() != header.checksum {
            return Err(damaged("its checksum is wrong"));
        }
        serde_json::from_str(state).map_err(|error| damaged(&error.to_string()))
    }
}
