//! What every model fulfils, whether it was read from a file or built by a program.

mod laws;
mod numbers;

use nalgebra::DVector;

use super::error::{Fault, Path};
use super::*;
use crate::error::is_unseen;
pub(crate) use numbers::positive;
use numbers::{covariance, finite, finite_matrix, shape, vector};

/// Most state variables, controls, readings: matrices of more take longer than anyone waits.
pub(crate) const MOST_DIMENSIONS: usize = 64;

/// Most actions, and most modes.
const MOST_NAMES: usize = 1000;

/// Most uncertainty levels.
pub(crate) const MOST_LEVELS: usize = 100_000;

/// Most Gaussians of a sum.
const MOST_COMPONENTS: usize = 1000;

/// Most cells along a variable.
const MOST_CELLS: usize = 2000;

/// Weights of hypotheses may miss 1 by this much, which decimals such as 0.333333333 need.
const WEIGHT_TOLERANCE: f64 = 1e-6;

impl Model {
    /// Checks that the model makes sense: shapes fit, covariances are covariances, numbers are finite, names are
    /// unique, indices exist, the start is inside the world. Whether a filter converges is not asked here.
    ///
    /// # Errors
    /// The first fault found, with the key of the model file that it belongs to.
    pub fn validate(&self) -> Result<(), Fault> {
        let variables: Vec<&str> = self
            .state
            .iter()
            .map(|variable| variable.name.as_str())
            .collect();
        let actions: Vec<&str> = self
            .actions
            .iter()
            .map(|action| action.name.as_str())
            .collect();
        check_names(&variables, &self.modes, &actions)?;
        self.check_state()?;
        self.check_discount()?;
        self.check_motion_and_sensor()?;
        self.check_actions()?;
        self.check_laws()?;
        self.check_episode()?;
        self.check_hypotheses(&self.start, &Path::new("start"))?;
        for (i, reward) in self.rewards.iter().enumerate() {
            let path = Path::new("reward").index(i);
            self.check_condition(&reward.actions, reward.mode, &reward.region, &path)?;
            self.check_begins(reward.steps.from, path.clone().key("steps").key("from"))?;
            finite(reward.value, path.key("value"))?;
        }
        for (i, event) in self.events.iter().enumerate() {
            let path = Path::new("event").index(i);
            self.check_condition(&event.actions, event.mode, &event.region, &path)?;
            self.check_mode(event.becomes, path.clone().key("becomes"))?;
            self.check_begins(event.steps.from, path.clone().key("steps").key("from"))?;
            finite(event.reward, path.clone().key("reward"))?;
            if !(0.0..=1.0).contains(&event.probability) {
                return Err(Fault::new(
                    path.key("probability"),
                    format!("the probability of an event is {}", event.probability),
                    "give a number from 0 to 1",
                ));
            }
        }
        self.check_cost()?;
        self.check_belief()
    }

    fn check_state(&self) -> Result<(), Fault> {
        let path = Path::new("state");
        if self.name.trim().is_empty() {
            return Err(Fault::new(
                Path::new("name"),
                "the model has no name",
                "give a short name, such as \"corridor\"",
            ));
        }
        check_seen(&self.name, Path::new("name"))?;
        check_text(&self.about, Path::new("about"))?;
        for (i, StateVariable { bounds, .. }) in self.state.iter().enumerate() {
            let path = path.clone().key("bounds").index(i);
            if *bounds != Interval::ALL {
                finite(bounds.low, path.clone().index(0))?;
                finite(bounds.high, path.clone().index(1))?;
                finite(bounds.width(), path.clone())?;
            }
            check_interval(*bounds, "the bounds", path)?;
        }
        if self.map.is_some() && self.state.len() < 2 {
            return Err(Fault::new(
                path.key("names"),
                "a map has two directions, and there is one state variable",
                "name two state variables, east first, then north",
            ));
        }
        Ok(())
    }

    fn check_discount(&self) -> Result<(), Fault> {
        let path = Path::new("discount");
        finite(self.discount, path.clone())?;
        let undiscounted = self.discount == 1.0;
        if (0.0..1.0).contains(&self.discount) || (undiscounted && self.cost.is_some()) {
            return Ok(());
        }
        let hint = if undiscounted {
            "give a number below 1, such as 0.95; only a model with a [cost] may have 1"
        } else {
            "give a number from 0 up to, not including, 1, such as 0.95"
        };
        Err(Fault::new(
            path,
            format!("the discount is {}", self.discount),
            hint,
        ))
    }

    fn check_motion_and_sensor(&self) -> Result<(), Fault> {
        let path = |key: &str| Path::new(key);
        self.check_motion(&self.motion, path("motion"))?;
        let controls = self.motion.b.ncols();
        let place = path("motion").key("B");
        at_most(controls, MOST_DIMENSIONS, "controls", place)?;
        let m = self.sensor_dim();
        let place = path("sensor").key("H");
        at_most(m, MOST_DIMENSIONS, "sensor readings", place)?;
        self.check_sensor(&self.sensor, path("sensor"))?;
        let mut before = 0;
        for (i, phase) in self.later.iter().enumerate() {
            let path = path("later").index(i);
            if phase.from <= before {
                return Err(Fault::new(
                    path.key("from"),
                    format!(
                        "it begins at step {}, and what is before it at step {before}",
                        phase.from
                    ),
                    "give steps that rise, the first at least 1",
                ));
            }
            self.check_begins(phase.from, path.clone().key("from"))?;
            before = phase.from;
            self.check_motion(&phase.motion, path.clone().key("motion"))?;
            self.check_sensor(&phase.sensor, path.key("sensor"))?;
        }
        Ok(())
    }

    /// What begins after the last step of an episode would be ignored without a word.
    fn check_begins(&self, step: usize, path: Path) -> Result<(), Fault> {
        match step < self.episode.length {
            true => Ok(()),
            false => Err(Fault::new(
                path,
                format!(
                    "it begins at step {step}, and an episode is over after {}",
                    self.episode.length
                ),
                "begin earlier, counted from 0, or give a longer `episode.length`",
            )),
        }
    }

    fn check_motion(&self, motion: &Motion, path: Path) -> Result<(), Fault> {
        let n = self.state_dim();
        let variables = format!("there are {n} state variables");
        shape(&motion.a, (n, n), &variables, path.clone().key("A"))?;
        finite_matrix(&motion.a, path.clone().key("A"))?;
        let size = (n, self.motion.b.ncols().max(1));
        shape(&motion.b, size, &variables, path.clone().key("B"))?;
        finite_matrix(&motion.b, path.clone().key("B"))?;
        vector(&motion.drift, n, &variables, path.clone().key("drift"))?;
        covariance(&motion.noise, n, &variables, path.key("noise"))
    }

    fn check_sensor(&self, sensor: &Sensor, path: Path) -> Result<(), Fault> {
        let (n, m) = (self.state_dim(), self.sensor_dim());
        let variables = format!("there are {n} state variables");
        let rows = if self.laws.symbols.is_empty() {
            m.max(1)
        } else {
            0
        };
        shape(&sensor.h, (rows, n), &variables, path.clone().key("H"))?;
        finite_matrix(&sensor.h, path.clone().key("H"))?;
        let noise = path.clone().key("noise");
        match rows {
            0 => shape(&sensor.noise, (0, 0), "signals have no noise", noise)?,
            _ => covariance(&sensor.noise, m, &self.readings(), noise)?,
        }
        if !(0.0..=1.0).contains(&sensor.present) {
            return Err(Fault::new(
                path.key("present"),
                format!("the probability of a reading is {}", sensor.present),
                "give a number from 0 to 1",
            ));
        }
        Ok(())
    }

    fn readings(&self) -> String {
        format!(
            "the sensor has {} readings, the rows of H",
            self.sensor_dim()
        )
    }

    fn check_actions(&self) -> Result<(), Fault> {
        let path = Path::new("actions");
        for action in &self.actions {
            let path = path.clone().key(&action.name);
            self.check_control(&action.control, &path)?;
            let moved = self
                .phases()
                .map(|step| &self.motion_at(step).b * &action.control);
            if moved
                .into_iter()
                .any(|moved| moved.iter().any(|x| !x.is_finite()))
            {
                return Err(Fault::new(
                    path.key("u"),
                    "B u is not finite",
                    "give smaller numbers, here or in B",
                ));
            }
            self.check_motion_noise(action.motion_noise.as_ref(), &path)?;
            if let Some(noise) = &action.sensor_noise {
                covariance(
                    noise,
                    self.sensor_dim(),
                    &self.readings(),
                    path.key("sensor_noise"),
                )?;
            }
        }
        Ok(())
    }

    pub(crate) fn check_hypotheses(
        &self,
        start: &[StartHypothesis],
        path: &Path,
    ) -> Result<(), Fault> {
        if start.is_empty() {
            return Err(Fault::new(
                path.clone(),
                "the start is empty",
                "give at least one hypothesis",
            ));
        }
        for (i, hypothesis) in start.iter().enumerate() {
            let path = path.clone().index(i);
            let variables = format!("there are {} state variables", self.state_dim());
            finite(hypothesis.weight, path.clone().key("weight"))?;
            if hypothesis.weight <= 0.0 {
                return Err(Fault::new(
                    path.key("weight"),
                    format!("the weight is {}", hypothesis.weight),
                    "give a probability above 0, or delete the hypothesis",
                ));
            }
            self.check_mode(Some(hypothesis.mode), path.clone().key("mode"))?;
            vector(
                &hypothesis.mean,
                self.state_dim(),
                &variables,
                path.clone().key("mean"),
            )?;
            covariance(
                &hypothesis.covariance,
                self.state_dim(),
                &variables,
                path.clone().key("covariance"),
            )?;
            let place = match hypothesis.shape {
                StartShape::Normal => "mean",
                StartShape::Uniform => "uniform",
            };
            self.check_inside(&hypothesis.mean, &path.key(place))?;
        }
        let sum: f64 = start.iter().map(|hypothesis| hypothesis.weight).sum();
        if (sum - 1.0).abs() > WEIGHT_TOLERANCE {
            return Err(Fault::new(
                path.clone().index(start.len() - 1).key("weight"),
                format!("the weights of the start sum to {sum}"),
                "make them sum to 1, or leave them out for equal weights",
            ));
        }
        Ok(())
    }

    /// A start may stand on the edge of the world, but not beyond it, nor in a blocked cell.
    fn check_inside(&self, mean: &DVector<f64>, path: &Path) -> Result<(), Fault> {
        for (i, (&x, variable)) in mean.iter().zip(&self.state).enumerate() {
            let Interval { low, high } = variable.bounds;
            if !(low..=high).contains(&x) {
                return Err(Fault::new(
                    path.clone().index(i),
                    format!("the start {} = {x} is outside the bounds", variable.name),
                    format!("start between {low} and {high}, or widen `state.bounds`"),
                ));
            }
        }
        if !self.episode.alive.contains(mean.as_slice()) {
            return Err(Fault::new(
                path.clone(),
                "the start is outside `episode.alive`: every episode fails at once",
                "start inside it, or widen it",
            ));
        }
        let Some(map) = &self.map else { return Ok(()) };
        let [east, north] = map.extent();
        if map.free([east.clamp(mean[0]), north.clamp(mean[1])]) {
            return Ok(());
        }
        Err(Fault::new(
            path.clone(),
            "the start is inside a blocked cell of the map",
            "start in a free cell",
        ))
    }

    fn check_mode(&self, mode: Option<ModeId>, path: Path) -> Result<(), Fault> {
        match mode {
            Some(mode) if mode >= self.modes.len() => Err(Fault::new(
                path,
                format!("mode {mode} of {}", self.modes.len()),
                "modes are counted from 0",
            )),
            _ => Ok(()),
        }
    }

    pub(crate) fn check_condition(
        &self,
        actions: &Option<Vec<ActionId>>,
        mode: Option<ModeId>,
        region: &Region,
        path: &Path,
    ) -> Result<(), Fault> {
        self.check_mode(mode, path.clone().key("mode"))?;
        let too_large = |&action: &ActionId| action >= self.actions.len();
        if let Some(action) = actions
            .iter()
            .flatten()
            .copied()
            .find(|action| too_large(action))
        {
            return Err(Fault::new(
                path.clone().key("action"),
                format!("action {action} of {}", self.actions.len()),
                "actions are counted from 0",
            ));
        }
        if actions.as_ref().is_some_and(Vec::is_empty) {
            return Err(Fault::new(
                path.clone().key("action"),
                "the list of actions is empty",
                "name an action, or delete the key for all actions",
            ));
        }
        self.check_region(region, path.clone().key("in"))
    }

    fn check_region(&self, region: &Region, path: Path) -> Result<(), Fault> {
        for &(variable, interval) in &region.sides {
            let Some(name) = self.state.get(variable).map(|variable| &variable.name) else {
                return Err(Fault::new(
                    path,
                    format!("state variable {variable} of {}", self.state_dim()),
                    "state variables are counted from 0",
                ));
            };
            check_interval(interval, "the region", path.clone().key(name))?;
        }
        Ok(())
    }

    fn check_cost(&self) -> Result<(), Fault> {
        let Some(cost) = &self.cost else {
            return Ok(());
        };
        let (n, p) = (self.state_dim(), self.motion.b.ncols());
        let variables = format!("there are {n} state variables");
        let path = |key| Path::new("cost").key(key);
        covariance(&cost.state, n, &variables, path("state"))?;
        covariance(
            &cost.control,
            p,
            &format!("there are {p} controls, the columns of B"),
            path("control"),
        )?;
        covariance(&cost.terminal, n, &variables, path("terminal"))
    }

    fn check_episode(&self) -> Result<(), Fault> {
        let path = |key| Path::new("episode").key(key);
        if self.episode.length == 0 {
            return Err(Fault::new(
                path("length"),
                "the episode has no steps",
                "give at least 1",
            ));
        }
        finite(self.episode.failure_reward, path("failure_reward"))?;
        let clock = self.clock();
        if clock > MOST_LEVELS {
            return Err(Fault::new(
                path("length"),
                format!(
                    "something changes up to step {clock} of an episode, and at most {MOST_LEVELS} steps are told apart"
                ),
                "give a shorter episode, or smaller steps to `steps` and `later`",
            ));
        }
        self.check_region(&self.episode.alive, path("alive"))
    }

    fn check_belief(&self) -> Result<(), Fault> {
        let path = |key| Path::new("belief").key(key);
        finite(self.belief.level_tolerance, path("level_tolerance"))?;
        if self.belief.level_tolerance < 0.0 {
            return Err(Fault::new(
                path("level_tolerance"),
                format!("the tolerance is {}", self.belief.level_tolerance),
                "give 0 or more, such as 5e-7",
            ));
        }
        if self.belief.level_limit == 0 {
            return Err(Fault::new(
                path("level_limit"),
                "no level is allowed",
                "give at least 1",
            ));
        }
        at_most(
            self.belief.level_limit,
            MOST_LEVELS,
            "levels",
            path("level_limit"),
        )?;
        for (key, count, least, most) in [
            ("components", self.belief.components, 1, MOST_COMPONENTS),
            ("cells", self.belief.cells, 2, MOST_CELLS),
        ] {
            if let Some(count) = count.filter(|count| !(least..=most).contains(count)) {
                return Err(Fault::new(
                    path(key),
                    format!("{count} {key}"),
                    format!("give {least} to {most}"),
                ));
            }
        }
        Ok(())
    }

    pub(crate) fn check_control(&self, control: &DVector<f64>, path: &Path) -> Result<(), Fault> {
        let controls = self.motion.b.ncols();
        let expected = format!("there are {controls} controls, the columns of B");
        vector(control, controls, &expected, path.clone().key("u"))
    }

    pub(crate) fn check_motion_noise(
        &self,
        noise: Option<&DMatrix<f64>>,
        path: &Path,
    ) -> Result<(), Fault> {
        let Some(noise) = noise else {
            return Ok(());
        };
        let variables = format!("there are {} state variables", self.state_dim());
        covariance(
            noise,
            self.state_dim(),
            &variables,
            path.clone().key("noise"),
        )
    }
}

/// Checks that there are state variables, modes and actions, and that none of a kind share a name.
pub(crate) fn check_names<S: AsRef<str>>(
    variables: &[S],
    modes: &[impl AsRef<str>],
    actions: &[S],
) -> Result<(), Fault> {
    let state = |key| Path::new("state").key(key);
    if variables.is_empty() {
        return Err(Fault::new(
            state("names"),
            "there is no state variable",
            "name at least one, such as \"x\"",
        ));
    }
    if modes.is_empty() {
        return Err(Fault::new(
            state("modes"),
            "there is no mode",
            "a model without modes has one called \"\"",
        ));
    }
    if actions.is_empty() {
        return Err(Fault::new(
            Path::new("actions"),
            "there is no action",
            "add one, such as `STOP = { u = [0.0] }`",
        ));
    }
    at_most(
        variables.len(),
        MOST_DIMENSIONS,
        "state variables",
        state("names"),
    )?;
    at_most(modes.len(), MOST_NAMES, "modes", state("modes"))?;
    at_most(actions.len(), MOST_NAMES, "actions", Path::new("actions"))?;
    check_unique(variables, "state variable", |i| state("names").index(i))?;
    if modes.len() > 1 || !modes[0].as_ref().is_empty() {
        check_unique(modes, "mode", |i| state("modes").index(i))?;
    }
    check_unique(actions, "action", |i| {
        Path::new("actions").key(actions[i].as_ref())
    })
}

fn check_unique<S: AsRef<str>>(
    names: &[S],
    kind: &str,
    path: impl Fn(usize) -> Path,
) -> Result<(), Fault> {
    for (i, name) in names.iter().map(AsRef::as_ref).enumerate() {
        if name.trim().is_empty() {
            return Err(Fault::of_key(
                path(i),
                format!("a {kind} without a name"),
                "give it a name",
            ));
        }
        check_seen(name, path(i)).map_err(|fault| Fault {
            on_key: kind == "action",
            ..fault
        })?;
        if names[..i].iter().any(|earlier| earlier.as_ref() == name) {
            return Err(Fault::new(
                path(i),
                format!("two {kind}s are called `{name}`"),
                "rename one of them",
            ));
        }
    }
    Ok(())
}

/// Checks that a name is what it looks like, and nothing that a terminal would obey.
fn check_seen(name: &str, path: Path) -> Result<(), Fault> {
    let Some(unseen) = name.chars().find(|character| is_unseen(*character)) else {
        return Ok(());
    };
    Err(Fault::new(
        path,
        format!("a name with the character {}", unseen.escape_unicode()),
        "use letters, digits and marks that can be seen",
    ))
}

/// As [`check_seen`], for text that may have several lines.
fn check_text(text: &str, path: Path) -> Result<(), Fault> {
    text.split(['\n', '\t']).try_for_each(|part| {
        let fault = |fault: Fault| Fault {
            message: fault.message.replace("a name", "a text"),
            ..fault
        };
        check_seen(part, path.clone()).map_err(fault)
    })
}

/// Checks that there are not too many of something.
pub(crate) fn at_most(count: usize, most: usize, what: &str, path: Path) -> Result<(), Fault> {
    if count <= most {
        return Ok(());
    }
    Err(Fault::new(
        path,
        format!("{count} {what}"),
        format!("give at most {most}"),
    ))
}

fn check_interval(interval: Interval, what: &str, path: Path) -> Result<(), Fault> {
    let Interval { low, high } = interval;
    if low.is_nan() || high.is_nan() {
        return Err(Fault::new(
            path,
            "an end of the interval is not a number",
            "give numbers, `-inf` or `inf`",
        ));
    }
    if low < high {
        return Ok(());
    }
    let how = if low > high { "inverted" } else { "empty" };
    Err(Fault::new(
        path,
        format!("{what} [{low}, {high}] is {how}"),
        "give the lower end first, then a larger one",
    ))
}
