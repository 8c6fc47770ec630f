//! stub
use super::*;
use crate::error::Result;
use crate::model::*;
/// stub
#[derive(Debug, Clone)]
pub struct Cells {}
/// stub
#[derive(Debug)]
pub struct CellsKeeping {}
impl CellsKeeping {
    /// stub
    pub fn new(_m: &Model) -> Result<Self> {
        Ok(Self {})
    }
}
impl Keeping for CellsKeeping {
    type Full = Cells;
    fn actions(&self) -> usize {
        0
    }
    fn start(&self) -> Cells {
        Cells {}
    }
    fn act(&self, _f: &mut Cells, _a: ActionId, _s: usize) -> Acted {
        Acted::default()
    }
    fn readings(&self, _f: &Cells, _a: ActionId, _s: usize, _m: usize) -> Vec<(f64, Sensed)> {
        Vec::new()
    }
    fn sense(&self, _f: &mut Cells, _a: ActionId, _s: usize, _r: Reading<'_>) {}
    fn moments(&self, _f: &Cells, _m: &mut Moments) {}
    fn with_moments(&self, _m: &Moments) -> Cells {
        Cells {}
    }
    fn moved_to(&self, _f: &Cells, _m: &[f64]) -> Cells {
        Cells {}
    }
}
