//! Functions on the grid: a row for each point of the first axis, in it the points of the second.

use crate::parallel;

/// Where an action leads from the points of an axis: the point below, and how far on to the next.
pub(super) struct Targets {
    pub places: Vec<(usize, f64)>,
    pub aligned: bool,
}

/// `(row, column)` taken along its targets, by linear interpolation.
pub(super) fn interpolate(
    values: &[f64],
    columns: usize,
    targets: &[Targets; 2],
    row: usize,
    column: usize,
) -> f64 {
    let ((x, u), (y, v)) = (targets[0].places[row], targets[1].places[column]);
    let line = |x: usize| {
        let at = values[x * columns + y];
        match v == 0.0 {
            true => at,
            false => at + v * (values[x * columns + y + 1] - at),
        }
    };
    let at = line(x);
    match u == 0.0 {
        true => at,
        false => at + u * (line(x + 1) - at),
    }
}

pub(super) fn product(values: &[f64], weights: &[Vec<f64>; 2]) -> f64 {
    let rows = values.chunks_exact(weights[1].len()).zip(&weights[0]);
    rows.filter(|(_, weight)| **weight > 0.0)
        .map(|(row, weight)| weight * row.iter().zip(&weights[1]).map(|(v, w)| v * w).sum::<f64>())
        .sum()
}

/// The side to which everything beyond a side is taken by a motion that scales by `a`.
pub(in crate::solve::bound) fn towards(a: f64, side: usize) -> usize {
    match a < 0.0 {
        true => 1 - side,
        false => side,
    }
}

/// The most from each point outwards.
pub(super) fn most_outwards(mut line: Vec<f64>, side: usize) -> Vec<f64> {
    let count = line.len();
    for k in 1..count {
        // The low side looks at what comes before, the high side at what comes after.
        let (at, inner) = match side {
            0 => (k, k - 1),
            _ => (count - 1 - k, count - k),
        };
        line[at] = line[at].max(line[inner]);
    }
    line
}

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

pub(super) fn raise(values: &mut [f64], to: &[f64], and: f64) {
    let pairs = values.iter_mut().zip(to);
    pairs.for_each(|(value, to)| *value = value.max(to + and));
}

pub(super) fn raise_edge(
    values: &mut [f64],
    sizes: [usize; 2],
    axis: usize,
    side: usize,
    to: &[f64],
) {
    let [rows, columns] = sizes;
    let edge = side * (sizes[axis] - 1);
    match axis {
        0 => raise(&mut values[edge * columns..(edge + 1) * columns], to, 0.0),
        _ => (0..rows).for_each(|row| {
            let value = &mut values[row * columns + edge];
            *value = value.max(to[row]);
        }),
    }
}

/// Averages along the first axis, constant beyond its ends.
pub(super) fn average_rows(
    values: &[f64],
    [rows, columns]: [usize; 2],
    kernel: &[f64],
) -> Vec<f64> {
    if kernel.is_empty() {
        return values.to_vec();
    }
    let half = kernel.len() as isize / 2;
    let lines = parallel::map(rows, |row| {
        let mut line = vec![0.0; columns];
        for (tap, weight) in kernel.iter().enumerate() {
            let from = (row as isize + tap as isize - half).clamp(0, rows as isize - 1) as usize;
            let source = &values[from * columns..(from + 1) * columns];
            line.iter_mut()
                .zip(source)
                .for_each(|(sum, value)| *sum += weight * value);
        }
        line
    });
    lines.concat()
}

/// Averages along the second axis, constant beyond its ends.
pub(super) fn average_columns(
    values: &[f64],
    [rows, columns]: [usize; 2],
    kernel: &[f64],
) -> Vec<f64> {
    if kernel.is_empty() {
        return values.to_vec();
    }
    let half = kernel.len() / 2;
    let lines = parallel::map(rows, |row| {
        let source = &values[row * columns..(row + 1) * columns];
        let mut padded = vec![source[0]; half];
        padded.extend_from_slice(source);
        padded.extend(std::iter::repeat_n(source[columns - 1], half));
        let mut line = vec![0.0; columns];
        for (tap, weight) in kernel.iter().enumerate() {
            line.iter_mut()
                .zip(&padded[tap..])
                .for_each(|(sum, value)| *sum += weight * value);
        }
        line
    });
    lines.concat()
}
