//! Findings kept between runs, so that a reproduction that was interrupted goes on where it stopped.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::Path;

use pilotage::policy::write_whole;
use pilotage_report::Finding;
use serde::{Deserialize, Serialize};

use crate::failure::Failure;

/// What a finding depends on besides its name: the settings of the run, and all the code that makes it.
pub struct Maker {
    seed: u64,
    quick: bool,
    /// A number that changes with this very program: its own code, that of its dependencies, the models in it, and how it was
    /// compiled. `None` where the program cannot be read, so that what it made could not be told from what another one made.
    program: Option<u64>,
}

/// A finding as it is kept.
#[derive(Serialize, Deserialize)]
struct Kept {
    /// A hash of the finding and of all that it depends on. Only the program that made it can check it, so that it does not matter that
    /// another version of the standard library hashes otherwise.
    seal: String,
    finding: Finding,
}

impl Maker {
    /// The program that runs.
    pub fn new(seed: u64, quick: bool) -> Self {
        Self {
            seed,
            quick,
            program: program().ok(),
        }
    }

    /// What an earlier run of the same program, seed and length has found under this name. Whatever has been changed since, and
    /// whatever another program made, is not believed.
    pub fn find(&self, file: &Path, id: &str) -> Option<Finding> {
        let text = std::fs::read_to_string(file).ok()?;
        let kept: Kept = serde_json::from_str(&text).ok()?;
        let own = kept.finding.id == id && kept.seal == self.seal(&kept.finding)?;
        own.then_some(kept.finding)
    }

    /// Keeps a finding for the next run, if that can tell whose it is.
    pub fn keep(&self, file: &Path, finding: &Finding) -> Result<(), Failure> {
        let Some(seal) = self.seal(finding) else {
            return Ok(());
        };
        let finding = finding.clone();
        let text = serde_json::to_string_pretty(&Kept { seal, finding })
            .map_err(|error| Failure::Output(error.into()))?;
        Ok(write_whole(file, text.as_bytes())?)
    }

    fn seal(&self, finding: &Finding) -> Option<String> {
        let mut hasher = DefaultHasher::new();
        (self.program?, self.seed, self.quick).hash(&mut hasher);
        serde_json::to_string(finding).ok()?.hash(&mut hasher);
        Some(format!("{:016x}", hasher.finish()))
    }
}

/// The number of the program that runs.
fn program() -> std::io::Result<u64> {
    // On Linux by its own name: the file may have been replaced since the program was started.
    let running = Path::new("/proc/self/exe");
    let bytes = match std::fs::read(running) {
        Ok(bytes) => bytes,
        Err(_) => std::fs::read(std::env::current_exe()?)?,
    };
    let mut hasher = DefaultHasher::new();
    bytes.hash(&mut hasher);
    Ok(hasher.finish())
}

#[cfg(test)]
mod tests {
    use std::fs;

    use pilotage_report::{Figure, Table, Verdict};

    use super::*;

    fn finding() -> Finding {
        Finding {
            id: "table-9.9".to_owned(),
            title: "Title".to_owned(),
            thesis: "What it says".to_owned(),
            tables: vec![Table {
                caption: "Numbers".to_owned(),
                columns: vec!["here".to_owned()],
                rows: vec![vec!["17".to_owned()]],
            }],
            figures: vec![Figure {
                caption: "Picture".to_owned(),
                svg: "<svg/>".to_owned(),
            }],
            verdict: Verdict::Contradicted,
            why: "Because".to_owned(),
        }
    }

    fn maker(seed: u64, quick: bool, program: Option<u64>) -> Maker {
        Maker {
            seed,
            quick,
            program,
        }
    }

    #[test]
    fn only_the_same_maker_believes_what_was_kept() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("table-9.9.json");
        let own = maker(1, true, Some(5));
        own.keep(&file, &finding()).ok().unwrap();
        assert_eq!(own.find(&file, "table-9.9"), Some(finding()));
        assert_eq!(own.find(&file, "table-9.8"), None, "another's name");
        for (what, other) in [
            ("seed", maker(2, true, Some(5))),
            ("length", maker(1, false, Some(5))),
            ("program", maker(1, true, Some(6))),
            ("no program", maker(1, true, None)),
        ] {
            assert_eq!(other.find(&file, "table-9.9"), None, "{what}");
        }
        let running = || Maker::new(1, true).program;
        assert!(running().is_some() && running() == running());
    }

    #[test]
    fn who_cannot_tell_what_it_is_keeps_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("table-9.9.json");
        maker(1, true, None).keep(&file, &finding()).ok().unwrap();
        assert!(!file.exists());
    }

    #[test]
    fn no_edit_is_believed() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("table-9.9.json");
        let own = maker(1, true, Some(5));
        own.keep(&file, &finding()).ok().unwrap();
        let whole = fs::read_to_string(&file).unwrap();
        for (old, new) in [
            ("table-9.9", "table-9.8"),
            ("Title", "title"),
            ("it says", "it does not say"),
            ("Numbers", "Others"),
            ("here", "there"),
            ("17", "18"),
            ("Picture", ""),
            ("<svg/>", "<svg><script/></svg>"),
            ("contradicted", "reproduced"),
            ("Because", "For"),
            ("\"seal\": \"", "\"seal\": \"0"),
            ("{", ""),
        ] {
            let edited = whole.replacen(old, new, 1);
            assert_ne!(edited, whole, "{old}");
            fs::write(&file, edited).unwrap();
            for id in ["table-9.9", "table-9.8"] {
                assert_eq!(own.find(&file, id), None, "{old}");
            }
        }
        fs::write(&file, &whole).unwrap();
        assert_eq!(own.find(&file, "table-9.9"), Some(finding()));
    }
}
