//! A two-wheeled robot that carries out abstract actions in a walled arena, standing in for the simulator of thesis 4.3.
//!
//! An action names a displacement. The low-level controller turns the robot to that direction, forward or backward, whichever is
//! nearer, and drives the distance by its wheel encoders, holding the heading by compass. Encoders do not see that wheels slip.
//! Where it is, it tells from the distances to the outer walls that its four range finders report.

use std::f64::consts::{FRAC_PI_2, PI};

use super::{Body, Doing, Observation};
use crate::model::Model;
use crate::random::{Rng, normal};
use crate::scenario::{Robot, Scenario};

/// How fast a deviation of the heading is turned back, per second.
const GAIN: f64 = 4.0;
/// Headings closer than this are held well enough, rad.
const ALIGNED: f64 = 0.02;
/// A turn or drive may take this many times as long as without slip; then the controller gives up.
const PATIENCE: f64 = 4.0;

/// The robot of a scenario, driven by the displacement that each action names.
#[derive(Debug, Clone)]
pub(super) struct Driven {
    arena: RobotArena,
    /// By action, in units of state, length `n`.
    displacements: Vec<Vec<f64>>,
}

impl Driven {
    pub(crate) fn new(scenario: &Scenario, robot: &Robot) -> Self {
        let model = &scenario.model;
        let actions = 0..model.actions.len();
        Self {
            arena: RobotArena::new(robot, model),
            displacements: actions
                .map(|action| model.displacement(action, 0).as_slice().to_vec())
                .collect(),
        }
    }
}

impl Body for Driven {
    fn put(&mut self, state: &mut [f64]) {
        self.arena.put(state);
    }

    fn advance(&mut self, doing: Doing, _: &[f64], to: &mut [f64], rng: &mut Rng) {
        self.arena
            .carry_out(&self.displacements[doing.action], to, rng);
    }

    fn sense(&self, _: Doing, _: &[f64], observation: &mut Observation, rng: &mut Rng) {
        let observation = observation.values();
        self.arena.sense(observation, rng);
    }
}

/// The robot in its arena.
#[derive(Debug, Clone)]
pub(crate) struct RobotArena {
    robot: Robot,
    /// Extent east and north, m.
    arena: [f64; 2],
    /// Lower bounds of the state.
    low: Vec<f64>,
    /// Middle of the body from the lower corner of the arena, m.
    place: [f64; 2],
    /// Direction of the front, anticlockwise from east, rad.
    heading: f64,
}

impl RobotArena {
    /// The robot of a model, in the middle of its arena, facing east.
    pub(crate) fn new(robot: &Robot, model: &Model) -> Self {
        let arena = robot.arena(model);
        Self {
            robot: robot.clone(),
            arena,
            low: model
                .state
                .iter()
                .map(|variable| variable.bounds.low)
                .collect(),
            place: arena.map(|width| 0.5 * width),
            heading: 0.0,
        }
    }

    /// Puts the robot down facing east, as near to a state (length `n`) as walls allow, and writes where that is.
    pub(crate) fn put(&mut self, state: &mut [f64]) {
        self.place = self.arena.map(|width| 0.5 * width);
        for (i, (x, low)) in state.iter().zip(&self.low).enumerate() {
            self.place[i] = (x - low) * self.robot.cell;
        }
        self.heading = 0.0;
        self.stop_at_walls();
        self.write(state);
    }

    /// Carries out a displacement in units of state (length `n`) and writes the state reached.
    pub(crate) fn carry_out(&mut self, displacement: &[f64], state: &mut [f64], rng: &mut Rng) {
        let along = |i: usize| displacement.get(i).map_or(0.0, |d| d * self.robot.cell);
        let (east, north) = (along(0), along(1));
        let distance = east.hypot(north);
        let grip = [0, 1].map(|_| (1.0 + self.robot.slip * normal(rng)).max(0.0));
        if distance > 0.0 {
            let mut target = north.atan2(east);
            let mut forward = 1.0;
            if wrapped(target - self.heading).abs() > FRAC_PI_2 {
                (target, forward) = (target + PI, -1.0);
            }
            self.turn(target, grip, rng);
            self.drive(target, forward * distance, grip, rng);
        }
        self.write(state);
    }

    /// Turns on the spot until the compass shows the target.
    fn turn(&mut self, target: f64, grip: [f64; 2], rng: &mut Rng) {
        let Robot {
            axle, speed, tick, ..
        } = self.robot;
        let mut left = PATIENCE * (PI * axle / speed + 1.0 / GAIN);
        while left > 0.0 {
            let error = self.deviation(target, rng);
            if error.abs() < ALIGNED {
                break;
            }
            let wheel = (0.5 * axle * GAIN * error).clamp(-speed, speed);
            self.roll([-wheel, wheel], grip);
            left -= tick;
        }
    }

    /// Drives a distance, negative for backward, by its encoders.
    fn drive(&mut self, heading: f64, distance: f64, grip: [f64; 2], rng: &mut Rng) {
        let Robot {
            axle, speed, tick, ..
        } = self.robot;
        let mut left = distance.abs();
        // What is left may be so little that a speed for it is no number above 0.
        while left / tick > 0.0 {
            let steer = 0.5 * axle * GAIN * self.deviation(heading, rng);
            // Steering takes its share of the top speed.
            let steer = steer.clamp(-0.5 * speed, 0.5 * speed);
            let ahead = (speed - steer.abs()).min(left / tick);
            let wheels = distance.signum() * ahead;
            self.roll([wheels - steer, wheels + steer], grip);
            left -= ahead * tick;
        }
    }

    /// The turn that the compass asks for.
    fn deviation(&self, target: f64, rng: &mut Rng) -> f64 {
        wrapped(target - self.heading - self.robot.compass_noise * normal(rng))
    }

    /// Rolls both wheels, left and right, for a tick. Walls stop the body; wheels then slip.
    fn roll(&mut self, wheels: [f64; 2], grip: [f64; 2]) {
        let Robot { axle, tick, .. } = self.robot;
        let [left, right] = [0, 1].map(|i| wheels[i] * grip[i] * tick);
        let (ahead, turn) = (0.5 * (left + right), (right - left) / axle);
        let (sin, cos) = (self.heading + 0.5 * turn).sin_cos();
        self.place[0] += ahead * cos;
        self.place[1] += ahead * sin;
        self.heading = wrapped(self.heading + turn);
        self.stop_at_walls();
    }

    fn stop_at_walls(&mut self) {
        let radius = self.robot.radius;
        for (x, width) in self.place.iter_mut().zip(self.arena) {
            *x = x.clamp(radius, width - radius);
        }
    }

    fn write(&self, state: &mut [f64]) {
        for ((x, low), place) in state.iter_mut().zip(&self.low).zip(self.place) {
            *x = low + place / self.robot.cell;
        }
    }

    /// Writes where the robot takes itself to be along every variable (length `n`): the mean of what the finders that look along it
    /// say, a wall being in sight of at least one.
    pub(crate) fn sense(&self, observation: &mut [f64], rng: &mut Rng) {
        let mut sums = [[0.0; 2]; 2];
        let compass = self.heading + self.robot.compass_noise * normal(rng);
        for side in 0..4 {
            let quarter = f64::from(side) * FRAC_PI_2;
            let noise = self.robot.range_noise * normal(rng);
            let distance = self.distance(self.heading + quarter);
            if distance > self.robot.range {
                continue;
            }
            let reach = (distance + noise).max(0.0) + self.robot.radius;
            // East, north, west or south, by the compass.
            let facing = ((compass + quarter) / FRAC_PI_2).round().rem_euclid(4.0) as usize;
            let axis = facing % 2;
            let place = if facing < 2 {
                self.arena[axis] - reach
            } else {
                reach
            };
            sums[axis][0] += place;
            sums[axis][1] += 1.0;
        }
        for (i, (reading, low)) in observation.iter_mut().zip(&self.low).enumerate() {
            let [sum, count] = sums[i];
            let place = if count > 0.0 {
                sum / count
            } else {
                0.5 * self.arena[i]
            };
            *reading = low + place / self.robot.cell;
        }
    }

    /// Distance from the rim of the body to the wall in a direction, m.
    fn distance(&self, direction: f64) -> f64 {
        let (sin, cos) = direction.sin_cos();
        let along = |place: f64, width: f64, slope: f64| {
            let wall = if slope > 0.0 { width - place } else { place };
            if slope.abs() > 1e-12 {
                wall / slope.abs()
            } else {
                f64::INFINITY
            }
        };
        let [east, north] = self.place;
        let wall = along(east, self.arena[0], cos).min(along(north, self.arena[1], sin));
        (wall - self.robot.radius).max(0.0)
    }
}

/// The same angle in `(-pi, pi]`.
fn wrapped(angle: f64) -> f64 {
    let turned = angle.rem_euclid(2.0 * PI);
    if turned > PI {
        turned - 2.0 * PI
    } else {
        turned
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use crate::random::{Role, stream};
    use crate::scenario::{Scenario, Simulator, find};

    fn arena(change: impl Fn(&mut Robot)) -> RobotArena {
        let Scenario { model, truth, .. } = find("robot-maze-4x4").unwrap();
        let Simulator::Robot(mut robot) = truth.simulator else {
            panic!("no robot");
        };
        (robot.slip, robot.compass_noise, robot.range_noise) = (0.0, 0.0, 0.0);
        change(&mut robot);
        RobotArena::new(&robot, &model)
    }

    #[test]
    fn without_slip_it_goes_where_it_is_told_and_knows_it() {
        let mut arena = arena(|_| ());
        let mut rng = stream(1, 0, Role::World);
        let (mut state, mut reading) = ([1.5, 2.5], [0.0; 2]);
        arena.put(&mut state);
        for (step, reached) in [
            ([1.0, 0.0], [2.5, 2.5]),
            ([0.0, -1.0], [2.5, 1.5]),
            ([-1.0, 0.0], [1.5, 1.5]),
            ([0.0, 1.0], [1.5, 2.5]),
        ] {
            arena.carry_out(&step, &mut state, &mut rng);
            arena.sense(&mut reading, &mut rng);
            for i in 0..2 {
                assert!(
                    (state[i] - reached[i]).abs() < 0.03,
                    "{state:?} {reached:?}"
                );
                assert!(
                    (state[i] - reading[i]).abs() < 0.01,
                    "{state:?} {reading:?}"
                );
            }
        }
    }

    #[test]
    fn walls_stop_the_body_and_not_its_middle() {
        let mut arena = arena(|robot| robot.slip = 0.2);
        let mut rng = stream(1, 0, Role::World);
        let mut state = [0.0, 3.0];
        arena.put(&mut state);
        let margin = arena.robot.radius / arena.robot.cell;
        assert_eq!(state, [margin, 3.0]);
        for _ in 0..9 {
            arena.carry_out(&[1.0, 0.0], &mut state, &mut rng);
        }
        assert!((state[0] - (4.0 - margin)).abs() < 1e-9, "{state:?}");
    }

    /// Two wheels that slip by shares `a` and `b` and are steered straight go `2 (1 + a) (1 + b) / (2 + a + b)` of the way: about
    /// `1 + (a + b) / 2 - (a - b)^2 / 4`.
    #[test]
    fn slip_scatters_steps_and_noise_scatters_readings() {
        let mut slipping = arena(|robot| robot.slip = 0.3);
        let noisy = arena(|robot| robot.range_noise = 0.1);
        let mut rng = stream(5, 0, Role::World);
        let (mut steps, mut readings) = (Vec::new(), Vec::new());
        for _ in 0..2_000 {
            let mut state = [1.0, 2.0];
            slipping.put(&mut state);
            slipping.carry_out(&[1.0, 0.0], &mut state, &mut rng);
            steps.push(state[0] - 1.0);
            let mut reading = [0.0; 2];
            noisy.sense(&mut reading, &mut rng);
            readings.push(reading[0] - 2.0);
        }
        let moments = |sample: &[f64]| {
            let mean = sample.iter().sum::<f64>() / sample.len() as f64;
            let square = sample.iter().map(|x| (x - mean).powi(2)).sum::<f64>();
            (mean, (square / sample.len() as f64).sqrt())
        };
        let (mean, sd) = moments(&steps);
        assert!(
            (mean - (1.0 - 0.5 * 0.3 * 0.3)).abs() < 0.02
                && (sd - 0.3 / 2.0_f64.sqrt()).abs() < 0.03,
            "{mean} {sd}"
        );
        // Two finders look along the variable; five standard errors.
        let expected = 0.1 / noisy.robot.cell / 2.0_f64.sqrt();
        let (mean, sd) = moments(&readings);
        assert!(mean.abs() < 5.0 * expected / 2_000.0_f64.sqrt(), "{mean}");
        assert!(
            (sd / expected - 1.0).abs() < 5.0 / 4_000.0_f64.sqrt(),
            "{sd} {expected}"
        );
    }

    #[test]
    fn a_finder_that_sees_no_wall_says_nothing() {
        let mut arena = arena(|robot| robot.range = 2.2 * robot.cell);
        let mut state = [0.5, 2.0];
        arena.put(&mut state);
        let mut reading = [0.0; 2];
        arena.sense(&mut reading, &mut stream(1, 0, Role::Sensor));
        assert!((reading[0] - 0.5).abs() < 1e-9, "{reading:?}");
    }
}
