//! What every policy file fulfils, so that a policy that was read runs without looking again: sizes fit, references exist, numbers are
//! such that no step overflows, and running it takes no more memory than it may.

use std::collections::BTreeSet;
use std::fmt;

use nalgebra::DMatrix;

use super::coordinates::MOST_COORDINATES;
use super::file::{
    BeliefTable, CoordinateTable, Ends, FilterTable, GraphNodeTable, GraphTable, LevelTable,
    MapTable, MemoryTable, NodeTable, PolicyTable, RecallTable, Rows, SideTable, StepTable,
    StratumTable, SwitchTable, WallsTable,
};
use super::{Branch, Feature, Matching, Place, Test};
use crate::belief::LARGEST;
use crate::error::is_unseen;
use crate::model::{Path, Step, TrackerKind};

/// A covariance may miss symmetry and a least eigenvalue of 0 by this share of the largest entry of all levels: what rounding does.
const ROUNDING: f64 = 1e-9;
/// Most numbers of all gains together, a matrix for each level and action.
const MOST_GAINS: usize = 1 << 24;
/// Most numbers of the places that a policy compares: nodes for each level, as many numbers each as there are coordinates.
const MOST_COMPARED: usize = 1 << 23;
/// Most characters of a drawn map.
const MOST_DRAWN: usize = 1 << 20;
/// Least scale, and least side of a cell: what divides a number up to [`LARGEST`] leaves it finite when squared.
const LEAST: f64 = 1e-60;

/// What is wrong, and where in the value of `policy`.
#[derive(Debug)]
pub(super) struct Fault {
    /// From the inside out.
    place: Vec<Step>,
    message: String,
}

impl Fault {
    pub(super) fn new(message: impl Into<String>) -> Self {
        Self {
            place: Vec::new(),
            message: message.into(),
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let path = self.place.iter().rev();
        let path = path.fold(Path::default(), |path, step| match step {
            Step::Key(key) => path.key(key),
            Step::Index(index) => path.index(*index),
        });
        match self.place.is_empty() {
            true => write!(f, "{}", self.message),
            false => write!(f, "{path}: {}", self.message),
        }
    }
}

pub(super) type Checked<T = ()> = Result<T, Fault>;

/// Says of a fault where it is, the innermost first.
pub(super) trait At {
    /// In the value of this key.
    fn at(self, key: &str) -> Self;
    /// In this item.
    fn item(self, index: usize) -> Self;
}

impl<T> At for Checked<T> {
    fn at(self, key: &str) -> Self {
        self.map_err(|mut fault| {
            fault.place.push(Step::Key(key.to_owned()));
            fault
        })
    }

    fn item(self, index: usize) -> Self {
        self.map_err(|mut fault| {
            fault.place.push(Step::Index(index));
            fault
        })
    }
}

/// Sizes that others have to fit.
struct Sizes {
    states: usize,
    readings: usize,
    actions: usize,
    modes: usize,
    levels: usize,
    nodes: usize,
    /// Numbers of a place of a node.
    coordinates: usize,
    /// Numbers of the place of a belief among clusters.
    traits: usize,
    /// Whether modes are what is remembered, and no belief.
    remembers: bool,
}

impl Sizes {
    fn level(&self, level: usize) -> Checked {
        index(level, self.levels, "levels")
    }

    fn mode(&self, mode: &usize) -> Checked {
        index(*mode, self.modes, "modes")
    }

    fn action(&self, action: &usize) -> Checked {
        index(*action, self.actions, "actions")
    }
}

impl GraphTable {
    /// # Errors
    /// The first fault found.
    pub(super) fn check(&self) -> Checked {
        plain(&self.problem).at("problem")?;
        plain(&self.solver).at("solver")?;
        optional(self.planned_value).at("planned_value")?;
        names(&self.actions).at("actions")?;
        names(&self.signals).at("signals")?;
        some(&self.nodes).at("nodes")?;
        each(&self.nodes, |node| node.check(self)).at("nodes")
    }
}

impl GraphNodeTable {
    fn check(&self, graph: &GraphTable) -> Checked {
        let (nodes, ways) = (graph.nodes.len(), graph.signals.len() + 1);
        index(self.action, graph.actions.len(), "actions").at("action")?;
        if !self.next.is_empty() {
            length(&self.next, ways).at("next")?;
        }
        each(&self.next, |next| index(*next, nodes, "nodes")).at("next")?;
        share(self.visits).at("visits")?;
        length(&self.gone, self.next.len()).at("gone")?;
        each(&self.gone, |gone| share(*gone)).at("gone")
    }
}

impl PolicyTable {
    /// # Errors
    /// The first fault found.
    pub(super) fn check(&self) -> Checked {
        let sizes = Sizes {
            states: self.states.len(),
            readings: match &self.filter {
                Some(filter) => filter.h.len(),
                // The laws of the model say how many there are: here all nodes have to agree.
                None => {
                    let mut observed = self.nodes.iter().filter_map(|node| node.observed.as_ref());
                    observed.next().map_or(0, |observed| observed.mean.len())
                }
            },
            actions: self.actions.len(),
            modes: self.modes.len(),
            levels: match (&self.filter, &self.belief) {
                (Some(filter), _) => filter.levels.len(),
                (None, belief) => belief.as_ref().map_or(0, |belief| belief.strata.len()),
            },
            nodes: self.nodes.len(),
            coordinates: match &self.coordinates {
                None => self.states.len(),
                Some(coordinates) => coordinates.len(),
            },
            traits: match &self.belief {
                None => 0,
                Some(belief) => belief.strata.first().map_or(0, StratumTable::traits),
            },
            remembers: self.memory.is_some(),
        };
        plain(&self.problem).at("problem")?;
        plain(&self.solver).at("solver")?;
        optional(self.planned_value).at("planned_value")?;
        names(&self.states).at("states")?;
        names(&self.actions).at("actions")?;
        some(&self.modes).at("modes")?;
        each(&self.modes, |name| plain(name)).at("modes")?;
        if let (Some(start), Some(_)) = (&self.start, &self.filter) {
            sizes.level(start.level).at("level").at("start")?;
            sizes.mode(&start.mode).at("mode").at("start")?;
            vector(&start.mean, sizes.states).at("mean").at("start")?;
        }
        match (&self.filter, &self.start, &self.belief) {
            (Some(filter), Some(_), None) => filter.check(&sizes).at("filter")?,
            (None, None, Some(belief)) => belief.check(&sizes).at("belief")?,
            (None, _, None) => {
                return Err(Fault::new("missing field `filter`, or else `belief`"));
            }
            (Some(_), None, None) => return Err(Fault::new("missing field `start`")),
            (_, _, Some(_)) => {
                return Err(Fault::new("`filter` and `start` do not go with `belief`"));
            }
        }
        if let Some(memory) = &self.memory {
            memory.check(&sizes).at("memory")?;
        }
        if let Some(coordinates) = &self.coordinates {
            check_coordinates(coordinates, &sizes).at("coordinates")?;
        }
        vector(&self.scale, sizes.coordinates).at("scale")?;
        each(&self.scale, |scale| at_least_least(*scale)).at("scale")?;
        if self.tree.is_some() != (self.matching == Matching::Tree) {
            return Err(Fault::new(
                "a tree belongs to `matching = \"tree\"`, and to nothing else",
            ))
            .at("tree");
        }
        if let Some(tests) = &self.tree {
            check_tree(tests, &sizes).at("tree")?;
        }
        some(&self.nodes).at("nodes")?;
        each(&self.nodes, |node| node.check(self.matching, &sizes)).at("nodes")?;
        self.check_compared(&sizes).at("nodes")
    }

    /// A mode without nodes has those of all others for candidates.
    fn check_compared(&self, sizes: &Sizes) -> Checked {
        let inhabited: BTreeSet<usize> = self.nodes.iter().map(|node| node.mode).collect();
        let tables = sizes.modes - inhabited.len() + 1;
        let numbers = [tables, sizes.levels, sizes.nodes, sizes.coordinates];
        at_most(MOST_COMPARED, &numbers, || {
            format!(
                "{} nodes in {} coordinates at {} levels, and again for each of {} modes without nodes of their own",
                sizes.nodes,
                sizes.coordinates,
                sizes.levels,
                tables - 1
            )
        })
    }
}

impl FilterTable {
    fn check(&self, sizes: &Sizes) -> Checked {
        let (n, m) = (sizes.states, sizes.readings);
        some(&self.h).at("H")?;
        matrix(&self.a, n, n).at("A")?;
        matrix(&self.bu, sizes.actions, n).at("Bu")?;
        matrix(&self.h, m, n).at("H")?;
        let begins = self.later.iter().map(|phase| phase.from);
        let before: Vec<usize> = std::iter::once(0).chain(begins).collect();
        let phases: Vec<_> = self.later.iter().zip(before).collect();
        each(&phases, |(phase, before)| {
            if phase.from <= *before {
                let message = format!("{} where more than {before} belongs", phase.from);
                return Err(Fault::new(message)).at("from");
            }
            matrix(&phase.a, n, n).at("A")?;
            matrix(&phase.bu, sizes.actions, n).at("Bu")?;
            matrix(&phase.h, m, n).at("H")
        })
        .at("later")?;
        some(&self.levels).at("levels")?;
        let classes = self.levels[0].steps.len();
        length(&self.classes, sizes.actions).at("classes")?;
        each(&self.classes, |class| {
            index(*class, classes, "noise classes")
        })
        .at("classes")?;
        at_most(MOST_GAINS, &[sizes.levels, sizes.actions, n, m], || {
            format!(
                "gains of {n} x {m} at {} levels for {} actions",
                sizes.levels, sizes.actions
            )
        })
        .at("levels")?;
        let covariances = self.levels.iter().map(|level| &level.covariance);
        let entries = covariances.flatten().flatten();
        let largest = entries.fold(0.0, |largest: f64, entry| largest.max(entry.abs()));
        each(&self.levels, |level| level.check(sizes, classes, largest)).at("levels")?;
        match &self.walls {
            Some(walls) => walls.check(sizes).at("walls"),
            None => Ok(()),
        }
    }
}

impl BeliefTable {
    fn check(&self, sizes: &Sizes) -> Checked {
        if !matches!(self.tracker, TrackerKind::Sum | TrackerKind::Cells) {
            return Err(Fault::new("`sum` or `cells` belongs here")).at("tracker");
        }
        vector(&self.certain, sizes.states).at("certain")?;
        each(&self.certain, |certain| match *certain > 0.0 {
            true => Ok(()),
            false => Err(Fault::new(format!("{certain} where more than 0 belongs"))),
        })
        .at("certain")?;
        some(&self.strata).at("strata")?;
        let entries = self
            .strata
            .iter()
            .flat_map(|stratum| stratum.covariance.iter());
        let largest = entries
            .flatten()
            .fold(0.0, |largest: f64, entry| largest.max(entry.abs()));
        each(
            &self.strata,
            |StratumTable {
                 covariance: matrix_,
                 modes,
                 step: _,
             }| {
                matrix(matrix_, sizes.states, sizes.states).at("covariance")?;
                covariance(matrix_, largest).at("covariance")?;
                let probabilities = match sizes.remembers {
                    true => modes.len(),
                    false => sizes.modes,
                };
                vector(modes, probabilities).at("modes")?;
                let sum: f64 = modes.iter().sum();
                match modes.iter().all(|weight| *weight >= 0.0) && (sum - 1.0).abs() < 1e-6 {
                    true => Ok(()),
                    false => Err(Fault::new("no probabilities that sum to 1")).at("modes"),
                }
            },
        )
        .at("strata")
    }
}

impl StratumTable {
    /// Numbers that tell where it is among clusters.
    fn traits(&self) -> usize {
        1 + if self.modes.len() > 1 {
            self.modes.len()
        } else {
            0
        }
    }
}

impl LevelTable {
    fn check(&self, sizes: &Sizes, classes: usize, largest: f64) -> Checked {
        let n = sizes.states;
        length(&self.steps, classes).at("steps")?;
        each(&self.steps, |StepTable { next, blind, gain }| {
            sizes.level(*next).at("next")?;
            sizes.level(*blind).at("blind")?;
            matrix(gain, n, sizes.readings).at("gain")
        })
        .at("steps")?;
        matrix(&self.covariance, n, n).at("covariance")?;
        covariance(&self.covariance, largest).at("covariance")
    }
}

impl WallsTable {
    fn check(&self, sizes: &Sizes) -> Checked {
        length(&self.bounds, sizes.states).at("bounds")?;
        each(&self.bounds, rising).at("bounds")?;
        match &self.map {
            Some(map) => map.check(sizes).at("map"),
            None => Ok(()),
        }
    }
}

impl MapTable {
    /// Sizes only: the drawing itself is looked at when it is drawn.
    fn check(&self, sizes: &Sizes) -> Checked {
        if sizes.states < 2 {
            return Err(Fault::new(
                "a map has two directions, and there is one state variable",
            ));
        }
        number(self.cell).at("cell")?;
        at_least_least(self.cell).at("cell")?;
        let drawn = self.rows.iter().map(String::len).sum();
        at_most(MOST_DRAWN, &[drawn], || format!("{drawn} characters")).at("rows")?;
        each(&self.rows, |row| plain(row)).at("rows")
    }
}

impl MemoryTable {
    fn check(&self, sizes: &Sizes) -> Checked {
        match self {
            Self::Switches(switches) => each(switches, |switch| switch.check(sizes)).at("switches"),
            Self::Recall(recall) => recall.check(sizes).at("recall"),
        }
    }
}

impl SwitchTable {
    fn check(&self, sizes: &Sizes) -> Checked {
        if let Some(actions) = &self.actions {
            each(actions, |action| sizes.action(action)).at("actions")?;
        }
        if let Some(mode) = &self.mode {
            sizes.mode(mode).at("mode")?;
        }
        each(&self.region, |SideTable { state, within }| {
            index(*state, sizes.states, "state variables").at("state")?;
            rising(within).at("within")
        })
        .at("region")?;
        sizes.mode(&self.becomes).at("becomes")
    }
}

impl RecallTable {
    fn check(&self, sizes: &Sizes) -> Checked {
        let axes = sizes.states + sizes.traits;
        length(&self.bounds, axes).at("bounds")?;
        each(&self.bounds, |bounds| rising(&bounds.map(Some))).at("bounds")?;
        let clusters = self.centres.len();
        some(&self.centres).at("centres")?;
        each(&self.centres, |centre| vector(centre, axes)).at("centres")?;
        length(&self.first, clusters).at("first")?;
        each(&self.first, |mode| sizes.mode(mode)).at("first")?;
        length(&self.next, sizes.modes).at("next")?;
        each(&self.next, |actions| {
            length(actions, sizes.actions)?;
            each(actions, |next| {
                length(next, clusters)?;
                each(next, |mode| sizes.mode(mode))
            })
        })
        .at("next")
    }
}

fn check_feature(feature: Feature, sizes: &Sizes) -> Checked {
    match feature {
        Feature::Mean(variable) | Feature::Deviation(variable) => {
            index(variable, sizes.states, "state variables")
        }
        Feature::Mode(mode) => sizes.mode(&mode),
        Feature::Step => Ok(()),
    }
}

/// Tests lead forward only, so that every belief arrives at a node.
fn check_tree(tests: &[Test], sizes: &Sizes) -> Checked {
    let numbered: Vec<(usize, &Test)> = tests.iter().enumerate().collect();
    each(&numbered, |(number_, test)| {
        check_feature(test.feature, sizes).at("feature")?;
        // As many as there are features: means, deviations, modes and the step.
        let most = 2 * sizes.states + sizes.modes + 1;
        if test.plus.len() > most {
            let terms = test.plus.len();
            return Err(Fault::new(format!("{terms} terms, of at most {most}"))).at("plus");
        }
        each(&test.plus, |term| {
            number(term.times).at("times")?;
            check_feature(term.feature, sizes).at("feature")
        })
        .at("plus")?;
        number(test.less_than).at("less_than")?;
        for (key, branch) in [("yes", test.yes), ("no", test.no)] {
            match branch {
                Branch::Node(node) => index(node, sizes.nodes, "nodes").at(key)?,
                Branch::Test(next) => {
                    index(next, tests.len(), "tests").at(key)?;
                    if next <= *number_ {
                        let message = format!("test {next}, which does not come later");
                        return Err(Fault::new(message)).at(key);
                    }
                }
            }
        }
        Ok(())
    })
}

fn check_coordinates(coordinates: &[CoordinateTable], sizes: &Sizes) -> Checked {
    if !(1..=MOST_COORDINATES).contains(&coordinates.len()) {
        let count = coordinates.len();
        return Err(Fault::new(format!(
            "{count} items where 1 to {MOST_COORDINATES} belong"
        )));
    }
    each(coordinates, |coordinate| {
        plain(&coordinate.name).at("name")?;
        vector(&coordinate.vector, sizes.states).at("vector")
    })
}

impl NodeTable {
    fn check(&self, matching: Matching, sizes: &Sizes) -> Checked {
        let [first, last] = self.levels;
        sizes.level(last).item(1).at("levels")?;
        if first > last {
            let message = format!("the first level, {first}, is after the last, {last}");
            return Err(Fault::new(message)).at("levels");
        }
        sizes.mode(&self.mode).at("mode")?;
        sizes.action(&self.action).at("action")?;
        check_place(&self.place, matching, sizes.coordinates).at("place")?;
        optional(self.value).at("value")?;
        share(self.visits).at("visits")?;
        each(&self.predecessors, |&(node, count)| {
            index(node, sizes.nodes, "nodes").item(0)?;
            number(count).item(1)?;
            match count >= 0.0 {
                true => Ok(()),
                false => Err(Fault::new(format!("{count} where 0 or more belongs"))).item(1),
            }
        })
        .at("predecessors")?;
        let Some(observed) = &self.observed else {
            return Ok(());
        };
        let m = sizes.readings;
        vector(&observed.mean, m).at("mean").at("observed")?;
        matrix(&observed.covariance, m, m)
            .at("covariance")
            .at("observed")
    }
}

fn check_place(place: &Place, matching: Matching, coordinates: usize) -> Checked {
    match (place, matching) {
        (Place::Point(point), Matching::Nearest) => vector(point, coordinates).at("point"),
        (
            Place::Segment {
                lower,
                minimum,
                upper,
            },
            Matching::Segments | Matching::Tree,
        ) => {
            for (key, corner) in [("lower", lower), ("minimum", minimum), ("upper", upper)] {
                vector(corner, coordinates).at(key).at("segment")?;
            }
            let inside = |i: &usize| lower[*i] <= minimum[*i] && minimum[*i] <= upper[*i];
            match (0..coordinates).find(|i| !inside(i)) {
                None => Ok(()),
                Some(i) => Err(Fault::new(format!(
                    "the point of least value, {}, is not between {} and {}",
                    minimum[i], lower[i], upper[i]
                )))
                .item(i)
                .at("minimum")
                .at("segment"),
            }
        }
        (_, Matching::Nearest) => Err(Fault::new(
            "a segment, where matching by `nearest` has points",
        )),
        (_, Matching::Segments | Matching::Tree) => Err(Fault::new(
            "a point, where matching by `segments` or `tree` has segments",
        )),
    }
}

fn each<T>(list: &[T], check: impl Fn(&T) -> Checked) -> Checked {
    let mut items = list.iter().enumerate();
    items.try_for_each(|(i, item)| check(item).item(i))
}

/// Text that may be shown: without control characters, and without those that turn the direction of writing.
fn plain(text: &str) -> Checked {
    match text.chars().find(|c| is_unseen(*c)) {
        Some(c) => Err(Fault::new(format!(
            "the control character {}",
            c.escape_unicode()
        ))),
        None => Ok(()),
    }
}

/// Names, at least one, none of them empty and no two the same.
fn names(names: &[String]) -> Checked {
    some(names)?;
    each(names, |name| plain(name))?;
    let mut known = BTreeSet::new();
    for (i, name) in names.iter().enumerate() {
        if name.is_empty() {
            return Err(Fault::new("an empty name")).item(i);
        }
        if !known.insert(name) {
            return Err(Fault::new(format!("`{name}` is there already"))).item(i);
        }
    }
    Ok(())
}

fn some<T>(list: &[T]) -> Checked {
    match list {
        [] => Err(Fault::new("the list is empty")),
        _ => Ok(()),
    }
}

fn length<T>(list: &[T], expected: usize) -> Checked {
    if list.len() == expected {
        return Ok(());
    }
    let items = list.len();
    Err(Fault::new(format!("{items} items where {expected} belong")))
}

/// A product of sizes that is limited, because memory is.
fn at_most(limit: usize, sizes: &[usize], what: impl Fn() -> String) -> Checked {
    let mut sizes = sizes.iter();
    let product = sizes.try_fold(1_usize, |product, size| product.checked_mul(*size));
    if product.is_some_and(|product| product <= limit) {
        return Ok(());
    }
    Err(Fault::new(format!(
        "{} are more than the {limit} allowed",
        what()
    )))
}

fn index(value: usize, count: usize, what: &str) -> Checked {
    if value < count {
        return Ok(());
    }
    Err(Fault::new(format!(
        "{value}, and there are {count} {what}, counted from 0"
    )))
}

fn number(value: f64) -> Checked {
    if value.abs() <= LARGEST {
        return Ok(());
    }
    Err(Fault::new(format!(
        "{value:e}, and no number may be larger than {LARGEST:e} in magnitude"
    )))
}

fn share(value: f64) -> Checked {
    match (0.0..=1.0).contains(&value) {
        true => Ok(()),
        false => Err(Fault::new(format!("{value} is no share of all steps"))),
    }
}

fn optional(value: Option<f64>) -> Checked {
    value.map_or(Ok(()), number)
}

fn at_least_least(value: f64) -> Checked {
    if value >= LEAST {
        return Ok(());
    }
    Err(Fault::new(format!(
        "{value:e} where at least {LEAST:e} belongs"
    )))
}

fn vector(values: &[f64], expected: usize) -> Checked {
    length(values, expected)?;
    each(values, |value| number(*value))
}

fn matrix(rows: &Rows, height: usize, width: usize) -> Checked {
    length(rows, height)?;
    each(rows, |row| vector(row, width))
}

/// Ends in order; one that is not there is beyond all others.
fn rising(ends: &Ends) -> Checked {
    each(ends, |end| optional(*end))?;
    match ends {
        [Some(low), Some(high)] if low >= high => Err(Fault::new(format!(
            "the lower end {low} is not below the upper end {high}"
        ))),
        _ => Ok(()),
    }
}

/// Checks that a square matrix is symmetric and positive semi-definite, up to a share of the `largest` entry of all.
fn covariance(rows: &Rows, largest: f64) -> Checked {
    if largest == 0.0 {
        return Ok(());
    }
    let n = rows.len();
    for (i, j) in (0..n).flat_map(|i| (0..i).map(move |j| (i, j))) {
        let (below, above) = (rows[i][j], rows[j][i]);
        if (below - above).abs() > ROUNDING * largest {
            let message = format!("{below}, and across the diagonal is {above}: not symmetric");
            return Err(Fault::new(message)).item(j).item(i);
        }
    }
    // What is semi-definite up to rounding is definite with a little more than that on its diagonal.
    let raised = DMatrix::from_fn(n, n, |i, j| {
        let entry = rows[i.max(j)][i.min(j)] / largest;
        if i == j {
            entry + 2.0 * ROUNDING
        } else {
            entry
        }
    });
    if raised.cholesky().is_some() {
        return Ok(());
    }
    Err(Fault::new(
        "not positive semi-definite: variances are not negative, correlations at most 1",
    ))
}
