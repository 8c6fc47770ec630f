//! Automata as files: versioned JSON, written whole or not at all.

use std::io::Write;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::model::Model;
use crate::policy::{Automaton, Node, Place};

/// Version of the file format; a file of another is refused.
const FORMAT: u32 = 1;

#[derive(Serialize, Deserialize)]
struct Header {
    format: u32,
    pilotage: String,
}

#[derive(Serialize, Deserialize)]
struct File {
    #[serde(flatten)]
    header: Header,
    automaton: Automaton,
}

impl Automaton {
    /// The automaton as the text of a policy file.
    pub fn to_json(&self) -> Result<String> {
        let header = Header {
            format: FORMAT,
            pilotage: env!("CARGO_PKG_VERSION").to_owned(),
        };
        serde_json::to_string_pretty(&File {
            header,
            automaton: self.clone(),
        })
        .map_err(|error| Error::Policy {
            origin: self.problem.clone(),
            reason: format!("the policy cannot be written as JSON: {error}"),
        })
    }

    /// Reads the text of a policy file; `origin` names it in errors.
    ///
    /// # Errors
    /// [`Error::Policy`] for text that is no policy file, of another format, or whose numbers do not fit together.
    pub fn from_json(text: &str, origin: &str) -> Result<Self> {
        let fail = |reason: String| Error::Policy {
            origin: origin.to_owned(),
            reason,
        };
        let header: Header =
            serde_json::from_str(text).map_err(|error| fail(format!("not a policy file of pilotage ({error}); make one with `pilotage solve PROBLEM --out FILE`")))?;
        if header.format != FORMAT {
            return Err(fail(format!(
                "policy format {} was written by pilotage {}; this is pilotage {} and reads format {FORMAT}; solve again to renew it",
                header.format,
                header.pilotage,
                env!("CARGO_PKG_VERSION")
            )));
        }
        let file: File = serde_json::from_str(text).map_err(|error| {
            fail(format!(
                "damaged policy file: {error}; solve again to renew it"
            ))
        })?;
        file.automaton.check().map_err(fail)?;
        Ok(file.automaton)
    }

    /// Reads a policy file.
    ///
    /// # Errors
    /// [`Error::Io`] where it cannot be read as text, otherwise as [`Automaton::from_json`].
    pub fn load(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).map_err(|source| Error::Io {
            path: path.to_owned(),
            source,
        })?;
        Self::from_json(&text, &path.display().to_string())
    }

    /// Writes a policy file, whole or not at all.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn save(&self, path: &Path) -> Result<()> {
        write_whole(path, self.to_json()?.as_bytes())
    }

    /// Whether it was made for this very problem.
    ///
    /// # Errors
    /// [`Error::Policy`] naming both problems where not.
    pub fn check_problem(&self, model: &Model, origin: &str) -> Result<()> {
        let reason = if self.problem != model.name {
            format!(
                "this policy is for {}, not for {}; solve {} to get one",
                self.problem, model.name, model.name
            )
        } else if !self.fingerprint.comparable(&model.fingerprint()) {
            format!(
                "this policy names its problem by the fingerprint {}, which this version cannot compare with that of {}, {}; solve it again",
                self.fingerprint,
                model.name,
                model.fingerprint()
            )
        } else if self.fingerprint != model.fingerprint() {
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

    /// Whether it can act in the world of a model, be it made for another one: the same actions and state variables in the same order, and
    /// as many readings.
    ///
    /// # Errors
    /// [`Error::Policy`] with the first difference.
    pub fn check_world(&self, world: &Model, origin: &str) -> Result<()> {
        let fail = |what: &str, own: &[String], others: Vec<&str>| Error::Policy {
            origin: origin.to_owned(),
            reason: format!(
                "this policy has the {what} {}, and the world of {} has {}; choose a world with the same",
                own.join(", "),
                world.name,
                others.join(", ")
            ),
        };
        let actions: Vec<&str> = world.actions.iter().map(|a| a.name.as_str()).collect();
        if self.actions != actions {
            return Err(fail("actions", &self.actions, actions));
        }
        let states: Vec<&str> = world.state.iter().map(|v| v.name.as_str()).collect();
        if self.states != states {
            return Err(fail("state variables", &self.states, states));
        }
        if self.filter.readings() != world.observation_dim() {
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

    fn check(&self) -> std::result::Result<(), String> {
        let fault = self.filter_fault().map(str::to_owned).or_else(|| {
            let nodes = self.nodes.iter().enumerate();
            nodes
                .filter_map(|(id, node)| Some(format!("node {id} {}", self.node_fault(node)?)))
                .next()
        });
        fault.map_or(Ok(()), |fault| {
            Err(format!("{fault}; solve again to renew the file"))
        })
    }

    fn filter_fault(&self) -> Option<&'static str> {
        let n = self.states.len();
        let sizes = (self.levels.len(), self.actions.len(), self.modes.len());
        if self.filter.states() != n || !self.filter.fits(sizes.0, sizes.1, sizes.2) {
            return Some("the filter does not fit the states, levels and actions");
        }
        let coordinates = self.coordinates.as_ref();
        if coordinates.is_some_and(|coordinates| !coordinates.fits(n)) {
            return Some("the coordinates are not named vectors of the state");
        }
        let places = self.place_names().len();
        if self.scale.len() != places || !self.scale.iter().all(|s| *s > 0.0 && s.is_finite()) {
            return Some("the scale is not one positive number for each state variable");
        }
        let square = |level: &Vec<f64>| level.len() == n * n && level.iter().all(|p| p.is_finite());
        if !self.levels.iter().all(square) {
            return Some("a level is not a covariance of the state");
        }
        None
    }

    fn node_fault(&self, node: &Node) -> Option<String> {
        let n = self.place_names().len();
        let fits =
            |values: &[f64]| values.len() == n && values.iter().all(|value| value.is_finite());
        let place_fits = match &node.place {
            Place::Point(point) => fits(point),
            Place::Segment {
                lower,
                minimum,
                upper,
            } => fits(lower) && fits(minimum) && fits(upper),
        };
        if !place_fits {
            return Some(format!("does not have {n} finite coordinates"));
        }
        if let Place::Segment {
            lower,
            minimum,
            upper,
        } = &node.place
            && !(0..n).all(|i| lower[i] <= minimum[i] && minimum[i] <= upper[i])
        {
            return Some("is a segment whose point of least value lies outside it".to_owned());
        }
        if node.action >= self.actions.len()
            || node.mode >= self.modes.len()
            || node.levels.1 >= self.levels.len()
            || node.levels.0 > node.levels.1
        {
            return Some("names an action, mode or level that is not there".to_owned());
        }
        let stranger = node
            .predecessors
            .iter()
            .find(|(id, _)| *id >= self.nodes.len());
        stranger.map(|(id, _)| format!("names predecessor {id}, which is not there"))
    }
}

/// Writes a file so that its name always stands for a whole file: the old one or the new one.
///
/// # Errors
/// [`Error::Io`]; the old file is then untouched.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<()> {
    let fail = |source| Error::Io {
        path: path.to_owned(),
        source,
    };
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let mut file = beside(folder).map_err(fail)?;
    file.write_all(bytes)
        .and_then(|()| file.as_file().sync_all())
        .map_err(fail)?;
    file.persist(path)
        .map(drop)
        .map_err(|error| fail(error.error))
}

/// A temporary file that anyone may read who may read others made here: a result is no secret.
#[cfg(unix)]
fn beside(folder: &Path) -> std::io::Result<tempfile::NamedTempFile> {
    use std::os::unix::fs::PermissionsExt;
    tempfile::Builder::new()
        .permissions(std::fs::Permissions::from_mode(0o666))
        .tempfile_in(folder)
}

#[cfg(not(unix))]
fn beside(folder: &Path) -> std::io::Result<tempfile::NamedTempFile> {
    tempfile::NamedTempFile::new_in(folder)
}
