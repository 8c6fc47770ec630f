//! What an agent knows of itself, whatever the world it acts in.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Event, Model, ModelText, StartHypothesis, Then};

/// How much of what a text says a model is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Part {
    /// All of it.
    #[default]
    Whole,
    /// What a learner is told of it: how it moves and senses, where it starts, and modes only as far as these depend on them.
    Body,
}

impl Model {
    /// The part of a model that a learner is told: how it moves and senses, the world's outer bounds, where it starts and how long
    /// episodes are, but neither rewards nor map nor events.
    ///
    /// Modes that change what is paid only are unknown to it. Where motion or sensing depend on the mode, or modes are seen, they are part
    /// of how it moves and senses, and so is what changes them.
    pub fn body(&self) -> Self {
        let feels = self.feels_modes();
        let unpaid = |event: &Event| Event {
            reward: 0.0,
            then: Then::Continue,
            ..event.clone()
        };
        let changes = self.events.iter().filter(|event| event.becomes.is_some());
        let start = |start: &StartHypothesis| StartHypothesis {
            mode: if feels { start.mode } else { 0 },
            ..start.clone()
        };
        Self {
            modes: match feels {
                true => self.modes.clone(),
                false => vec![String::new()],
            },
            start: self.start.iter().map(start).collect(),
            rewards: Vec::new(),
            events: match feels {
                true => changes.map(unpaid).collect(),
                false => Vec::new(),
            },
            cost: None,
            map: None,
            text: ModelText {
                part: Part::Body,
                ..self.text.clone()
            },
            ..self.clone()
        }
    }

    /// Whether motion or sensing depend on the mode, or it is seen.
    fn feels_modes(&self) -> bool {
        self.laws.modes_seen || self.laws.cases.iter().any(|case| case.modes.is_some())
    }
}
