//! The functions of an expression.

use super::tape::{Binary, Tape, Unary};
use crate::model::error::suggest;

/// What a function does with its arguments.
#[derive(Debug, Clone, Copy)]
pub(super) enum Call {
    One(Unary),
    Two(Binary),
    /// Two or more, from left to right.
    Many(Binary),
    Clamp,
    If,
}

/// A function by name, and how its arguments are called.
pub(super) type Function = (&'static str, &'static str, Call);

pub(super) const FUNCTIONS: [Function; 21] = [
    ("abs", "x", Call::One(Unary::Abs)),
    ("sqrt", "x", Call::One(Unary::Sqrt)),
    ("exp", "x", Call::One(Unary::Exp)),
    ("ln", "x", Call::One(Unary::Ln)),
    ("log10", "x", Call::One(Unary::Log10)),
    ("sin", "x", Call::One(Unary::Sin)),
    ("cos", "x", Call::One(Unary::Cos)),
    ("tan", "x", Call::One(Unary::Tan)),
    ("asin", "x", Call::One(Unary::Asin)),
    ("acos", "x", Call::One(Unary::Acos)),
    ("atan", "x", Call::One(Unary::Atan)),
    ("atan2", "y, x", Call::Two(Binary::Atan2)),
    ("hypot", "x, y", Call::Two(Binary::Hypot)),
    ("min", "x, y, ...", Call::Many(Binary::Min)),
    ("max", "x, y, ...", Call::Many(Binary::Max)),
    ("pow", "x, y", Call::Two(Binary::Power)),
    ("sign", "x", Call::One(Unary::Sign)),
    ("floor", "x", Call::One(Unary::Floor)),
    ("round", "x", Call::One(Unary::Round)),
    ("clamp", "x, low, high", Call::Clamp),
    ("if", "condition, then, else", Call::If),
];

impl Call {
    /// Least number of arguments, and how many it takes in words.
    pub(super) fn takes(self) -> (usize, &'static str) {
        match self {
            Self::One(_) => (1, "1 argument"),
            Self::Two(_) => (2, "2 arguments"),
            Self::Many(_) => (2, "2 or more arguments"),
            Self::Clamp | Self::If => (3, "3 arguments"),
        }
    }

    /// Does what can be done once so many arguments are there.
    pub(super) fn take(self, count: usize, tape: &mut Tape) {
        match (self, count) {
            (Self::One(unary), 1) => tape.unary(unary),
            (Self::Two(binary), 2) | (Self::Many(binary), 2..) => tape.binary(binary),
            (Self::Clamp, 2) => tape.binary(Binary::Max),
            (Self::Clamp, 3) => tape.binary(Binary::Min),
            (Self::If, 3) => tape.choose(),
            _ => {}
        }
    }
}

/// A hint towards the function that was meant by an unknown name.
pub(super) fn meant(name: &str) -> String {
    match name {
        "log" => "write `ln(x)`, or `log10(x)` for base 10".to_owned(),
        _ => suggest(name, FUNCTIONS.iter().map(|(known, ..)| *known)),
    }
}
