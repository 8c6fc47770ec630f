//! bound
mod beliefs;
mod ceiling;
mod frame;
mod law;
mod levels;
mod points;
mod step;

use crate::model::Model;
use crate::observe::Observer;

pub fn try_it(
    model: &Model,
    points: Option<usize>,
    observer: &dyn Observer,
) -> Result<f64, String> {
    if let Ok(v) = points::bound(model) {
        return Ok(v);
    }
    let frame = frame::Frame::new(model)?;
    beliefs::bound(&frame, points, observer).map(|f| f.value)
}
