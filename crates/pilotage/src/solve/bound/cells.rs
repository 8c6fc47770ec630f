//! A partition of an axis for functions that jump: in each cell linear, with a value of its own at either end.

use super::frame::Frame;
use super::law::Law;
use super::measure::common_measure;

/// Most cells of an axis.
const MOST: usize = 4000;
/// Places this close are one, in units of a cell.
const SAME: f64 = 1e-7;

/// Cells side by side. Cell `c` has the ends `2 c` and `2 c + 1`; one that is open has the same value everywhere.
#[derive(Debug, Clone)]
pub(super) struct Cells {
    /// Rising.
    ends: Vec<f64>,
    /// Whether there is a cell below the first end and above the last.
    open: [bool; 2],
    /// Whether what would move beyond an end stops at it.
    stops: bool,
    /// Width of most cells.
    resolution: f64,
}

impl Cells {
    /// Cells about as wide as a share `1 / count` of what matters, between which lie all borders of regions, and what noise-free
    /// actions move to them.
    ///
    /// # Errors
    /// Where noise-free actions never come back to a finite set of places.
    pub(super) fn new(frame: &Frame, axis: usize, count: usize) -> Result<Self, String> {
        if !frame.is_real(axis) {
            return Ok(Self {
                ends: vec![-0.5, 0.5],
                open: [false; 2],
                stops: false,
                resolution: 1.0,
            });
        }
        let of = &frame.axes[axis];
        let core = frame.core(axis);
        let farthest = of.displacement.iter().fold(0.0, |x: f64, d| x.max(d.abs()));
        let noise = frame.classes.iter().map(|class| class[axis].motion);
        let sd = noise.fold(0.0, f64::max).sqrt();
        let margin = (0.5 * core.width()).max(2.0 * farthest) + 4.0 * sd.min(core.width());
        let limits = [of.bounds.low, of.bounds.high];
        let walled = limits.map(|limit| frame.walled && limit.is_finite());
        let (mut low, mut high) = (core.low - margin, core.high + margin);
        for &cut in &of.cuts {
            (low, high) = (low.min(cut), high.max(cut));
        }
        if walled[0] {
            low = limits[0];
        }
        if walled[1] {
            high = limits[1];
        }
        let coarse = core.width() / count as f64;
        let width = match common_measure(&of.displacement) {
            Some(measure) if measure >= coarse => measure / (measure / coarse).ceil(),
            _ => coarse,
        };
        let mut places = vec![low, high];
        let near = SAME * width;
        let add = |places: &mut Vec<f64>, place: f64| {
            let inside = low < place && place < high;
            if inside && places.iter().all(|known| (known - place).abs() > near) {
                places.push(place);
            }
        };
        of.cuts.iter().for_each(|&cut| add(&mut places, cut));
        let still: Vec<f64> = (0..of.displacement.len())
            .filter(|&action| frame.noise(action, axis).motion == 0.0)
            .map(|action| of.displacement[action])
            .collect();
        if !still.is_empty() && of.a != 1.0 {
            return Err("a motion without noise scales its state".to_owned());
        }
        let mut next = 0;
        while next < places.len() {
            let from = places[next];
            for shift in &still {
                add(&mut places, from + shift);
                add(&mut places, from - shift);
            }
            next += 1;
            if places.len() > MOST {
                return Err("its moves without noise end at too many places".to_owned());
            }
        }
        places.sort_by(f64::total_cmp);
        let mut ends = vec![low];
        for pair in places.windows(2) {
            let length = pair[1] - pair[0];
            let beyond = pair[1] <= core.low - margin || pair[0] >= core.high + margin;
            let parts = (length / width - 1e-6).ceil().max(1.0);
            let parts = if beyond { parts.min(8.0) } else { parts };
            if ends.len() as f64 + parts > MOST as f64 {
                return Err("it reaches too far for a grid as fine as its noise".to_owned());
            }
            ends.extend((1..parts as usize).map(|k| pair[0] + length * k as f64 / parts));
            ends.push(pair[1]);
        }
        Ok(Self {
            ends,
            open: walled.map(|walled| !walled),
            stops: frame.walled,
            resolution: width,
        })
    }

    pub(super) fn count(&self) -> usize {
        self.ends.len() - 1 + usize::from(self.open[0]) + usize::from(self.open[1])
    }

    /// Width of the widest cells where it matters.
    pub(super) fn resolution(&self) -> f64 {
        self.resolution
    }

    /// Number of ends of all cells.
    pub(super) fn places(&self) -> usize {
        2 * self.count()
    }

    /// The side on which a cell is open.
    pub(super) fn open_side(&self, cell: usize) -> Option<usize> {
        match (self.open, cell) {
            ([true, _], 0) => Some(0),
            ([_, true], cell) if cell + 1 == self.count() => Some(1),
            _ => None,
        }
    }

    /// Where the open cell on a side begins.
    pub(super) fn outer_end(&self, side: usize) -> f64 {
        match side {
            0 => self.ends[0],
            _ => self.ends[self.ends.len() - 1],
        }
    }

    /// Both ends of a cell that is not open.
    pub(super) fn span(&self, cell: usize) -> (f64, f64) {
        let first = cell - usize::from(self.open[0]);
        (self.ends[first], self.ends[first + 1])
    }

    /// A coordinate inside a cell.
    pub(super) fn inside(&self, cell: usize) -> f64 {
        let away = |end: f64| end.abs().max(1.0);
        match self.open_side(cell) {
            Some(0) => self.ends[0] - away(self.ends[0]),
            Some(_) => self.outer_end(1) + away(self.outer_end(1)),
            None => {
                let (low, high) = self.span(cell);
                0.5 * (low + high)
            }
        }
    }

    /// Weights of all ends of cells in the expectation of a function that is linear in every cell. What would be beyond a wall stops
    /// at it, or is left out.
    pub(super) fn weights(&self, law: &Law, with_stopped: bool) -> Vec<f64> {
        let mut weights = vec![0.0; self.places()];
        let first = usize::from(self.open[0]);
        let ends: Vec<(f64, f64)> = self
            .ends
            .iter()
            .map(|&end| (law.below(end), law.beyond(end)))
            .collect();
        for (k, pair) in ends.windows(2).enumerate() {
            let length = self.ends[k + 1] - self.ends[k];
            let mass = (pair[1].0 - pair[0].0).max(0.0);
            let rise = (pair[0].1 - pair[1].1) / length - (1.0 - pair[1].0);
            let upper = rise.clamp(0.0, mass);
            weights[2 * (first + k)] += mass - upper;
            weights[2 * (first + k) + 1] += upper;
        }
        let outer = [ends[0].0, 1.0 - ends[ends.len() - 1].0];
        let last = self.places() - 1;
        for (side, mass) in outer.into_iter().enumerate() {
            if self.open[side] || self.stops && with_stopped {
                weights[side * last] += mass;
            }
        }
        weights
    }

    /// Where a noise-free move takes the end of a cell that is not open: an end of a cell.
    ///
    /// # Errors
    /// Where it would take the cell apart.
    pub(super) fn shifted(&self, cell: usize, side: usize, shift: f64) -> Result<usize, String> {
        let (low, high) = self.span(cell);
        let middle = 0.5 * (low + high) + shift;
        for end in 0..2 {
            let beyond = match end {
                0 => middle < self.ends[0],
                _ => middle > self.outer_end(1),
            };
            if beyond {
                return Ok(end * (self.places() - 1));
            }
        }
        let index = self.ends.partition_point(|&end| end <= middle).max(1) - 1;
        let target = index.min(self.ends.len() - 2);
        let near = 1e-4 * (high - low);
        let moved = |end: f64, to: f64| (end + shift - to).abs() <= near;
        match moved(low, self.ends[target]) && moved(high, self.ends[target + 1]) {
            true => Ok(2 * (target + usize::from(self.open[0])) + side),
            false => Err("a move without noise does not fit the grid".to_owned()),
        }
    }

    /// The ends of the wall or of the domain, where they stop the state.
    pub(super) fn stops(&self) -> [Option<f64>; 2] {
        let at = |side: usize| (self.stops && !self.open[side]).then(|| self.outer_end(side));
        [at(0), at(1)]
    }
}
