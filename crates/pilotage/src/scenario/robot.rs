//! A robot in a walled arena: what it is, and whether it can move there.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Scenario;
use crate::model::validate::positive;
use crate::model::{Fault, Interval, Model, Path, StartShape};

/// A two-wheeled robot with a range finder at the middle of each of its four sides (thesis 4.3), and its arena. The arena has walls
/// at `state.bounds`; positions are measured in units of state, everything else in metres, seconds and radians.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub struct Robot {
    /// Metres for one unit of state, such as the side of a cell.
    pub cell: f64,
    /// Width of the hallway where the state has one variable, m.
    #[serde(default)]
    pub hallway: Option<f64>,
    /// Radius of the body, a disc, m.
    pub radius: f64,
    /// Distance between the wheels, m.
    pub axle: f64,
    /// Top speed of a wheel, m/s.
    pub speed: f64,
    /// Time between two commands to the wheels, s.
    pub tick: f64,
    /// Standard deviation of the share by which a wheel runs farther or less far than it was told, drawn for every wheel and action.
    pub slip: f64,
    /// Standard deviation of the compass that headings are held by, rad.
    pub compass_noise: f64,
    /// Standard deviation of a range finder, m.
    pub range_noise: f64,
    /// How far a range finder sees, m.
    pub range: f64,
}

impl Robot {
    /// The arena of a model: its extent east and north, in metres.
    pub(crate) fn arena(&self, model: &Model) -> [f64; 2] {
        let width = |variable: usize| {
            let variable = model.state.get(variable);
            variable.map(|variable| variable.bounds.width() * self.cell)
        };
        let hallway = self.hallway.unwrap_or(self.cell);
        [width(0).unwrap_or(hallway), width(1).unwrap_or(hallway)]
    }

    /// Where the middle of the robot can be along a state variable, in units of state.
    pub(crate) fn room(&self, bounds: Interval) -> Interval {
        let margin = self.radius / self.cell;
        Interval::new(bounds.low + margin, bounds.high - margin)
    }

    /// Checks the numbers, and that the robot of `model` fits its arena and starts clear of its walls.
    pub(super) fn validate(&self, scenario: &Scenario) -> Result<(), Fault> {
        let path = |key: &str| Path::new("world").key("robot").key(key);
        for (key, value, zero) in [
            ("cell", self.cell, false),
            ("radius", self.radius, false),
            ("axle", self.axle, false),
            ("speed", self.speed, false),
            ("tick", self.tick, false),
            ("slip", self.slip, true),
            ("compass_noise", self.compass_noise, true),
            ("range_noise", self.range_noise, true),
            ("range", self.range, false),
        ] {
            positive(value, zero, path(key))?;
        }
        if let Some(hallway) = self.hallway {
            positive(hallway, false, path("hallway"))?;
        }
        if self.axle > 2.0 * self.radius {
            return Err(Fault::new(
                path("axle"),
                format!(
                    "wheels {} m apart on a body {} m across",
                    self.axle,
                    2.0 * self.radius
                ),
                "give at most twice the radius",
            ));
        }
        self.check_model(&scenario.model)?;
        self.check_ticks(&scenario.model, path)?;
        self.check_room(&scenario.model, path)?;
        self.check_starts(scenario)
    }

    /// The robot senses its place, and actions move it.
    fn check_model(&self, model: &Model) -> Result<(), Fault> {
        let n = model.state_dim();
        let kind = Path::new("world").key("kind");
        let unbounded = model.state.iter().find(|v| !v.bounds.width().is_finite());
        let place = n <= 2 && model.motion.a.is_identity(0.0) && model.sensor.h.is_identity(0.0);
        if !place {
            return Err(Fault::new(
                kind,
                "a robot's state is its place: one or two variables that are sensed and that actions add to",
                "make A and H the identity, or choose another kind",
            ));
        }
        if let Some(variable) = unbounded {
            return Err(Fault::new(
                kind,
                format!("the arena has no wall along {}", variable.name),
                "add finite `bounds` to [state]",
            ));
        }
        if model.map.is_some() {
            return Err(Fault::new(
                kind,
                "the robot finds its place by the outer walls of an arena, and this one has a map of inner walls",
                "delete [map], or choose another kind",
            ));
        }
        Ok(())
    }

    /// An action takes a number of ticks that ends.
    fn check_ticks(&self, model: &Model, path: impl Fn(&str) -> Path) -> Result<(), Fault> {
        const MOST: f64 = 1e5;
        let way = |action| model.displacement(action, 0).norm() * self.cell;
        let longest = (0..model.actions.len()).map(way).fold(0.0, f64::max);
        // Half a turn, and the way at half the speed.
        let seconds = (std::f64::consts::PI * self.axle + 2.0 * longest) / self.speed + 1.0;
        let ticks = seconds / self.tick;
        if ticks <= MOST {
            return Ok(());
        }
        Err(Fault::new(
            path("tick"),
            format!("an action would take up to {ticks:e} commands to the wheels"),
            format!("give a longer tick, or more `speed`: at most {MOST:e} are carried out"),
        ))
    }

    /// There is room for the body and for one step of every action, and a wall in sight from everywhere.
    fn check_room(&self, model: &Model, path: impl Fn(&str) -> Path) -> Result<(), Fault> {
        let arena = self.arena(model);
        let across = 2.0 * self.radius;
        if let Some(width) = arena.iter().find(|width| **width <= across) {
            return Err(Fault::new(
                path("radius"),
                format!("a robot {across} m across does not fit an arena {width} m wide"),
                "make it smaller, or `cell` or `hallway` larger",
            ));
        }
        for (i, width) in arena.iter().enumerate().take(model.state_dim()) {
            let steps =
                (0..model.actions.len()).map(|action| model.displacement(action, 0)[i].abs());
            let longest = steps.fold(0.0, f64::max) * self.cell;
            if width - across < longest {
                return Err(Fault::new(
                    path("radius"),
                    format!(
                        "the robot cannot move: along {} its arena leaves it {} m, and an action takes {longest} m",
                        model.state[i].name,
                        width - across
                    ),
                    "make it smaller, or widen `state.bounds`",
                ));
            }
            if self.range < 0.5 * width - self.radius {
                return Err(Fault::new(
                    path("range"),
                    format!(
                        "a range finder that sees {} m sees no wall from the middle of an arena {width} m wide",
                        self.range
                    ),
                    format!("give at least {}", 0.5 * width - self.radius),
                ));
            }
        }
        Ok(())
    }

    fn check_starts(&self, scenario: &Scenario) -> Result<(), Fault> {
        let model = &scenario.model;
        let (starts, path) = match &scenario.truth.start {
            Some(starts) => (starts, Path::new("world").key("start")),
            None => (&model.start, Path::new("start")),
        };
        for (i, start) in starts.iter().enumerate() {
            let path = path.clone().index(i).key(match start.shape {
                StartShape::Normal => "mean",
                StartShape::Uniform => "uniform",
            });
            for (variable, &x) in model.state.iter().zip(start.mean.iter()) {
                let room = self.room(variable.bounds);
                if !(room.low..=room.high).contains(&x) {
                    return Err(Fault::new(
                        path,
                        format!(
                            "the robot would stand in a wall: {} = {x} is less than its radius of {} from one",
                            variable.name,
                            self.radius / self.cell
                        ),
                        format!("start between {} and {}", room.low, room.high),
                    ));
                }
            }
        }
        Ok(())
    }
}
