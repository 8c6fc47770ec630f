//! What several tests need: models by name, models made of matrices, matrices made of arbitrary numbers.
#![allow(dead_code, clippy::unwrap_used)]

pub mod automata;

use nalgebra::{DMatrix, DVector};
use pilotage::model::{
    Action, BeliefSettings, Episode, Interval, Model, Motion, Sensor, StartHypothesis, StartShape,
    StateVariable, Then,
};
use pilotage::scenario::{self, Scenario};
use pilotage::solve::{Entry, Form, Request, Solver};

/// A built-in model.
pub fn built_in(name: &str) -> Model {
    scenario(name).model
}

/// A built-in model with its truth.
pub fn scenario(name: &str) -> Scenario {
    scenario::find(name).unwrap_or_else(|error| panic!("{error}"))
}

/// A linear system with the belief it starts from.
#[derive(Debug, Clone)]
pub struct System {
    pub a: DMatrix<f64>,
    pub q: DMatrix<f64>,
    pub h: DMatrix<f64>,
    pub r: DMatrix<f64>,
    pub mean: DVector<f64>,
    pub covariance: DMatrix<f64>,
}

impl System {
    /// A model of the system with one action, `u = 0`, and levels that are only equal if their numbers are.
    pub fn model(&self) -> Model {
        let n = self.a.nrows();
        let state = |i| StateVariable {
            name: format!("x{i}"),
            bounds: Interval::new(-10.0, 10.0),
            kind: pilotage::model::VariableKind::Real,
        };
        Model {
            name: "system".to_owned(),
            about: String::new(),
            discount: 0.9,
            state: (0..n).map(state).collect(),
            modes: vec![String::new()],
            start: vec![StartHypothesis {
                weight: 1.0,
                mode: 0,
                mean: self.mean.clone(),
                covariance: self.covariance.clone(),
                shape: StartShape::Normal,
            }],
            motion: Motion {
                a: self.a.clone(),
                b: DMatrix::identity(n, n),
                drift: DVector::zeros(n),
                noise: self.q.clone(),
            },
            sensor: Sensor {
                h: self.h.clone(),
                noise: self.r.clone(),
                present: 1.0,
            },
            later: Vec::new(),
            laws: pilotage::model::Laws::default(),
            actions: vec![action("STAY", DVector::zeros(n))],
            rewards: Vec::new(),
            events: Vec::new(),
            cost: None,
            episode: Episode::default(),
            belief: BeliefSettings {
                level_tolerance: 0.0,
                ..BeliefSettings::default()
            },
            map: None,
            text: pilotage::model::ModelText::default(),
        }
    }
}

/// An action with the model's own noise.
pub fn action(name: &str, control: DVector<f64>) -> Action {
    Action {
        name: name.to_owned(),
        control,
        motion_noise: None,
        sensor_noise: None,
        then: Then::Continue,
    }
}

/// A model of one variable: `Q`, `R` and `P_0` are numbers, `A = H = 1`.
pub fn scalar(q: f64, r: f64, p: f64) -> System {
    let number = |value| DMatrix::from_element(1, 1, value);
    System {
        a: number(1.0),
        q: number(q),
        h: number(1.0),
        r: number(r),
        mean: DVector::zeros(1),
        covariance: number(p),
    }
}

/// Makes matrices of numbers in `[-1, 1]`, one after the other.
pub struct Numbers<'a>(std::iter::Cycle<std::slice::Iter<'a, f64>>);

impl<'a> Numbers<'a> {
    pub fn new(numbers: &'a [f64]) -> Self {
        Self(numbers.iter().cycle())
    }

    pub fn matrix(&mut self, rows: usize, columns: usize) -> DMatrix<f64> {
        DMatrix::from_iterator(rows, columns, self.0.by_ref().take(rows * columns).copied())
    }

    pub fn vector(&mut self, size: usize) -> DVector<f64> {
        DVector::from_iterator(size, self.0.by_ref().take(size).copied())
    }

    /// A covariance of the given rank, with `floor` added to every eigenvalue.
    pub fn covariance(&mut self, size: usize, rank: usize, floor: f64) -> DMatrix<f64> {
        let root = self.matrix(size, rank);
        &root * root.transpose() + DMatrix::identity(size, size) * floor
    }

    /// A system of `n` variables and `m` readings: noise of the sensor in every direction, of the motion in `rank`.
    pub fn system(&mut self, n: usize, m: usize, rank: usize) -> System {
        System {
            a: self.matrix(n, n),
            q: self.covariance(n, rank, 0.0),
            h: self.matrix(m, n),
            r: self.covariance(m, m, 0.1),
            mean: self.vector(n),
            covariance: self.covariance(n, n, 0.0),
        }
    }
}

/// Largest entry of a difference.
pub fn apart(a: &DMatrix<f64>, b: &DMatrix<f64>) -> f64 {
    (a - b).amax()
}

/// Least eigenvalue of a symmetric matrix.
pub fn least_eigenvalue(matrix: &DMatrix<f64>) -> f64 {
    matrix.clone().symmetric_eigenvalues().min()
}

/// A solver with settings small enough for a test of all of them; what is found need not be good.
pub fn small(entry: &Entry, model: &Model) -> Solver {
    let points = match model.state_dim() {
        _ if entry.name() == "codebook" => "5",
        1 => "161",
        2 => "31",
        _ => "3",
    };
    let settings = [
        ("points", points),
        ("first_horizon", "1"),
        ("last_horizon", "2"),
        ("runs", "20"),
        ("effort", "0.001"),
        ("cells_along", "8"),
        ("vigilances", "[0.5]"),
        ("scout", "200"),
        ("settle", "50"),
        ("explore_limit", "1000"),
        ("state_limit", "20"),
        ("epoch", "500"),
        ("epoch_per_cell", "1"),
        ("epoch_per_entry", "1"),
        ("epoch_limit", "2"),
        ("trial", "10"),
        ("strata", "4"),
        ("walks", "5"),
        ("readings", "3"),
        ("rounds", "1"),
        ("episodes", "5"),
        ("beliefs", "12"),
        ("bins", "4"),
    ];
    let known = entry.settings();
    let has = |name: &str| known.iter().any(|info| info.name == name);
    let settings: Vec<(String, String)> = settings
        .iter()
        .filter(|(name, _)| has(name))
        .map(|(name, value)| ((*name).to_owned(), (*value).to_owned()))
        .collect();
    entry.solver(&settings).unwrap()
}

/// What is asked of it.
pub fn short(form: Form) -> Request {
    Request {
        runs: 20,
        ..Request::form(form)
    }
}

/// A hallway, to be changed by each test.
pub const HALLWAY: &str = r#"
format = 1
name = "hallway"
discount = 0.9
[state]
names = ["x"]
bounds = [[0.0, 10.0]]
[start]
mean = [1.0]
covariance = [[0.5]]
[motion]
A = [[1.0]]
noise = [[0.1]]
[sensor]
noise = [[0.4]]
[actions]
FORWARD = { u = [1.0] }
BACK = { u = [-1.0] }
STAY = {}
[[reward]]
in = { x = [6.0, 7.0] }
value = 1.0
"#;

/// The hallway with texts replaced, each of which must be there.
pub fn hallway(changes: &[(&str, &str)]) -> Scenario {
    let text = changes.iter().fold(HALLWAY.to_owned(), |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replace(from, to)
    });
    scenario::read(&text, "hallway.toml").unwrap_or_else(|error| panic!("{error}"))
}
