//! From a policy to the tables of its file and back; nothing is lost either way.

use super::check::{At, Checked, Fault};
use super::file::{
    BeliefTable, CoordinateTable, Ends, FilterTable, GraphNodeTable, GraphTable, LevelTable,
    MapTable, MemoryTable, NodeTable, ObservedTable, PhaseTable, PolicyTable, RecallTable, Rows,
    SideTable, StartTable, StepTable, StratumTable, SwitchTable, WallsTable,
};
use super::{Automaton, Coordinates, GraphNode, Node, Observed, PolicyGraph, Tree};
use std::sync::Arc;

use crate::belief::{Clusters, Codebook, Filter, Memory, Recall, Updater};
use crate::model::{
    Barriers, Fingerprint, Interval, Model, Part, Region, Step, Steps, Switch, map,
};

/// Rows of a matrix that lies row by row in `numbers`.
fn rows(numbers: &[f64], columns: usize) -> Rows {
    let rows = numbers.chunks(columns.max(1));
    rows.map(<[f64]>::to_vec).collect()
}

fn ends(interval: &Interval) -> Ends {
    [
        (interval.low != f64::NEG_INFINITY).then_some(interval.low),
        (interval.high != f64::INFINITY).then_some(interval.high),
    ]
}

fn interval([low, high]: Ends) -> Interval {
    Interval::new(
        low.unwrap_or(f64::NEG_INFINITY),
        high.unwrap_or(f64::INFINITY),
    )
}

impl GraphTable {
    /// The table of a graph, which may still not be fit to be read again.
    pub(super) fn new(graph: &PolicyGraph) -> Self {
        let node = |node: &GraphNode| GraphNodeTable {
            action: node.action,
            next: node.next.clone(),
            visits: node.visits,
            gone: node.gone.clone(),
        };
        Self {
            problem: graph.problem.clone(),
            fingerprint: graph.fingerprint,
            solver: graph.solver.clone(),
            planned_value: graph.planned_value,
            actions: graph.actions.clone(),
            signals: graph.signals.clone(),
            nodes: graph.nodes.iter().map(node).collect(),
        }
    }

    /// The graph that the table describes, which has been checked.
    pub(super) fn graph(self) -> PolicyGraph {
        let node = |node: GraphNodeTable| GraphNode {
            action: node.action,
            next: node.next,
            visits: node.visits,
            gone: node.gone,
        };
        PolicyGraph {
            problem: self.problem,
            fingerprint: self.fingerprint,
            solver: self.solver,
            actions: self.actions,
            signals: self.signals,
            planned_value: self.planned_value,
            nodes: self.nodes.into_iter().map(node).collect(),
        }
    }
}

impl PolicyTable {
    /// The tables of an automaton, which may still not be fit to be read again.
    ///
    /// # Errors
    /// A fault where the automaton's levels and actions are not those of its filter.
    pub(super) fn new(automaton: &Automaton) -> Checked<Self> {
        let filter = automaton.updater.filter();
        let start = |filter: &Filter| StartTable {
            level: filter.start.0,
            mode: filter.start.1,
            mean: filter.start.2.clone(),
        };
        let table = |filter| FilterTable::new(filter, &automaton.levels).at("filter");
        Ok(Self {
            problem: automaton.problem.clone(),
            fingerprint: automaton.fingerprint,
            solver: automaton.solver.clone(),
            planned_value: automaton.planned_value,
            states: automaton.states.clone(),
            actions: automaton.actions.clone(),
            modes: automaton.modes.clone(),
            start: filter.map(start),
            filter: filter.map(table).transpose()?,
            belief: belief_table(automaton).at("belief")?,
            memory: memory(&automaton.updater),
            matching: automaton.matching,
            coordinates: automaton.coordinates.as_ref().map(coordinate_tables),
            scale: automaton.scale.clone(),
            tree: automaton.tree.as_ref().map(|tree| tree.tests.clone()),
            nodes: automaton
                .nodes
                .iter()
                .map(|node| {
                    NodeTable::new(node, node.observed.as_ref().map_or(0, |o| o.mean.len()))
                })
                .collect(),
        })
    }

    /// The automaton that the tables describe, which have been checked.
    ///
    /// # Errors
    /// A fault of the map's drawing.
    pub(super) fn automaton(self) -> Checked<Automaton> {
        let levels = match (&self.filter, &self.belief) {
            (Some(filter), _) => {
                let levels = filter.levels.iter();
                levels.map(|level| level.covariance.concat()).collect()
            }
            (None, Some(belief)) => {
                let strata = belief.strata.iter();
                strata.map(|stratum| stratum.covariance.concat()).collect()
            }
            (None, None) => Vec::new(),
        };
        let actions = self.actions.len();
        let memory = self.memory.map(|memory| memory.memory(actions));
        Ok(Automaton {
            problem: self.problem,
            fingerprint: self.fingerprint,
            solver: self.solver,
            matching: self.matching,
            updater: match (self.filter, self.start, self.belief) {
                (Some(filter), Some(start), _) => {
                    let filter = filter.filter(start).at("filter")?;
                    Updater::Linear(Filter {
                        memory: memory.unwrap_or(filter.memory),
                        ..filter
                    })
                }
                (_, _, Some(belief)) => {
                    let updater = belief.updater(self.fingerprint).at("belief")?;
                    match memory {
                        Some(memory) => updater.remembering(memory),
                        None => updater,
                    }
                }
                _ => {
                    return Err(Fault::new(
                        "neither a filter with a start nor a belief".to_owned(),
                    ));
                }
            },
            states: self.states,
            actions: self.actions,
            modes: self.modes,
            levels,
            planned_value: self.planned_value,
            coordinates: self.coordinates.map(|tables| {
                let (names, rows) = tables
                    .into_iter()
                    .map(|table| (table.name, table.vector))
                    .unzip();
                Coordinates { names, rows }
            }),
            scale: self.scale,
            tree: self.tree.map(|tests| Tree { tests }),
            nodes: self.nodes.into_iter().map(NodeTable::node).collect(),
        })
    }
}

/// The belief that an automaton keeps in full, if it does.
///
/// # Errors
/// A fault where the model that keeps it was not read from a text, or has changed since.
fn belief_table(automaton: &Automaton) -> Checked<Option<BeliefTable>> {
    let Some(codebook) = automaton.updater.codebook() else {
        return Ok(None);
    };
    let n = automaton.states.len();
    let text = automaton.updater.model_text();
    let text = text.ok_or_else(|| {
        Fault::new("its beliefs are kept by the laws of a model that a program made; write the model as a file and read it, so that the file goes with the policy".to_owned())
    })?;
    let strata = (0..codebook.len()).map(|id| {
        let stratum = codebook.stratum(id);
        StratumTable {
            covariance: rows(&stratum.covariance, n),
            modes: stratum.weights.clone(),
            step: stratum.step,
        }
    });
    let table = BeliefTable {
        tracker: automaton.updater.kind(),
        model: text.to_owned(),
        of: automaton.updater.part(),
        certain: codebook.floors().to_vec(),
        strata: strata.collect(),
    };
    table.model(automaton.fingerprint).at("model")?;
    Ok(Some(table))
}

impl BeliefTable {
    /// The model by whose laws the belief is kept, which has to be that of the policy.
    fn model(&self, fingerprint: Fingerprint) -> Checked<Model> {
        let read = crate::scenario::read(&self.model, "the model of a policy");
        let model = read.map_err(|error| Fault::new(error.to_string()))?.model;
        match model.fingerprint() == fingerprint {
            true => Ok(model),
            false => Err(Fault::new(format!(
                "its fingerprint is {}, and that of the policy {fingerprint}",
                model.fingerprint()
            ))),
        }
    }

    fn updater(self, fingerprint: Fingerprint) -> Checked<Updater> {
        let model = self.model(fingerprint).at("model")?;
        let model = match self.of {
            Part::Whole => model,
            Part::Body => model.body(),
        };
        let modes = model.modes.len();
        if let Some(stratum) = (self.strata.iter()).position(|stratum| stratum.modes.len() != modes)
        {
            let known = self.strata[stratum].modes.len();
            let message = format!("{known} probabilities, and the belief is about {modes} modes");
            return Err(Fault::new(message))
                .at("modes")
                .item(stratum)
                .at("strata");
        }
        let strata = self.strata.into_iter();
        let strata =
            strata.map(|stratum| (stratum.covariance.concat(), stratum.modes, stratum.step));
        let codebook = Arc::new(Codebook::of(self.certain, model.clock(), strata));
        Updater::coded(&model, self.tracker, codebook)
            .map_err(|error| Fault::new(error.to_string()))
    }
}

impl FilterTable {
    fn new(filter: &Filter, covariances: &[Vec<f64>]) -> Checked<Self> {
        let (n, m, actions) = (filter.states, filter.readings, filter.actions);
        if filter.next.len() != covariances.len() * actions {
            return Err(Fault::new(format!(
                "{} covariances, and the filter has {} steps of {actions} actions",
                covariances.len(),
                filter.next.len()
            )))
            .at("levels");
        }
        let (classes, examples) = classes(filter);
        let step = |edge: usize| StepTable {
            next: filter.next[edge],
            blind: filter.blind[edge],
            gain: transposed(&filter.gains[edge * n * m..(edge + 1) * n * m], n),
        };
        let level = |(level, covariance): (usize, &Vec<f64>)| LevelTable {
            covariance: rows(covariance, n),
            time: filter.times[level],
            steps: examples
                .iter()
                .map(|action| step(level * actions + action))
                .collect(),
        };
        let mut a = filter.motion.chunks(n * n).map(|a| rows(a, n));
        let mut bu = filter
            .displacements
            .chunks(actions * n)
            .map(|bu| rows(bu, n));
        let mut h = filter.sensor.chunks(m * n).map(|h| rows(h, n));
        let mut part = || {
            let parts = (a.next(), bu.next(), h.next());
            let part = |part: Option<Rows>| part.unwrap_or_default();
            (part(parts.0), part(parts.1), part(parts.2))
        };
        let (a, bu, h) = part();
        let later = filter.later.iter().map(|&from| {
            let (a, bu, h) = part();
            PhaseTable { from, a, bu, h }
        });
        Ok(Self {
            a,
            bu,
            h,
            later: later.collect(),
            classes,
            levels: covariances.iter().enumerate().map(level).collect(),
            walls: filter.walls.as_ref().map(|walls| WallsTable {
                bounds: walls.bounds.iter().map(ends).collect(),
                map: walls.map.as_ref().map(|map| MapTable {
                    cell: map.cell,
                    rows: map.rows.clone(),
                }),
            }),
        })
    }

    /// The filter without what changes modes.
    fn filter(self, start: StartTable) -> Checked<Filter> {
        let steps = || {
            let levels = self.levels.iter();
            levels.flat_map(|level| self.classes.iter().map(|class| &level.steps[*class]))
        };
        let n = self.a.len();
        let later: Vec<usize> = self.later.iter().map(|phase| phase.from).collect();
        let times: Vec<usize> = self.levels.iter().map(|level| level.time).collect();
        let phases = |first: &Rows, of: fn(&PhaseTable) -> &Rows| -> Vec<f64> {
            let rest = self.later.iter().flat_map(|phase| of(phase).concat());
            first.concat().into_iter().chain(rest).collect()
        };
        Ok(Filter {
            states: n,
            readings: self.h.len(),
            start: (start.level, start.mode, start.mean),
            next: steps().map(|step| step.next).collect(),
            blind: steps().map(|step| step.blind).collect(),
            gains: steps().flat_map(|step| columns(&step.gain)).collect(),
            phases: times
                .iter()
                .map(|time| later.partition_point(|from| from <= time))
                .collect(),
            times,
            later,
            motion: phases(&self.a, |phase| &phase.a),
            displacements: phases(&self.bu, |phase| &phase.bu),
            sensor: phases(&self.h, |phase| &phase.h),
            actions: self.bu.len(),
            memory: Memory::Switches(Vec::new()),
            walls: self
                .walls
                .map(WallsTable::barriers)
                .transpose()
                .at("walls")?,
        })
    }
}

/// The noise class of every action, and an action of every class: actions of a class lead from every level to the same one with the same
/// gain.
fn classes(filter: &Filter) -> (Vec<usize>, Vec<usize>) {
    let size = filter.states * filter.readings;
    let alike = |a: usize, b: usize| {
        (0..filter.next.len()).step_by(filter.actions).all(|level| {
            let (a, b) = (level + a, level + b);
            let gain = |edge: usize| filter.gains[edge * size..(edge + 1) * size].iter();
            filter.next[a] == filter.next[b]
                && filter.blind[a] == filter.blind[b]
                && gain(a)
                    .map(|x| x.to_bits())
                    .eq(gain(b).map(|x| x.to_bits()))
        })
    };
    let mut examples: Vec<usize> = Vec::new();
    let class = |action| {
        let known = examples.iter().position(|&example| alike(example, action));
        known.unwrap_or_else(|| {
            examples.push(action);
            examples.len() - 1
        })
    };
    ((0..filter.actions).map(class).collect(), examples)
}

/// Rows of a matrix that lies column by column in `numbers`.
fn transposed(numbers: &[f64], height: usize) -> Rows {
    let row = |row| numbers.iter().skip(row).step_by(height).copied().collect();
    (0..height).map(row).collect()
}

/// The numbers of a matrix, column by column.
fn columns(rows: &Rows) -> impl Iterator<Item = f64> {
    let width = rows.first().map_or(0, Vec::len);
    (0..width).flat_map(move |column| rows.iter().map(move |row| row[column]))
}

impl WallsTable {
    fn barriers(self) -> Checked<Barriers> {
        let map = self.map.map(|table| {
            let drawn = map::draw(&table.rows.join("\n"), table.cell);
            drawn.map_err(|fault| {
                // The drawing says the row; a cell is a number of its own.
                let rows = fault.path.steps().iter().find_map(|step| match step {
                    Step::Index(row) => Some(*row),
                    Step::Key(_) => None,
                });
                let place = rows.map_or(String::new(), |row| format!("in row {row}, "));
                Fault::new(format!("{place}{}", fault.message))
            })
        });
        Ok(Barriers {
            bounds: self.bounds.into_iter().map(interval).collect(),
            map: map.transpose().at("rows").at("map")?,
        })
    }
}

/// How the mode changes; `None` where it does not, or where a belief in full says what it is.
fn memory(updater: &Updater) -> Option<MemoryTable> {
    let memory = updater.memory()?;
    let stays = *memory == Memory::Switches(Vec::new());
    (updater.codebook().is_some() || !stays).then(|| MemoryTable::new(memory))
}

impl MemoryTable {
    fn new(memory: &Memory) -> Self {
        match memory {
            Memory::Switches(switches) => {
                Self::Switches(switches.iter().map(SwitchTable::new).collect())
            }
            Memory::Recall(recall) => Self::Recall(RecallTable::new(recall)),
        }
    }

    fn memory(self, actions: usize) -> Memory {
        match self {
            Self::Switches(switches) => {
                Memory::Switches(switches.into_iter().map(SwitchTable::switch).collect())
            }
            Self::Recall(recall) => Memory::Recall(recall.recall(actions)),
        }
    }
}

impl SwitchTable {
    fn new(switch: &Switch) -> Self {
        let side = |(state, within): &(usize, Interval)| SideTable {
            state: *state,
            within: ends(within),
        };
        Self {
            actions: switch.actions.clone(),
            mode: switch.mode,
            region: switch.region.sides.iter().map(side).collect(),
            when: switch.when,
            steps: (switch.steps != Steps::ALL).then_some((
                switch.steps.from,
                (switch.steps.until != usize::MAX).then_some(switch.steps.until),
            )),
            becomes: switch.becomes,
        }
    }

    fn switch(self) -> Switch {
        let sides = self.region.into_iter();
        Switch {
            actions: self.actions,
            mode: self.mode,
            region: Region {
                sides: sides
                    .map(|side| (side.state, interval(side.within)))
                    .collect(),
            },
            when: self.when,
            steps: self.steps.map_or(Steps::ALL, |(from, until)| Steps {
                from,
                until: until.unwrap_or(usize::MAX),
            }),
            becomes: self.becomes,
        }
    }
}

impl RecallTable {
    fn new(recall: &Recall) -> Self {
        let clusters = &recall.clusters;
        let actions = |mode: &[usize]| {
            let actions = mode.chunks(clusters.len());
            actions.map(<[usize]>::to_vec).collect()
        };
        Self {
            bounds: clusters
                .bounds
                .iter()
                .map(|bounds| [bounds.low, bounds.high])
                .collect(),
            centres: clusters.centres.clone(),
            first: recall.first.clone(),
            next: recall
                .next
                .chunks(recall.actions * clusters.len())
                .map(actions)
                .collect(),
        }
    }

    fn recall(self, actions: usize) -> Recall {
        let bounds = self.bounds.into_iter();
        Recall {
            clusters: Clusters {
                bounds: bounds.map(|[low, high]| Interval::new(low, high)).collect(),
                centres: self.centres,
            },
            actions,
            first: self.first,
            next: self.next.into_iter().flatten().flatten().collect(),
        }
    }
}

fn coordinate_tables(coordinates: &Coordinates) -> Vec<CoordinateTable> {
    let pairs = coordinates.names.iter().zip(&coordinates.rows);
    pairs
        .map(|(name, vector)| CoordinateTable {
            name: name.clone(),
            vector: vector.clone(),
        })
        .collect()
}

impl NodeTable {
    fn new(node: &Node, readings: usize) -> Self {
        Self {
            levels: [node.levels.0, node.levels.1],
            mode: node.mode,
            place: node.place.clone(),
            action: node.action,
            value: node.value,
            visits: node.visits,
            predecessors: node.predecessors.clone(),
            observed: node.observed.as_ref().map(|observed| ObservedTable {
                mean: observed.mean.clone(),
                covariance: rows(&observed.covariance, readings),
            }),
        }
    }

    fn node(self) -> Node {
        Node {
            levels: self.levels.into(),
            mode: self.mode,
            place: self.place,
            action: self.action,
            value: self.value,
            observed: self.observed.map(|observed| Observed {
                mean: observed.mean,
                covariance: observed.covariance.concat(),
            }),
            predecessors: self.predecessors,
            visits: self.visits,
        }
    }
}
