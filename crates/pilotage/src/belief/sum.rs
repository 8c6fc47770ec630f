//! stub
use super::*;
use crate::error::Result;
use crate::model::*;
/// stub
#[derive(Debug, Clone)]
pub struct Sum {}
/// stub
#[derive(Debug)]
pub struct SumKeeping {}
impl SumKeeping {
    /// stub
    pub fn new(_m: &Model) -> Self {
        Self {}
    }
}
impl Keeping for SumKeeping {
    type Full = Sum;
    fn actions(&self) -> usize {
        0
    }
    fn start(&self) -> Sum {
        Sum {}
    }
    fn act(&self, _f: &mut Sum, _a: ActionId, _s: usize) -> Acted {
        Acted::default()
    }
    fn readings(&self, _f: &Sum, _a: ActionId, _s: usize, _m: usize) -> Vec<(f64, Sensed)> {
        Vec::new()
    }
    fn sense(&self, _f: &mut Sum, _a: ActionId, _s: usize, _r: Reading<'_>) {}
    fn moments(&self, _f: &Sum, _m: &mut Moments) {}
    fn with_moments(&self, _m: &Moments) -> Sum {
        Sum {}
    }
    fn moved_to(&self, _f: &Sum, _m: &[f64]) -> Sum {
        Sum {}
    }
}
