//! What a reading does to a sum: every Gaussian becomes one with the moments of its posterior, weighted by how well it foretold the reading.
//!
//! Where reading and noise hardly change over the width of a Gaussian, sigma points give these moments. Elsewhere the posterior itself is
//! looked at: along a line by panels, which also cut it into pieces that are Gaussian enough, in a plane by a quadrature that is moved to
//! where it is. A Gaussian in the plane that is too wide for its sensor is split before.

use super::adapt::{Room, adapt};
use super::bend::Bend;
use super::component::Component;
use super::frame::{Frame, Inner};
use super::line::pieces;
use super::regression::regress;
use super::sensor::Sensor;
use super::{Sum, SumKeeping};
use crate::belief::reading::Reading;
use crate::model::{ActionId, VariableKind};

/// Times that the line is laid anew through what is read.
const ROUNDS: usize = 4;

/// The same where points are moved from there to the posterior.
const GUESSING: usize = 2;

/// Times that a Gaussian is split for a reading.
const DEPTH: usize = 3;

/// Lighter Gaussians are not.
const LIGHT: f64 = 1e-3;

/// Gaussians that fall behind the best by so many nats need not be looked at: they will be dropped.
const HOPELESS: f64 = 20.0;

/// Pieces that a Gaussian on a line may always become.
const PIECES: usize = 4;

/// Gaussians on their way through a reading.
struct Passing {
    /// What has come out, with the logarithms of the weights.
    parts: Vec<Component>,
    logs: Vec<f64>,
    /// The best of these.
    best: f64,
    /// Room for a state, and for points of a quadrature.
    at: Vec<f64>,
    points: Room,
    /// Parts up to which Gaussians are split.
    room: usize,
    /// Pieces that a Gaussian on a line may become.
    pieces: usize,
}

impl SumKeeping {
    /// Takes in what was sensed. A reading that no Gaussian foretells leaves all as they are.
    pub(super) fn correct(
        &self,
        full: &mut Sum,
        action: ActionId,
        step: usize,
        reading: Reading<'_>,
    ) {
        let m = self.dynamics.readings();
        let (reading, seen) = match reading {
            Reading::Values(values) if self.model.laws.modes_seen => {
                let mode = values.get(m).map(|mode| *mode as usize);
                (Reading::Values(&values[..m.min(values.len())]), mode)
            }
            other => (other, None),
        };
        let count = full.components.len();
        let mut sensor = Sensor::new(self, action, step, reading);
        let mut passing = Passing {
            parts: Vec::with_capacity(count),
            logs: Vec::with_capacity(count),
            best: f64::NEG_INFINITY,
            at: vec![0.0; self.dynamics.states()],
            points: Room::default(),
            room: if self.splits {
                3 * self.most.max(count)
            } else {
                0
            },
            pieces: match self.splits {
                true => (2 * self.most / count.max(1)).max(PIECES),
                false => 1,
            },
        };
        let own = |component: &&Component| seen.is_none_or(|mode| mode == component.mode);
        for component in full.components.iter().filter(own) {
            sensor.set_mode(component.mode);
            let before = passing.parts.len();
            self.pass(component.clone(), &mut sensor, DEPTH, &mut passing);
            for part in &mut passing.parts[before..] {
                self.tidy(component, part);
            }
        }
        let Passing {
            mut parts,
            logs,
            best,
            ..
        } = passing;
        if !best.is_finite() {
            return;
        }
        for (part, log) in parts.iter_mut().zip(&logs) {
            part.weight = (log - best).exp();
        }
        parts.retain(|part| part.weight > 0.0);
        full.components = parts;
    }

    /// The mean of what has become of a Gaussian, where a state can be.
    fn tidy(&self, component: &Component, part: &mut Component) {
        self.confine(&component.mean, &component.covariance, &mut part.mean);
        if self.dynamics.kinds().contains(&VariableKind::Angle) {
            self.dynamics.wrap(&mut part.mean);
        }
    }

    /// Updates a Gaussian, split as often as that is called for.
    fn pass(
        &self,
        mut part: Component,
        sensor: &mut Sensor<'_>,
        depth: usize,
        passing: &mut Passing,
    ) {
        let weight = part.weight.ln();
        let frame = Frame::new(&part);
        if frame.rank == 0 {
            let log = sensor.log_likelihood(&part.mean);
            return passing.push(part, weight + log);
        }
        let present = sensor.present();
        if let (Reading::Nothing, Some(present)) = (sensor.reading, present) {
            return passing.push(part, weight + (1.0 - present).ln());
        }
        let Some(read) = sensor.numbers() else {
            let guess = Inner::standard(frame.rank);
            return self.look(part, sensor, &frame, guess, passing);
        };
        let bend = Bend::new(&part, sensor, &mut passing.at);
        let beyond = frame.rank > 2;
        if let Some(present) = present
            && (beyond || bend.is_straight())
        {
            let rounds = if bend.is_straight() { 1 } else { ROUNDS };
            let (inner, log) = regress(sensor, &frame, read, rounds);
            frame.write(&inner, &mut part);
            return passing.push(part, weight + present.ln() + log);
        }
        let splits = depth > 0
            && frame.rank > 1
            && part.weight > LIGHT
            && passing.parts.len() + 3 <= passing.room
            && bend.is_too_much();
        if splits {
            for narrower in part.split(bend.variable) {
                self.pass(narrower, sensor, depth - 1, passing);
            }
            return;
        }
        let rounds = if frame.rank == 1 { ROUNDS } else { GUESSING };
        let (guess, log) = regress(sensor, &frame, read, rounds);
        if weight + log < passing.best - HOPELESS {
            return;
        }
        match frame.rank == 1 && bend.is_too_much() {
            true => self.cut_up(part, sensor, &frame, &guess, passing),
            false => self.look(part, sensor, &frame, guess, passing),
        }
    }

    /// Looks at the posterior of a Gaussian from where it is guessed to be.
    fn look(
        &self,
        mut part: Component,
        sensor: &mut Sensor<'_>,
        frame: &Frame,
        guess: Inner,
        passing: &mut Passing,
    ) {
        let rule = &self.posterior[frame.rank - 1];
        // What is no number need not be smooth along the line.
        if frame.rank == 1 && sensor.numbers().is_none() {
            return self.cut_up(part, sensor, frame, &guess, passing);
        }
        let mut found = guess.clone();
        let adapted = adapt(sensor, frame, rule, &mut found, &mut passing.points);
        if frame.rank == 1 && !adapted.settled {
            return self.cut_up(part, sensor, frame, &guess, passing);
        }
        frame.write(&found, &mut part);
        let log = part.weight.ln() + adapted.log;
        passing.push(part, log);
    }

    /// Cuts what becomes of a Gaussian on a line into pieces.
    fn cut_up(
        &self,
        part: Component,
        sensor: &mut Sensor<'_>,
        frame: &Frame,
        guess: &Inner,
        passing: &mut Passing,
    ) {
        let (log, found) = pieces(sensor, frame, guess, passing.pieces);
        for (share, inner) in found {
            let mut piece = part.clone();
            frame.write(&inner, &mut piece);
            passing.push(piece, part.weight.ln() + log + share.ln());
        }
    }
}

impl Passing {
    fn push(&mut self, part: Component, log: f64) {
        if log > f64::NEG_INFINITY {
            self.best = self.best.max(log);
            self.parts.push(part);
            self.logs.push(log);
        }
    }
}
