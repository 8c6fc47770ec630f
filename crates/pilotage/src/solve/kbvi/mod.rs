//! KBVI, Kalman-based value iteration (thesis chapter 5).

pub mod branches;
pub mod closed;
mod extent;
pub mod formulas;
pub mod generate;
mod horizon;
pub mod quadratic;
