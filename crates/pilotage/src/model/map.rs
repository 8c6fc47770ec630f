//! Grid maps drawn as text: blocked cells, thin walls between cells, marked cells, and motion that they stop.

mod drawing;

use super::barriers::Stop;
use super::{Interval, Region};
pub(crate) use drawing::draw;

/// Walls and marked cells of a two-dimensional map, `x` to the east, `y` to the north.
///
/// The corner of the bottom left cell is the origin. A cell owns its west and south edges, so that every point
/// inside [`Map::extent`] is in exactly one cell.
///
/// # The drawing
///
/// One character a cell, or corners and thin walls; both of these have a goal `*` and a station `a`:
///
/// ```text
/// ..a      +--+--+--+        # blocked
/// .#.      |     | a|        . free
/// ..*      +  +--+  +        a letter, a digit or *: free, with that mark
///          |  |##   |        + - |  corners and walls of the second form, blank where there is none
///          +  +  +  +
///          |       *|
///          +--+--+--+
/// ```
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Map {
    /// The drawing, top row first, as written in the model file.
    pub rows: Vec<String>,
    /// Side of a cell, in units of state.
    pub cell: f64,
    /// Cells no state can be in.
    pub blocked: Vec<Region>,
    /// Thin walls between cells: from one end point to the other, axis-aligned.
    pub walls: Vec<[[f64; 2]; 2]>,
    /// Named cells, such as goals and stations. Several cells may bear one mark.
    pub marks: Vec<(char, Region)>,
    grid: Grid,
}

/// What stops motion, cell by cell.
#[derive(Debug, Clone, PartialEq, Default)]
struct Grid {
    columns: i64,
    rows: i64,
    /// Row by row from the south.
    cells: Vec<Cell>,
}

#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Cell {
    blocked: bool,
    wall_east: bool,
    wall_north: bool,
}

/// Column and row of a cell, counted from the south-west; outside the map they are negative or too large.
type CellIndex = [i64; 2];

impl Grid {
    fn at(&self, [column, row]: CellIndex) -> Option<Cell> {
        let inside = (0..self.columns).contains(&column) && (0..self.rows).contains(&row);
        inside.then(|| self.cells[(row * self.columns + column) as usize])
    }

    /// Whether one can stand in the cell.
    fn open(&self, index: CellIndex) -> bool {
        self.at(index).is_some_and(|cell| !cell.blocked)
    }

    /// Whether one can go from an open cell to its neighbour along the axis (0 east, 1 north).
    fn passable(&self, from: CellIndex, to: CellIndex, axis: usize) -> bool {
        let lower = if from[axis] < to[axis] { from } else { to };
        let wall = self
            .at(lower)
            .is_some_and(|cell| [cell.wall_east, cell.wall_north][axis]);
        self.open(to) && !wall
    }
}

impl Map {
    /// West to east and south to north limits of the map.
    pub fn extent(&self) -> [Interval; 2] {
        [self.grid.columns, self.grid.rows]
            .map(|cells| Interval::new(0.0, cells as f64 * self.cell))
    }

    /// Whether a state can be at the point: inside the map and not in a blocked cell.
    pub fn free(&self, point: [f64; 2]) -> bool {
        self.grid.open(self.cell_of(point))
    }

    /// Everywhere no state can be: the blocked cells, and all that lies beyond the edges of the map. The boxes do not overlap.
    pub fn solid(&self) -> Vec<Region> {
        let [east, north] = self.extent();
        let beyond = |side: Interval| {
            [
                Interval::new(f64::NEG_INFINITY, side.low),
                Interval::new(side.high, f64::INFINITY),
            ]
        };
        let mut solid = self.blocked.clone();
        solid.extend(beyond(east).map(|x| Region::new(vec![(0, x)])));
        solid.extend(beyond(north).map(|y| Region::new(vec![(0, east), (1, y)])));
        solid
    }

    /// The nearest point where a state can be; `point` itself where every cell is blocked. Ties go to the south, then the west.
    pub(crate) fn nearest_free(&self, point: [f64; 2]) -> [f64; 2] {
        if self.free(point) {
            return point;
        }
        let mut best = (point, f64::INFINITY);
        for row in 0..self.grid.rows {
            for column in 0..self.grid.columns {
                if !self.grid.open([column, row]) {
                    continue;
                }
                let near = [
                    self.side(column).clamp(point[0]),
                    self.side(row).clamp(point[1]),
                ];
                let apart = (near[0] - point[0]).powi(2) + (near[1] - point[1]).powi(2);
                if apart < best.1 {
                    best = (near, apart);
                }
            }
        }
        best.0
    }

    /// Moves from one point straight towards another, and stops at the first blocked cell, thin wall or edge of the map.
    ///
    /// A `from` outside the map is first moved to the nearest point inside; from a blocked cell there is no way out.
    /// Where the way passes exactly through a corner, it goes through the cell to the east or west of it.
    pub fn travel(&self, from: [f64; 2], to: [f64; 2]) -> [f64; 2] {
        let extent = self.extent();
        let from = [extent[0].clamp(from[0]), extent[1].clamp(from[1])];
        let delta = [to[0] - from[0], to[1] - from[1]];
        let mut cell = self.cell_of(from);
        if !self.grid.open(cell) || delta.iter().any(|d| d.is_nan()) {
            return from;
        }
        let target = self.cell_of(to);
        while cell != target {
            let share = [0, 1]
                .map(|axis| self.share_to_edge(from[axis], delta[axis], cell[axis], target[axis]));
            let axis = if share[0] <= share[1] { 0 } else { 1 };
            let mut next = cell;
            next[axis] += (target[axis] - cell[axis]).signum();
            if !self.grid.passable(cell, next, axis) {
                return self.stopped_at_edge(from, delta, share[axis], cell, next, axis);
            }
            cell = next;
        }
        to
    }

    /// Where the way along an axis is stopped, each place once for either direction.
    pub(crate) fn stops(&self, axis: usize) -> Vec<Stop> {
        let count = [self.grid.columns, self.grid.rows];
        let stopped = |edge: i64, upwards: bool| {
            let mut across = 0..count[1 - axis];
            across.any(|other| {
                let cell = |along: i64| match axis {
                    0 => [along, other],
                    _ => [other, along],
                };
                let (from, to) = match upwards {
                    true => (cell(edge - 1), cell(edge)),
                    false => (cell(edge), cell(edge - 1)),
                };
                self.grid.open(from) && !self.grid.passable(from, to, axis)
            })
        };
        let edges = (0..=count[axis]).flat_map(|edge| [(edge, false), (edge, true)]);
        let stops = edges.filter(|(edge, upwards)| stopped(*edge, *upwards));
        let stop = |(edge, upwards)| Stop {
            place: self.edge(edge),
            upwards,
        };
        stops.map(stop).collect()
    }

    /// Share of the way at which it leaves the cell along one axis; infinite if it does not.
    fn share_to_edge(&self, from: f64, delta: f64, cell: i64, target: i64) -> f64 {
        match target.cmp(&cell) {
            std::cmp::Ordering::Equal => f64::INFINITY,
            std::cmp::Ordering::Greater => (self.edge(cell + 1) - from) / delta,
            std::cmp::Ordering::Less => (self.edge(cell) - from) / delta,
        }
    }

    /// The last point of the cell before the way would go into `next`.
    fn stopped_at_edge(
        &self,
        from: [f64; 2],
        delta: [f64; 2],
        share: f64,
        cell: CellIndex,
        next: CellIndex,
        axis: usize,
    ) -> [f64; 2] {
        let sides = cell.map(|index| self.side(index));
        let other = 1 - axis;
        let mut point = from;
        point[axis] = if next[axis] > cell[axis] {
            sides[axis].clamp(f64::INFINITY)
        } else {
            sides[axis].low
        };
        point[other] = sides[other].clamp(from[other] + share.clamp(0.0, 1.0) * delta[other]);
        point
    }

    fn cell_of(&self, point: [f64; 2]) -> CellIndex {
        [
            self.index_of(point[0], self.grid.columns),
            self.index_of(point[1], self.grid.rows),
        ]
    }

    /// The largest index whose edge is not beyond `x`, one cell further than the map at most.
    fn index_of(&self, x: f64, count: i64) -> i64 {
        let mut index = ((x / self.cell).floor() as i64).clamp(-1, count);
        while index < count && self.edge(index + 1) <= x {
            index += 1;
        }
        while index >= 0 && x < self.edge(index) {
            index -= 1;
        }
        index
    }

    fn side(&self, index: i64) -> Interval {
        Interval::new(self.edge(index), self.edge(index + 1))
    }

    fn edge(&self, index: i64) -> f64 {
        index as f64 * self.cell
    }
}
