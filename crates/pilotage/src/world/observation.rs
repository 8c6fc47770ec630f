//! What a world lets be sensed.

use crate::belief::Reading;

/// Room for what is sensed, filled anew by every step.
#[derive(Debug, Clone, PartialEq)]
pub struct Observation {
    values: Vec<f64>,
    sensed: Sensed,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Sensed {
    Values,
    Symbol(u32),
    Nothing,
}

impl Observation {
    /// Room for so many readings (`m`), with nothing sensed yet.
    pub fn new(readings: usize) -> Self {
        Self {
            values: vec![0.0; readings],
            sensed: Sensed::Nothing,
        }
    }

    /// What is sensed.
    pub fn reading(&self) -> Reading<'_> {
        match self.sensed {
            Sensed::Values => Reading::Values(&self.values),
            Sensed::Symbol(symbol) => Reading::Symbol(symbol),
            Sensed::Nothing => Reading::Nothing,
        }
    }

    /// Lets numbers be sensed, `m` of them, to be written over those of before.
    pub fn values(&mut self) -> &mut [f64] {
        self.sensed = Sensed::Values;
        &mut self.values
    }

    /// Lets a signal be sensed, counted from 0.
    pub fn signal(&mut self, symbol: u32) {
        self.sensed = Sensed::Symbol(symbol);
    }

    /// Lets nothing be sensed.
    pub fn silence(&mut self) {
        self.sensed = Sensed::Nothing;
    }
}
