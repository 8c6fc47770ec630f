//! What is sensed: numbers, a signal, or nothing.

/// What was sensed after a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reading<'a> {
    /// Numbers: the `m` readings of the sensor.
    Values(&'a [f64]),
    /// One of finitely many signals, counted from 0. A filter that knows numbers only hears nothing in it.
    Symbol(u32),
    /// Nothing: the sensor was silent, or what it said was lost.
    Nothing,
}

impl<'a> Reading<'a> {
    /// The numbers, where there are some.
    pub fn values(self) -> Option<&'a [f64]> {
        match self {
            Self::Values(values) => Some(values),
            Self::Symbol(_) | Self::Nothing => None,
        }
    }
}

impl<'a> From<&'a [f64]> for Reading<'a> {
    fn from(values: &'a [f64]) -> Self {
        Self::Values(values)
    }
}

impl<'a, const M: usize> From<&'a [f64; M]> for Reading<'a> {
    fn from(values: &'a [f64; M]) -> Self {
        Self::Values(values)
    }
}

impl<'a> From<&'a Vec<f64>> for Reading<'a> {
    fn from(values: &'a Vec<f64>) -> Self {
        Self::Values(values)
    }
}
