//! Checks of single numbers, vectors and matrices.

use nalgebra::{DMatrix, DVector};

use crate::model::error::{Fault, Path};

/// Entries and eigenvalues may be off by this share of the largest entry, which rounding in files needs.
const ROUNDING: f64 = 1e-9;

pub(super) fn finite(value: f64, path: Path) -> Result<(), Fault> {
    if value.is_finite() {
        return Ok(());
    }
    let what = if value.is_nan() {
        "not a number"
    } else {
        "infinite"
    };
    Err(Fault::new(
        path,
        format!("this is {what}"),
        "give a finite number",
    ))
}

/// Checks that a number is finite and above 0, or not below it if `zero` is allowed.
pub(crate) fn positive(value: f64, zero: bool, path: Path) -> Result<(), Fault> {
    finite(value, path.clone())?;
    if value > 0.0 || (zero && value == 0.0) {
        return Ok(());
    }
    let hint = if zero {
        "give 0 or more"
    } else {
        "give more than 0"
    };
    Err(Fault::new(path, format!("this is {value}"), hint))
}

pub(super) fn finite_matrix(matrix: &DMatrix<f64>, path: Path) -> Result<(), Fault> {
    for (row, column) in indices(matrix) {
        finite(matrix[(row, column)], path.clone().index(row).index(column))?;
    }
    Ok(())
}

pub(super) fn vector(
    vector: &DVector<f64>,
    length: usize,
    because: &str,
    path: Path,
) -> Result<(), Fault> {
    if vector.len() != length {
        return Err(Fault::new(
            path,
            format!("{} numbers where {length} belong", vector.len()),
            because,
        ));
    }
    vector
        .iter()
        .enumerate()
        .try_for_each(|(i, &value)| finite(value, path.clone().index(i)))
}

/// Checks that a matrix has as many rows and columns as `expected`.
pub(super) fn shape(
    matrix: &DMatrix<f64>,
    expected: (usize, usize),
    because: &str,
    path: Path,
) -> Result<(), Fault> {
    if matrix.shape() == expected {
        return Ok(());
    }
    let ((rows, columns), (expected_rows, expected_columns)) = (matrix.shape(), expected);
    Err(Fault::new(
        path,
        format!("a {rows} x {columns} matrix where {expected_rows} x {expected_columns} belongs"),
        because,
    ))
}

/// Checks that a matrix is a covariance: `n x n`, finite, symmetric and positive semi-definite.
pub(super) fn covariance(
    matrix: &DMatrix<f64>,
    n: usize,
    because: &str,
    path: Path,
) -> Result<(), Fault> {
    shape(matrix, (n, n), because, path.clone())?;
    finite_matrix(matrix, path.clone())?;
    let scale = matrix.amax();
    if scale == 0.0 {
        return Ok(());
    }
    for (row, column) in indices(matrix).filter(|(row, column)| row < column) {
        let (above, below) = (matrix[(row, column)], matrix[(column, row)]);
        if (above / scale - below / scale).abs() > ROUNDING {
            return Err(Fault::new(
                path.index(row).index(column),
                format!(
                    "not symmetric: row {}, column {} is {above} and row {}, column {} is {below}",
                    row + 1,
                    column + 1,
                    column + 1,
                    row + 1
                ),
                "make both the same",
            ));
        }
    }
    let smallest = (matrix / scale).symmetric_eigenvalues().min();
    if smallest < -ROUNDING {
        return Err(Fault::new(
            path,
            format!(
                "not positive semi-definite: an eigenvalue is {}",
                rounded(smallest * scale)
            ),
            "a covariance is M M' for some M; variances are not negative, correlations at most 1",
        ));
    }
    Ok(())
}

/// The number with six significant digits.
fn rounded(value: f64) -> f64 {
    format!("{value:.5e}").parse().unwrap_or(value)
}

fn indices(matrix: &DMatrix<f64>) -> impl Iterator<Item = (usize, usize)> {
    let (rows, columns) = matrix.shape();
    (0..rows).flat_map(move |row| (0..columns).map(move |column| (row, column)))
}
