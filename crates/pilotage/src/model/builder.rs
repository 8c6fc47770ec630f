//! Models made by a program, checked as those of files are.

use nalgebra::{DMatrix, DVector};

use super::error::{Fault, Path};
use super::*;

/// Builds a [`Model`] piece by piece. Names are looked up, and everything is checked, by [`ModelBuilder::build`].
///
/// ```
/// use pilotage::model::{Clause, ModelBuilder};
///
/// // Stop at the door, between 6 and 7.
/// let hallway = ModelBuilder::new("hallway", 0.9)
///     .variable("x", 0.0, 10.0)
///     .start(&[1.0], &[0.5])
///     .motion(&[1.0], &[1.0], &[0.1])
///     .sensor(&[1.0], &[0.4])
///     .action("FORWARD", &[1.0])
///     .action("BACK", &[-1.0])
///     .action("STAY", &[0.0])
///     .reward(1.0, Clause::new().within("x", 6.0, 7.0))
///     .build()?;
/// assert_eq!(hallway.actions.len(), 3);
///
/// let mistaken = ModelBuilder::new("hallway", 1.9).variable("x", 0.0, 10.0);
/// assert!(mistaken.build().is_err());
/// # Ok::<(), pilotage::model::Fault>(())
/// ```
#[derive(Debug, Clone)]
pub struct ModelBuilder {
    name: String,
    about: String,
    discount: f64,
    state: Vec<StateVariable>,
    modes: Vec<String>,
    starts: Vec<Start>,
    motion: [Vec<f64>; 3],
    sensor: [Vec<f64>; 2],
    present: f64,
    later: Vec<Phase>,
    laws: Laws,
    drift: Option<Vec<f64>>,
    actions: Vec<Action>,
    rewards: Vec<(Formula, Clause)>,
    events: Vec<(f64, Change, Clause)>,
    cost: Option<[Vec<f64>; 3]>,
    episode: Episode,
    alive: Option<Clause>,
    belief: BeliefSettings,
}

/// A start as it was given.
#[derive(Debug, Clone)]
struct Start {
    weight: f64,
    mode: Option<String>,
    mean: Vec<f64>,
    covariance: Vec<f64>,
}

/// What an event does.
#[derive(Debug, Clone)]
struct Change {
    becomes: Option<String>,
    then: Then,
}

/// When and where something is paid or happens: everywhere and always, unless it says otherwise.
#[derive(Debug, Clone)]
pub struct Clause {
    actions: Vec<String>,
    mode: Option<String>,
    sides: Vec<(String, Interval)>,
    when: When,
    steps: Steps,
    probability: f64,
}

impl Default for Clause {
    fn default() -> Self {
        Self {
            actions: Vec::new(),
            mode: None,
            sides: Vec::new(),
            when: When::default(),
            steps: Steps::ALL,
            probability: 1.0,
        }
    }
}

impl Clause {
    /// Everywhere and always, for every action and mode.
    pub fn new() -> Self {
        Self::default()
    }

    /// For this action; more than once, for any of these.
    pub fn on(mut self, action: &str) -> Self {
        self.actions.push(action.to_owned());
        self
    }

    /// In this mode alone.
    pub fn in_mode(mut self, mode: &str) -> Self {
        self.mode = Some(mode.to_owned());
        self
    }

    /// Where a variable lies in `[low, high)`; more than once, where all of them do.
    pub fn within(mut self, variable: &str, low: f64, high: f64) -> Self {
        self.sides
            .push((variable.to_owned(), Interval::new(low, high)));
        self
    }

    /// Asked where the action has led, and not where it is taken.
    pub fn after(mut self) -> Self {
        self.when = When::After;
        self
    }

    /// With this probability, for an event; 1 unless it is said.
    pub fn with_probability(mut self, probability: f64) -> Self {
        self.probability = probability;
        self
    }

    /// In these steps of an episode alone.
    pub fn during(mut self, steps: Steps) -> Self {
        self.steps = steps;
        self
    }
}

impl ModelBuilder {
    /// A model with a name and a discount, in `[0, 1)`.
    pub fn new(name: &str, discount: f64) -> Self {
        Self {
            name: name.to_owned(),
            about: String::new(),
            discount,
            state: Vec::new(),
            modes: Vec::new(),
            starts: Vec::new(),
            motion: Default::default(),
            sensor: Default::default(),
            present: 1.0,
            later: Vec::new(),
            laws: Laws::default(),
            drift: None,
            actions: Vec::new(),
            rewards: Vec::new(),
            events: Vec::new(),
            cost: None,
            episode: Episode::default(),
            alive: None,
            belief: BeliefSettings::default(),
        }
    }

    /// One or two sentences for people.
    pub fn about(mut self, about: &str) -> Self {
        self.about = about.to_owned();
        self
    }

    /// The next state variable and its bounds; infinite where there are none.
    pub fn variable(mut self, name: &str, low: f64, high: f64) -> Self {
        self.state.push(StateVariable {
            name: name.to_owned(),
            bounds: Interval::new(low, high),
            kind: VariableKind::Real,
        });
        self
    }

    /// The next hidden mode.
    pub fn mode(mut self, name: &str) -> Self {
        self.modes.push(name.to_owned());
        self
    }

    /// The start: mean (length `n`) and covariance (`n x n`, row by row), in the first mode.
    pub fn start(self, mean: &[f64], covariance: &[f64]) -> Self {
        self.start_of(1.0, None, mean, covariance)
    }

    /// One of several starts, with its probability, and its mode if that is not the first.
    pub fn start_of(
        mut self,
        weight: f64,
        mode: Option<&str>,
        mean: &[f64],
        covariance: &[f64],
    ) -> Self {
        self.starts.push(Start {
            weight,
            mode: mode.map(str::to_owned),
            mean: mean.to_vec(),
            covariance: covariance.to_vec(),
        });
        self
    }

    /// Motion `s' = A s + B u + v`, row by row: `A` is `n x n`, `B` is `n x p`, the covariance of `v` is `n x n`.
    pub fn motion(mut self, a: &[f64], b: &[f64], noise: &[f64]) -> Self {
        self.motion = [a, b, noise].map(<[f64]>::to_vec);
        self
    }

    /// Sensor `o = H s + n`, row by row: `H` is `m x n`, the covariance of `n` is `m x m`.
    pub fn sensor(mut self, h: &[f64], noise: &[f64]) -> Self {
        self.sensor = [h, noise].map(<[f64]>::to_vec);
        self
    }

    /// Probability that there is a reading after a step, in `[0, 1]`; 1 unless it is said.
    pub fn present(mut self, probability: f64) -> Self {
        self.present = probability;
        self
    }

    /// How the state moves and is sensed from a step of the episode on.
    pub fn later(mut self, phase: Phase) -> Self {
        self.later.push(phase);
        self
    }

    /// What is added to the state at every step, length `n`.
    pub fn drift(mut self, drift: &[f64]) -> Self {
        self.drift = Some(drift.to_vec());
        self
    }

    /// What the values of the last variable are; any number unless it is said.
    pub fn kind(mut self, kind: VariableKind) -> Self {
        if let Some(variable) = self.state.last_mut() {
            variable.kind = kind;
        }
        self
    }

    /// Motion and sensing in a mode, on an action, or as formulas; later cases count before earlier ones.
    pub fn case(mut self, case: Case) -> Self {
        self.laws.cases.push(case);
        self
    }

    /// All that goes beyond linear motion and sensing, instead of what was said of it so far.
    pub fn laws(mut self, laws: Laws) -> Self {
        self.laws = laws;
        self
    }

    /// The next action, with its control (length `p`).
    pub fn action(self, name: &str, control: &[f64]) -> Self {
        self.action_that(Action {
            name: name.to_owned(),
            control: DVector::from_column_slice(control),
            motion_noise: None,
            sensor_noise: None,
            then: Then::Continue,
        })
    }

    /// The next action, with noise of its own, or one that ends or restarts the episode.
    pub fn action_that(mut self, action: Action) -> Self {
        self.actions.push(action);
        self
    }

    /// A reward.
    pub fn reward(self, value: f64, clause: Clause) -> Self {
        self.reward_of(Formula::Number(value), clause)
    }

    /// A reward that depends on the state.
    pub fn reward_of(mut self, formula: Formula, clause: Clause) -> Self {
        self.rewards.push((formula, clause));
        self
    }

    /// An event: what it pays, the mode afterwards if that changes, and what it does to the episode.
    pub fn event(mut self, reward: f64, becomes: Option<&str>, then: Then, clause: Clause) -> Self {
        let becomes = becomes.map(str::to_owned);
        self.events.push((reward, Change { becomes, then }, clause));
        self
    }

    /// Quadratic cost, row by row: of the state (`n x n`), of the control (`p x p`), of the state at the end (`n x n`).
    pub fn cost(mut self, state: &[f64], control: &[f64], terminal: &[f64]) -> Self {
        self.cost = Some([state, control, terminal].map(<[f64]>::to_vec));
        self
    }

    /// Steps after which an episode stops.
    pub fn length(mut self, steps: usize) -> Self {
        self.episode.length = steps;
        self
    }

    /// Limits whose leaving is a failure, and what that pays. Of the clause only the place counts.
    pub fn alive(mut self, clause: Clause, failure_reward: f64) -> Self {
        self.alive = Some(clause);
        self.episode.failure_reward = failure_reward;
        self
    }

    /// How the agent keeps its belief.
    pub fn belief(mut self, belief: BeliefSettings) -> Self {
        self.belief = belief;
        self
    }

    /// The model.
    ///
    /// # Errors
    /// The first fault found, with the key that it would have in a model file; see [`Model::validate`].
    pub fn build(self) -> Result<Model, Fault> {
        let n = self.state.len();
        let names: Vec<&str> = self.state.iter().map(|variable| &*variable.name).collect();
        let modes: Vec<&str> = self.modes.iter().map(|mode| &**mode).collect();
        let actions: Vec<&str> = self.actions.iter().map(|action| &*action.name).collect();
        let index = |what: &'static str, names: &[&str], name: &str, path: Path| {
            let found = names.iter().position(|known| *known == name);
            found.ok_or_else(|| Fault::unknown(path, what, name, names.iter().copied()))
        };
        let mode = |name: &Option<String>, path: Path| {
            name.as_ref()
                .map(|name| index("mode", &modes, name, path))
                .transpose()
        };
        let region = |clause: &Clause, path: &Path| -> Result<Region, Fault> {
            let sides = clause.sides.iter().map(|(name, side)| {
                let place = path.clone().key(name);
                Ok((index("state variable", &names, name, place)?, *side))
            });
            Ok(Region::new(sides.collect::<Result<_, _>>()?))
        };
        let chosen = |clause: &Clause, path: &Path| -> Result<Option<Vec<ActionId>>, Fault> {
            let found = clause
                .actions
                .iter()
                .map(|name| index("action", &actions, name, path.clone().key("action")));
            let found = found.collect::<Result<Vec<_>, _>>()?;
            Ok((!found.is_empty()).then_some(found))
        };
        let [a, b, noise] = &self.motion;
        let path = |table: &str, key: &str| Path::new(table).key(key);
        let b = by_rows(b, n, path("motion", "B"))?;
        let h = by_columns(&self.sensor[0], n, path("sensor", "H"))?;
        let m = h.nrows();
        let mut starts = Vec::new();
        for (i, start) in self.starts.iter().enumerate() {
            let path = Path::new("start").index(i);
            starts.push(StartHypothesis {
                weight: start.weight,
                mode: mode(&start.mode, path.clone().key("mode"))?.unwrap_or(0),
                mean: DVector::from_column_slice(&start.mean),
                covariance: square(&start.covariance, n, path.key("covariance"))?,
                shape: StartShape::Normal,
            });
        }
        let mut rewards = Vec::new();
        for (i, (value, clause)) in self.rewards.iter().enumerate() {
            let path = Path::new("reward").index(i);
            rewards.push(Reward {
                actions: chosen(clause, &path)?,
                mode: mode(&clause.mode, path.clone().key("mode"))?,
                region: region(clause, &path.key("in"))?,
                when: clause.when,
                steps: clause.steps,
                value: value.constant().unwrap_or(0.0),
                formula: value.constant().is_none().then(|| value.clone()),
            });
        }
        let mut events = Vec::new();
        for (i, (reward, change, clause)) in self.events.iter().enumerate() {
            let path = Path::new("event").index(i);
            events.push(Event {
                actions: chosen(clause, &path)?,
                mode: mode(&clause.mode, path.clone().key("mode"))?,
                becomes: mode(&change.becomes, path.clone().key("becomes"))?,
                region: region(clause, &path.key("in"))?,
                when: clause.when,
                steps: clause.steps,
                probability: clause.probability,
                reward: *reward,
                then: change.then,
            });
        }
        let cost = match &self.cost {
            None => None,
            Some([state, control, terminal]) => Some(QuadraticCost {
                state: square(state, n, path("cost", "state"))?,
                control: square(control, b.ncols(), path("cost", "control"))?,
                terminal: square(terminal, n, path("cost", "terminal"))?,
            }),
        };
        let alive = match &self.alive {
            None => Region::everywhere(),
            Some(clause) => region(clause, &path("episode", "alive"))?,
        };
        let model = Model {
            motion: Motion {
                a: square(a, n, path("motion", "A"))?,
                noise: square(noise, n, path("motion", "noise"))?,
                drift: self
                    .drift
                    .map_or_else(|| DVector::zeros(n), DVector::from_vec),
                b,
            },
            later: self.later,
            laws: self.laws,
            sensor: Sensor {
                noise: square(&self.sensor[1], m, path("sensor", "noise"))?,
                present: self.present,
                h,
            },
            start: starts,
            rewards,
            events,
            cost,
            episode: Episode {
                alive,
                ..self.episode
            },
            modes: match self.modes.is_empty() {
                true => vec![String::new()],
                false => self.modes,
            },
            name: self.name,
            about: self.about,
            discount: self.discount,
            state: self.state,
            actions: self.actions,
            belief: self.belief,
            map: None,
            text: ModelText::default(),
        };
        model.validate()?;
        Ok(model)
    }
}

/// A matrix of so many rows.
fn by_rows(numbers: &[f64], rows: usize, path: Path) -> Result<DMatrix<f64>, Fault> {
    whole(numbers, rows, &path)?;
    Ok(DMatrix::from_row_slice(
        rows,
        numbers.len() / rows.max(1),
        numbers,
    ))
}

/// A matrix of so many columns.
fn by_columns(numbers: &[f64], columns: usize, path: Path) -> Result<DMatrix<f64>, Fault> {
    whole(numbers, columns, &path)?;
    Ok(DMatrix::from_row_slice(
        numbers.len() / columns.max(1),
        columns,
        numbers,
    ))
}

fn whole(numbers: &[f64], part: usize, path: &Path) -> Result<(), Fault> {
    if part > 0 && !numbers.is_empty() && numbers.len().is_multiple_of(part) {
        return Ok(());
    }
    Err(Fault::new(
        path.clone(),
        format!("{} numbers for {part} state variables", numbers.len()),
        "give the matrix row by row",
    ))
}

/// A square matrix.
fn square(numbers: &[f64], size: usize, path: Path) -> Result<DMatrix<f64>, Fault> {
    if numbers.len() == size * size {
        return Ok(DMatrix::from_row_slice(size, size, numbers));
    }
    Err(Fault::new(
        path,
        format!("{} numbers for a {size} x {size} matrix", numbers.len()),
        "give the matrix row by row",
    ))
}
