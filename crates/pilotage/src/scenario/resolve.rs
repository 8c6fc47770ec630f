//! From the tables of a model file to a [`Model`]: names become indices, defaults are filled in.

use nalgebra::{DMatrix, DVector};

use super::file::{
    ActionTable, ControlTable, EventTable, Kind, ModelFile, Plant, RewardTable, Rows, RuleTable,
    StartTable, StateTable, StepsTable, WorldMotionTable,
};
use super::file_value::{Ends, OneOrMany, Sides, Where};
use super::laws::{self, Writing, readings};
use super::*;
use crate::model::error::{Fault, Path};
use crate::model::map::{self, Map};
use crate::model::validate::{MOST_DIMENSIONS, at_most, check_names};
use crate::model::*;

/// Builds the scenario and validates it; faults are placed where the file says the thing.
pub(super) fn resolve(file: ModelFile) -> Result<Scenario, Fault> {
    if file.discount == 1.0 && file.episode.length.is_none() {
        return Err(Fault::new(
            Path::new("discount"),
            "a discount of 1 needs a stated length of the episode",
            "add `length` to [episode], or give a discount below 1",
        ));
    }
    let map = file
        .map
        .as_ref()
        .map(|map| map::draw(&map.rows, map.cell))
        .transpose()?;
    let names = Names {
        state: file.state.names.clone(),
        modes: if file.state.modes.is_empty() {
            vec![String::new()]
        } else {
            file.state.modes.clone()
        },
        actions: file
            .actions
            .0
            .iter()
            .map(|(name, _)| name.clone())
            .collect(),
        marks: map.as_ref().map(|map| map.marks.clone()),
        solid: map.as_ref().map(Map::solid).unwrap_or_default(),
    };
    check_names(&names.state, &names.modes, &names.actions)?;
    let mut motion = motion(&file)?;
    let controls = motion.b.ncols();
    at_most(
        controls,
        MOST_DIMENSIONS,
        "controls",
        Path::new("motion").key("B"),
    )?;
    let writing = Writing::new(&names.state, controls);
    let (reward_lines, rewards) = numbered(&file.reward, "reward", |table, path| {
        names.rewards(table, path, &writing)
    })?;
    let (event_lines, events) = numbered(&file.event, "event", |table, path| {
        names.events(table, path)
    })?;
    let truth = Truth {
        simulator: simulator(&file)?,
        walls: file.world.walls,
        start: match &file.world.start {
            Some(start) => Some(names.start(start, Path::new("world").key("start"))?),
            None => None,
        },
        motion: names.true_motion(&file.world.motion)?,
    };
    let mut sensor = sensor(&file)?;
    let noise = |table: &str| Path::new(table).key("noise");
    if let Some(noise) = laws::constant(&file.motion.noise, &writing, noise("motion"))? {
        motion.noise = noise;
    }
    if let Some(noise) = laws::constant(&file.sensor.noise, &writing, noise("sensor"))? {
        sensor.noise = noise;
    }
    if let Some(present) = &file.sensor.present {
        let path = Path::new("sensor").key("present");
        let present = writing.formula(present, path)?.constant();
        sensor.present = present.unwrap_or(sensor.present);
    }
    let rule = names.rule(&file.rule)?;
    let mut state = state_variables(&file.state, map.as_ref())?;
    for (variable, kind) in state.iter_mut().zip(laws::kinds(&file.state, &names)?) {
        variable.kind = kind;
    }
    let model = Model {
        laws: laws::laws(&file, &names, &writing)?,
        state,
        start: told(&file, names.start(&file.start, Path::new("start"))?)?,
        later: later(&file, &motion, &sensor)?,
        sensor,
        actions: file
            .actions
            .0
            .iter()
            .map(|(name, table)| action(name, table, controls))
            .collect::<Result<_, _>>()?,
        motion,
        rewards,
        events,
        cost: cost(&file)?,
        episode: episode(&file, &names)?,
        belief: belief(&file),
        map,
        text: ModelText::default(),
        modes: names.modes,
        name: match file.told {
            Some(start) => format!("{}{TOLD}{start}", file.name),
            None => file.name,
        },
        about: file.about,
        discount: file.discount,
    };
    let scenario = Scenario { model, truth, rule };
    scenario.validate().map_err(|mut fault| {
        fault.path.renumber("reward", &reward_lines);
        fault.path.renumber("event", &event_lines);
        fault
    })?;
    Ok(scenario)
}

/// The starts that are left if the agent is told which it is.
fn told(file: &ModelFile, starts: Vec<StartHypothesis>) -> Result<Vec<StartHypothesis>, Fault> {
    let Some(number) = file.told else {
        return Ok(starts);
    };
    let fault = |what: String, hint: &str| Fault::of_key(Path::new("told"), what, hint);
    if file.world.start.is_some() {
        let what = "`told` says where an episode begins, and `start` in [world] does as well";
        return Err(fault(what.to_owned(), "delete one of them"));
    }
    let count = starts.len();
    let chosen = number
        .checked_sub(1)
        .and_then(|i| starts.into_iter().nth(i));
    let Some(start) = chosen else {
        let what = format!("there is no start {number}: there are {count}, counted from 1");
        return Err(fault(
            what,
            "give the number of one of the [[start]] tables",
        ));
    };
    Ok(vec![StartHypothesis {
        weight: 1.0,
        ..start
    }])
}

/// The names that a file declares and its other tables refer to.
pub(super) struct Names {
    pub(super) state: Vec<String>,
    modes: Vec<String>,
    actions: Vec<String>,
    /// Marked cells of the map, if there is one.
    marks: Option<Vec<(char, Region)>>,
    /// Where the map lets no state be.
    solid: Vec<Region>,
}

impl Names {
    fn mode(&self, name: &Option<String>, path: Path) -> Result<Option<ModeId>, Fault> {
        name.as_ref()
            .map(|name| index_of(&self.modes, "mode", name, path))
            .transpose()
    }

    pub(super) fn mode_named(&self, name: &str, path: Path) -> Result<ModeId, Fault> {
        index_of(&self.modes, "mode", name, path)
    }

    pub(super) fn variable(&self, name: &str, path: Path) -> Result<usize, Fault> {
        index_of(&self.state, "state variable", name, path)
    }

    pub(super) fn action_list(
        &self,
        list: &Option<OneOrMany<String>>,
        path: &Path,
    ) -> Result<Option<Vec<ActionId>>, Fault> {
        let path = path.clone().key("action");
        let find = |(i, name): (usize, &String)| {
            index_of(&self.actions, "action", name, path.clone().index(i))
        };
        list.as_ref()
            .map(|list| list.as_slice().iter().enumerate().map(find).collect())
            .transpose()
    }

    fn region(&self, sides: &Sides, path: &Path) -> Result<Region, Fault> {
        let sides = sides.iter().map(|(name, &Ends(interval))| {
            let path = path.clone().key(name);
            let variable =
                index_of(&self.state, "state variable", name, path).map_err(|fault| Fault {
                    on_key: true,
                    ..fault
                })?;
            Ok((variable, interval))
        });
        Ok(Region::new(sides.collect::<Result<_, _>>()?))
    }

    /// The boxes that a place consists of.
    fn regions(&self, place: &Option<Where>, path: &Path) -> Result<Vec<Region>, Fault> {
        let path = path.clone().key("in");
        match place {
            None => Ok(vec![Region::everywhere()]),
            Some(Where::Box(sides)) => Ok(vec![self.region(sides, &path)?]),
            Some(Where::Mark(mark)) => self.marked(mark, path),
        }
    }

    fn marked(&self, mark: &str, path: Path) -> Result<Vec<Region>, Fault> {
        let Some(marks) = &self.marks else {
            return Err(Fault::new(
                path,
                format!("`{mark}` is a mark of a map, and this model has no map"),
                "add a [map], or give intervals such as { x = [0.0, 1.0] }",
            ));
        };
        if mark == "#" {
            return Ok(self.solid.clone());
        }
        let regions: Vec<Region> = marks
            .iter()
            .filter(|(known, _)| mark.chars().eq([*known]))
            .map(|(_, region)| region.clone())
            .collect();
        if !regions.is_empty() {
            return Ok(regions);
        }
        let mut known: Vec<String> = marks.iter().map(|(mark, _)| format!("`{mark}`")).collect();
        known.sort();
        known.dedup();
        let drawn = if known.is_empty() {
            "it has no marks".to_owned()
        } else {
            format!("its marks: {}", known.join(", "))
        };
        Err(Fault::new(
            path,
            format!("no cell of the map is marked `{mark}`"),
            format!("mark one in the drawing; {drawn}"),
        ))
    }

    fn rewards(
        &self,
        table: &RewardTable,
        path: &Path,
        writing: &Writing,
    ) -> Result<Vec<Reward>, Fault> {
        let amount = writing.formula(&table.value, path.clone().key("value"))?;
        let value = amount.constant();
        let actions = self.action_list(&table.action, path)?;
        let mode = self.mode(&table.mode, path.clone().key("mode"))?;
        let regions = self.regions(&table.place, path)?;
        let steps = steps(&table.steps, path)?;
        Ok(regions
            .into_iter()
            .map(|region| Reward {
                actions: actions.clone(),
                mode,
                region,
                when: table.when,
                steps,
                value: value.unwrap_or(0.0),
                formula: value.is_none().then(|| amount.clone()),
            })
            .collect())
    }

    fn events(&self, table: &EventTable, path: &Path) -> Result<Vec<Event>, Fault> {
        let actions = self.action_list(&table.action, path)?;
        let mode = self.mode(&table.mode, path.clone().key("mode"))?;
        let becomes = self.mode(&table.becomes, path.clone().key("becomes"))?;
        let regions = self.regions(&table.place, path)?;
        let steps = steps(&table.steps, path)?;
        Ok(regions
            .into_iter()
            .map(|region| Event {
                actions: actions.clone(),
                mode,
                region,
                when: table.when,
                steps,
                probability: table.probability.unwrap_or(1.0),
                becomes,
                reward: table.reward,
                then: table.then,
            })
            .collect())
    }

    fn start(
        &self,
        start: &OneOrMany<StartTable>,
        path: Path,
    ) -> Result<Vec<StartHypothesis>, Fault> {
        let tables = start.as_slice();
        let equal = 1.0 / tables.len() as f64;
        let hypothesis = |(i, table): (usize, &StartTable)| {
            let path = path.clone().index(i);
            let weight = table.weight.unwrap_or(equal);
            let mode = self
                .mode(&table.mode, path.clone().key("mode"))?
                .unwrap_or(0);
            self.distribution(table, weight, mode, path)
        };
        tables.iter().enumerate().map(hypothesis).collect()
    }

    fn distribution(
        &self,
        table: &StartTable,
        weight: f64,
        mode: ModeId,
        path: Path,
    ) -> Result<StartHypothesis, Fault> {
        let missing = |key: &str| {
            Fault::new(
                path.clone(),
                format!("the key `{key}` is missing"),
                format!("add `{key}`, or `uniform = {{ x = [low, high] }}`"),
            )
        };
        let Some(sides) = &table.uniform else {
            let mean = table.mean.as_ref().ok_or_else(|| missing("mean"))?;
            let covariance = table.covariance.as_ref();
            let covariance = covariance.ok_or_else(|| missing("covariance"))?;
            return Ok(StartHypothesis {
                weight,
                mode,
                mean: DVector::from_column_slice(mean),
                covariance: matrix(covariance, path.key("covariance"))?,
                shape: StartShape::Normal,
            });
        };
        for (key, given) in [
            ("mean", table.mean.is_some()),
            ("covariance", table.covariance.is_some()),
        ] {
            if given {
                return Err(Fault::of_key(
                    path.clone().key(key),
                    format!("`{key}` is given, and also comes from `uniform`"),
                    format!("delete `{key}` or `uniform`"),
                ));
            }
        }
        self.uniform(sides, weight, mode, path.key("uniform"))
    }

    fn uniform(
        &self,
        sides: &Sides,
        weight: f64,
        mode: ModeId,
        path: Path,
    ) -> Result<StartHypothesis, Fault> {
        let region = self.region(sides, &path)?;
        if let Some(name) = self.state.iter().find(|&name| !sides.contains_key(name)) {
            return Err(Fault::new(
                path,
                format!("the box has no side for `{name}`"),
                format!("add `{name} = [low, high]`"),
            ));
        }
        for &(variable, side) in &region.sides {
            if !(side.low < side.high && side.width().is_finite()) {
                return Err(Fault::new(
                    path.key(&self.state[variable]),
                    format!("[{}, {}] is no box to draw from", side.low, side.high),
                    "give two numbers, the lower first",
                ));
            }
        }
        let sides = || region.sides.iter().map(|&(_, side)| side);
        let n = self.state.len();
        Ok(StartHypothesis {
            weight,
            mode,
            mean: DVector::from_iterator(n, sides().map(|side| 0.5 * (side.low + side.high))),
            covariance: DMatrix::from_diagonal(&DVector::from_iterator(
                n,
                sides().map(|side| side.width() * side.width() / 12.0),
            )),
            shape: StartShape::Uniform,
        })
    }

    fn rule(&self, tables: &[RuleTable]) -> Result<Option<HandRule>, Fault> {
        let Some((last, first)) = tables.split_last() else {
            return Ok(None);
        };
        let modes = self.modes.iter().filter(|mode| !mode.is_empty());
        let known = HandRule::names(
            self.state.iter().map(String::as_str),
            modes.map(String::as_str),
        );
        let path = |i| Path::new("rule").index(i);
        let action = |i, table: &RuleTable| {
            index_of(&self.actions, "action", &table.action, path(i).key("do"))
        };
        if last.when.is_some() {
            return Err(Fault::of_key(
                path(first.len()).key("when"),
                "where none of the conditions holds, nothing is said of what to do",
                "end with a [[rule]] without `when`",
            ));
        }
        let clause = |(i, table): (usize, &RuleTable)| {
            let Some(when) = &table.when else {
                return Err(Fault::new(
                    path(i),
                    "this always holds, so that those after it are never asked",
                    "give it a condition `when`, or delete those after it",
                ));
            };
            Ok(RuleClause {
                when: rule::condition(when, &known, path(i).key("when"))?,
                action: action(i, table)?,
            })
        };
        let clauses = first.iter().enumerate().map(clause);
        Ok(Some(HandRule::new(
            clauses.collect::<Result<_, _>>()?,
            action(first.len(), last)?,
        )))
    }

    fn true_motion(&self, table: &Option<WorldMotionTable>) -> Result<TrueMotion, Fault> {
        let Some(table) = table else {
            return Ok(TrueMotion::default());
        };
        let path = Path::new("world").key("motion");
        let control = |(i, table): (usize, &ControlTable)| {
            let path = path.clone().key("control").index(i);
            Ok(TrueControl {
                actions: self.action_list(&table.action, &path)?,
                mode: self.mode(&table.mode, path.key("mode"))?,
                control: DVector::from_column_slice(&table.u),
            })
        };
        Ok(TrueMotion {
            noise: optional_matrix(&table.noise, path.clone().key("noise"))?,
            controls: table
                .control
                .iter()
                .enumerate()
                .map(control)
                .collect::<Result<_, _>>()?,
        })
    }
}

fn index_of(known: &[String], kind: &str, name: &str, path: Path) -> Result<usize, Fault> {
    known
        .iter()
        .position(|known| known == name && !known.is_empty())
        .ok_or_else(|| Fault::unknown(path, kind, name, known.iter().map(String::as_str)))
}

/// Resolves each table of a list, which may become several items; also returns which table each item is from.
fn numbered<T, U>(
    tables: &[T],
    key: &str,
    resolve: impl Fn(&T, &Path) -> Result<Vec<U>, Fault>,
) -> Result<(Vec<usize>, Vec<U>), Fault> {
    /// Most of them; where a map has many marks, a single table stands for as many.
    const MOST: usize = 100_000;
    let mut lines = Vec::new();
    let mut items = Vec::new();
    for (i, table) in tables.iter().enumerate() {
        let path = Path::new(key).index(i);
        let resolved = resolve(table, &path)?;
        at_most(items.len() + resolved.len(), MOST, "boxes in all", path)?;
        lines.extend(resolved.iter().map(|_| i));
        items.extend(resolved);
    }
    Ok((lines, items))
}

pub(super) fn matrix(rows: &Rows, path: Path) -> Result<DMatrix<f64>, Fault> {
    let columns = rows.first().map_or(0, Vec::len);
    if let Some(row) = rows.iter().position(|row| row.len() != columns) {
        return Err(Fault::new(
            path.index(row),
            format!(
                "row {} has {} numbers and the first row has {columns}",
                row + 1,
                rows[row].len()
            ),
            "make all rows equally long",
        ));
    }
    Ok(DMatrix::from_row_iterator(
        rows.len(),
        columns,
        rows.iter().flatten().copied(),
    ))
}

pub(super) fn optional_matrix(
    rows: &Option<Rows>,
    path: Path,
) -> Result<Option<DMatrix<f64>>, Fault> {
    rows.as_ref().map(|rows| matrix(rows, path)).transpose()
}

fn state_variables(table: &StateTable, map: Option<&Map>) -> Result<Vec<StateVariable>, Fault> {
    let bounds: Vec<Interval> = match &table.bounds {
        Some(pairs) => pairs.iter().map(|&Ends(interval)| interval).collect(),
        None => {
            let extent = map.map(Map::extent).into_iter().flatten();
            extent
                .chain(std::iter::repeat(Interval::ALL))
                .take(table.names.len())
                .collect()
        }
    };
    if bounds.len() != table.names.len() {
        return Err(Fault::new(
            Path::new("state").key("bounds"),
            format!(
                "{} pairs of bounds for {} state variables",
                bounds.len(),
                table.names.len()
            ),
            "give one pair [low, high] for each of `names`",
        ));
    }
    Ok(table
        .names
        .iter()
        .cloned()
        .zip(bounds)
        .map(|(name, bounds)| StateVariable {
            name,
            bounds,
            kind: VariableKind::Real,
        })
        .collect())
}

fn motion(file: &ModelFile) -> Result<Motion, Fault> {
    let (table, path) = (&file.motion, |key: &str| Path::new("motion").key(key));
    let plant = match table.linearise {
        Some(Plant::CartPole) => Some(
            file.world
                .cart_pole
                .as_ref()
                .ok_or_else(|| no_cart_pole(path("linearise")))?,
        ),
        None => None,
    };
    if let Some(plant) = plant {
        for (key, is_given) in [
            ("A", table.a.is_some()),
            ("B", table.b.is_some()),
            ("drift", table.drift.is_some()),
            ("step", !table.step.is_empty()),
        ] {
            if is_given {
                return Err(Fault::of_key(
                    path(key),
                    format!("`{key}` is given, and also comes from `linearise`"),
                    format!("delete `{key}` or `linearise`"),
                ));
            }
        }
        plant.validate(&Path::new("world").key("cart-pole"))?;
        let (a, b) = plant.discretised();
        let noise = plant.motion_noise();
        let mut entries = a.iter().chain(b.iter()).chain(noise.iter());
        if !entries.all(|entry| entry.is_finite()) {
            return Err(Fault::new(
                Path::new("world").key("cart-pole"),
                "near upright, this plant moves farther in a step than numbers reach",
                "give a shorter `step`, or masses, lengths and a gravity nearer to 1",
            ));
        }
        let noise = match &table.noise {
            Some(rows) => laws::numbers(rows, path("noise"))?,
            None => noise,
        };
        let drift = DVector::zeros(a.nrows());
        return Ok(Motion { a, b, drift, noise });
    }
    let variables = file.state.names.len();
    let missing = |key: &str| {
        Fault::new(
            Path::new("motion"),
            format!("the key `{key}` is missing"),
            format!("add `{key}` to [motion]"),
        )
    };
    // Where formulas say all of the motion, the matrices have nothing to say.
    let said = file
        .state
        .names
        .iter()
        .all(|name| table.step.contains_key(name));
    let controls = file
        .actions
        .0
        .iter()
        .filter_map(|(_, table)| table.u.as_ref());
    let controls = controls.map(Vec::len).max().unwrap_or(1).max(1);
    let a = optional_matrix(&table.a, path("A"))?;
    let b = optional_matrix(&table.b, path("B"))?;
    Ok(Motion {
        a: match a {
            None if said => DMatrix::identity(variables, variables),
            a => a.ok_or_else(|| missing("A"))?,
        },
        b: b.unwrap_or_else(|| match table.step.is_empty() {
            true => DMatrix::identity(variables, variables),
            false => DMatrix::zeros(variables, controls),
        }),
        drift: table
            .drift
            .as_deref()
            .map_or_else(|| DVector::zeros(variables), DVector::from_column_slice),
        noise: match &table.noise {
            Some(rows) => laws::numbers(rows, path("noise"))?,
            None if said => DMatrix::zeros(variables, variables),
            None => return Err(missing("noise")),
        },
    })
}

fn sensor(file: &ModelFile) -> Result<Sensor, Fault> {
    let (table, path) = (&file.sensor, |key: &str| Path::new("sensor").key(key));
    let variables = file.state.names.len();
    let readings = readings(table, variables);
    let others = [
        ("H", table.h.is_some()),
        ("read", table.read.is_some()),
        ("symbols", table.symbols.is_some()),
    ];
    let mut given = others.iter().filter(|(_, given)| *given);
    if let (Some((one, _)), Some((other, _))) = (given.next(), given.next()) {
        return Err(Fault::of_key(
            path(other),
            format!("`{other}` is given, and `{one}` as well"),
            format!("delete `{one}` or `{other}`: each says all that is sensed"),
        ));
    }
    if table.symbols.is_some() {
        for (key, given) in [
            ("noise", table.noise.is_some()),
            ("saturates", table.saturates.is_some()),
        ] {
            if given {
                return Err(Fault::of_key(
                    path(key),
                    "signals have probabilities and nothing else",
                    format!("delete `{key}` or `symbols`"),
                ));
            }
        }
    }
    Ok(Sensor {
        h: match (&table.h, &table.read, &table.symbols) {
            (Some(rows), _, _) => matrix(rows, path("H"))?,
            (None, None, None) => DMatrix::identity(variables, variables),
            _ => DMatrix::zeros(readings, variables),
        },
        noise: match &table.noise {
            Some(rows) => laws::numbers(rows, path("noise"))?,
            None if table.symbols.is_some() => DMatrix::zeros(0, 0),
            None => {
                return Err(Fault::new(
                    Path::new("sensor"),
                    "the key `noise` is missing",
                    "add `noise` to [sensor]",
                ));
            }
        },
        present: 1.0,
    })
}

/// The later phases; each has from the one before what it does not state.
fn later(file: &ModelFile, motion: &Motion, sensor: &Sensor) -> Result<Vec<Phase>, Fault> {
    let (mut motion, mut sensor) = (motion.clone(), sensor.clone());
    let mut phases = Vec::with_capacity(file.later.len());
    for (i, table) in file.later.iter().enumerate() {
        let path = |table: &str, key: &str| Path::new("later").index(i).key(table).key(key);
        let given = |rows: &Option<Rows>, now: &mut DMatrix<f64>, path: Path| {
            if let Some(given) = optional_matrix(rows, path)? {
                *now = given;
            }
            Ok(())
        };
        given(&table.motion.a, &mut motion.a, path("motion", "A"))?;
        given(&table.motion.b, &mut motion.b, path("motion", "B"))?;
        given(
            &table.motion.noise,
            &mut motion.noise,
            path("motion", "noise"),
        )?;
        given(&table.sensor.h, &mut sensor.h, path("sensor", "H"))?;
        given(
            &table.sensor.noise,
            &mut sensor.noise,
            path("sensor", "noise"),
        )?;
        sensor.present = table.sensor.present.unwrap_or(sensor.present);
        phases.push(Phase {
            from: usize::try_from(table.from).unwrap_or(usize::MAX),
            motion: motion.clone(),
            sensor: sensor.clone(),
        });
    }
    Ok(phases)
}

fn no_cart_pole(path: Path) -> Fault {
    Fault::new(
        path,
        "the parameters of the cart and pole are missing",
        "add a table [world.cart-pole]",
    )
}

fn action(name: &str, table: &ActionTable, controls: usize) -> Result<Action, Fault> {
    let path = |key| Path::new("actions").key(name).key(key);
    Ok(Action {
        name: name.to_owned(),
        control: table.u.as_ref().map_or_else(
            || DVector::zeros(controls),
            |u| DVector::from_column_slice(u),
        ),
        motion_noise: optional_matrix(&table.noise, path("noise"))?,
        sensor_noise: optional_matrix(&table.sensor_noise, path("sensor_noise"))?,
        then: table.then,
    })
}

fn cost(file: &ModelFile) -> Result<Option<QuadraticCost>, Fault> {
    let Some(table) = &file.cost else {
        return Ok(None);
    };
    let path = |key| Path::new("cost").key(key);
    let state = matrix(&table.state, path("state"))?;
    let terminal =
        optional_matrix(&table.terminal, path("terminal"))?.unwrap_or_else(|| state.clone());
    Ok(Some(QuadraticCost {
        state,
        control: matrix(&table.control, path("control"))?,
        terminal,
    }))
}

fn episode(file: &ModelFile, names: &Names) -> Result<Episode, Fault> {
    let (table, default) = (&file.episode, Episode::default());
    let path = |key| Path::new("episode").key(key);
    if table.failure_reward.is_some() && table.alive.is_none() {
        return Err(Fault::of_key(
            path("failure_reward"),
            "a reward for failure, and nothing says what failure is",
            "add `alive = { x = [low, high] }`: leaving it is the failure",
        ));
    }
    Ok(Episode {
        length: table.length.map_or(default.length, saturating),
        alive: match &table.alive {
            Some(sides) => names.region(sides, &path("alive"))?,
            None => default.alive,
        },
        failure_reward: table.failure_reward.unwrap_or(default.failure_reward),
    })
}

fn belief(file: &ModelFile) -> BeliefSettings {
    let (table, default) = (&file.belief, BeliefSettings::default());
    BeliefSettings {
        level_tolerance: table.level_tolerance.unwrap_or(default.level_tolerance),
        level_limit: table.level_limit.map_or(default.level_limit, saturating),
        walls: table.walls,
        hypotheses: table.hypotheses,
        tracker: table.tracker,
        components: table.components.map(saturating),
        cells: table.cells.map(saturating),
    }
}

fn steps(table: &StepsTable, path: &Path) -> Result<Steps, Fault> {
    let steps = Steps {
        from: saturating(table.from),
        until: table.until.map_or(usize::MAX, saturating),
    };
    if steps.from >= steps.until {
        return Err(Fault::new(
            path.clone().key("steps"),
            format!(
                "no step from {} on comes before step {}",
                steps.from, steps.until
            ),
            "make `until` larger than `from`: it is the first step after them",
        ));
    }
    Ok(steps)
}

fn saturating(count: u64) -> usize {
    usize::try_from(count).unwrap_or(usize::MAX)
}

fn simulator(file: &ModelFile) -> Result<Simulator, Fault> {
    let path = Path::new("world");
    match (file.world.kind, &file.world.robot) {
        (Kind::Robot, Some(robot)) => return Ok(Simulator::Robot(robot.clone())),
        (Kind::Robot, None) => {
            return Err(Fault::new(
                path.key("kind"),
                "the parameters of the robot are missing",
                "add a table [world.robot]",
            ));
        }
        (_, Some(_)) => {
            return Err(Fault::of_key(
                path.key("robot"),
                "nothing uses these parameters",
                "add `kind = \"robot\"` to [world], or delete this table",
            ));
        }
        (_, None) => {}
    }
    match (file.world.kind, &file.world.cart_pole) {
        (Kind::CartPole, Some(parameters)) => Ok(Simulator::CartPole(parameters.clone())),
        (Kind::CartPole, None) => Err(no_cart_pole(path.key("kind"))),
        (Kind::Linear, Some(_)) if file.motion.linearise.is_none() => Err(Fault::of_key(
            path.key("cart-pole"),
            "nothing uses these parameters",
            "add `kind = \"cart-pole\"` to [world], or delete this table",
        )),
        (Kind::Linear | Kind::Robot, _) => Ok(Simulator::Linear),
    }
}
