//! KAFAQ as a course, by either of its rules.

use std::ops::ControlFlow;

use serde::{Deserialize, Serialize};

use super::settings::{Rules, Settings};
use super::task::{SOLVER, Task};
use super::{Learned, Learning, printed, tested};
use crate::error::Result;
use crate::progress::Progress;
use crate::solve::learn::{Course, Owner, fitting};

/// All that a run has to remember between two pieces of work.
// There is one at a time, so its size does not matter.
#[allow(clippy::large_enum_variant)]
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum State {
    /// By tests on evidence, epoch by epoch.
    Tested(tested::State),
    /// As in Figure 4.5, episode by episode.
    Printed(printed::State),
}

impl Course for Task<'_> {
    type Settings = Settings;
    type State = State;
    type Learning = Learning;

    fn owner(&self) -> Owner<'_, Settings> {
        Owner {
            solver: SOLVER,
            problem: &self.body().name,
            fingerprint: self.fingerprint,
            settings: &self.settings,
        }
    }

    fn start(&self) -> Result<State> {
        Ok(match self.settings.rules {
            Rules::Tested => State::Tested(tested::State::new(self)),
            Rules::Printed => State::Printed(printed::State::new(self)),
        })
    }

    /// Whether all its numbers are of this task: a checksum only tells what has been changed by chance.
    fn check(&self, state: &State) -> std::result::Result<(), String> {
        fitting(match (state, self.settings.rules) {
            (State::Tested(state), Rules::Tested) => state.fits(self),
            (State::Printed(state), Rules::Printed) => state.fits(self),
            (State::Tested(_), Rules::Printed) | (State::Printed(_), Rules::Tested) => false,
        })
    }

    fn step(&self, state: &mut State, observer: &dyn Progress) -> Result<ControlFlow<()>> {
        Ok(match state {
            State::Tested(state) => state.advance(self, observer),
            State::Printed(state) => state.advance(self, observer),
        })
    }

    fn learned(&self, state: &State) -> Learned {
        match state {
            State::Tested(state) => state.learned(self),
            State::Printed(state) => state.learned(self),
        }
    }
}
