//! bound
mod beliefs;
mod ceiling;
mod cells;
mod frame;
mod late;
mod law;
mod levels;
mod measure;
mod points;
mod step;

use crate::model::Model;
use crate::observe::Observer;

pub fn try_it(model: &Model, points: Option<usize>, observer: &dyn Observer) -> String {
    let c = ceiling::Ceiling::new(model).within(model.episode.length);
    let p = points::bound(model);
    let frame = match frame::Frame::new(model) { Ok(f) => f, Err(e) => return format!("c {c:.3} {p:?} {e}") };
    let b = beliefs::bound(&frame, points, observer).map(|f| (f.value, f.fine));
    let l = late::bound(&frame, points, observer);
    format!("c {c:.3} p {p:?} b {b:?} l {l:?}")
}
