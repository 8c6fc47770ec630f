//! From a drawing to a [`Map`].

use super::super::error::{Fault, Path};
use super::super::{Interval, Region};
use super::{Cell, Grid, Map};

const CHARACTERS: &str = "`#` is blocked, `.` free, a letter, digit or `*` a mark";
const WALLED: &str = "draw `+` at every corner, `-` and `|` for walls, blanks where there is none";

/// Reads a drawing with cells of side `cell`; a fault points to its row and column.
pub(crate) fn draw(text: &str, cell: f64) -> Result<Map, Fault> {
    if !(cell.is_finite() && cell > 0.0) {
        return Err(Fault::new(
            Path::new("map").key("cell"),
            format!("the side of a cell is {cell}"),
            "give a finite number above 0",
        ));
    }
    let rows: Vec<Vec<char>> = text.lines().map(|line| line.chars().collect()).collect();
    let Some(width) = rows.first().map(Vec::len).filter(|&width| width > 0) else {
        return Err(Fault::new(drawing(), "the drawing is empty", CHARACTERS));
    };
    if let Some(row) = rows.iter().position(|row| row.len() != width) {
        return Err(Fault::new(
            drawing().index(row).index(0),
            format!(
                "row {} has {} characters and the first row has {width}",
                row + 1,
                rows[row].len()
            ),
            "make all rows equally long; blanks at the end of a row count",
        ));
    }
    let cells = if rows[0][0] == '+' {
        with_thin_walls(&rows)?
    } else {
        one_character_a_cell(&rows)?
    };
    Ok(build(
        text.lines().map(str::to_owned).collect(),
        cell,
        &cells,
    ))
}

fn drawing() -> Path {
    Path::new("map").key("rows")
}

fn fault(row: usize, column: usize, message: String, hint: &str) -> Fault {
    Fault::new(drawing().index(row).index(column), message, hint)
}

/// A cell as drawn: what stops motion, and its mark.
type Drawn = (Cell, Option<char>);

fn one_character_a_cell(rows: &[Vec<char>]) -> Result<Vec<Vec<Drawn>>, Fault> {
    let cell = |(row, column): (usize, usize), character: char| match character {
        '.' => Ok((Cell::default(), None)),
        '#' => Ok((
            Cell {
                blocked: true,
                ..Cell::default()
            },
            None,
        )),
        mark if is_mark(mark) => Ok((Cell::default(), Some(mark))),
        other => Err(fault(
            row,
            column,
            format!("unknown character `{other}` in the map"),
            CHARACTERS,
        )),
    };
    rows.iter()
        .enumerate()
        .map(|(r, row)| {
            row.iter()
                .enumerate()
                .map(|(c, &character)| cell((r, c), character))
                .collect()
        })
        .collect()
}

fn is_mark(character: char) -> bool {
    character.is_ascii_alphanumeric() || character == '*'
}

fn with_thin_walls(rows: &[Vec<char>]) -> Result<Vec<Vec<Drawn>>, Fault> {
    let pitch = rows[0]
        .iter()
        .skip(1)
        .position(|&c| c == '+')
        .map_or(0, |blanks| blanks + 1);
    let width = rows[0].len();
    if pitch < 2 || !(width - 1).is_multiple_of(pitch) {
        return Err(fault(
            0,
            0,
            "the corners of the first row are not evenly spaced".to_owned(),
            WALLED,
        ));
    }
    if rows.len() < 3 || rows.len().is_multiple_of(2) {
        return Err(fault(
            rows.len() - 1,
            0,
            format!(
                "a map with thin walls has an odd number of rows, at least 3, and this one has {}",
                rows.len()
            ),
            WALLED,
        ));
    }
    let columns = (width - 1) / pitch;
    let walls: Vec<Vec<bool>> = (0..rows.len())
        .step_by(2)
        .map(|r| edge_row(rows, r, pitch, columns))
        .collect::<Result<_, _>>()?;
    (1..rows.len())
        .step_by(2)
        .map(|r| cell_row(rows, r, pitch, columns, &walls[r / 2]))
        .collect()
}

/// Whether there is a wall below each cell of the row above, for a row of corners and horizontal walls.
fn edge_row(
    rows: &[Vec<char>],
    r: usize,
    pitch: usize,
    columns: usize,
) -> Result<Vec<bool>, Fault> {
    let row = &rows[r];
    let outer = r == 0 || r + 1 == rows.len();
    let expect = |column: usize, fits: bool, what: &str| {
        if fits {
            Ok(())
        } else {
            Err(fault(
                r,
                column,
                format!("`{}` where {what} belongs", row[column]),
                WALLED,
            ))
        }
    };
    expect(columns * pitch, row[columns * pitch] == '+', "a corner `+`")?;
    (0..columns)
        .map(|column| {
            let start = column * pitch;
            expect(start, row[start] == '+', "a corner `+`")?;
            let wall = row[start + 1] == '-';
            let side = if wall { '-' } else { ' ' };
            for (offset, &drawn) in row[start..start + pitch].iter().enumerate().skip(1) {
                expect(start + offset, drawn == side, "a whole wall `-`, or none,")?;
            }
            expect(start + 1, wall || !outer, "the outer wall `-`")?;
            Ok(wall)
        })
        .collect()
}

fn cell_row(
    rows: &[Vec<char>],
    r: usize,
    pitch: usize,
    columns: usize,
    wall_north: &[bool],
) -> Result<Vec<Drawn>, Fault> {
    let row = &rows[r];
    let side = |column: usize| {
        let c = column * pitch;
        let outer = column == 0 || column == columns;
        match row[c] {
            '|' => Ok(true),
            ' ' if !outer => Ok(false),
            other => Err(fault(
                r,
                c,
                format!("`{other}` where a wall `|` or a blank belongs"),
                WALLED,
            )),
        }
    };
    side(0)?;
    (0..columns)
        .map(|column| {
            let start = column * pitch + 1;
            let inside = start..start + pitch - 1;
            let wall_east = side(column + 1)?;
            let drawn: Vec<usize> = inside.filter(|&c| row[c] != ' ').collect();
            let blocked = drawn.iter().any(|&c| row[c] == '#');
            for (i, &c) in drawn.iter().enumerate() {
                let fits = if blocked {
                    row[c] == '#'
                } else {
                    i == 0 && is_mark(row[c])
                };
                if !fits {
                    let message = format!("unexpected `{}` inside a cell", row[c]);
                    return Err(fault(
                        r,
                        c,
                        message,
                        "a cell is blank, or holds one mark (a letter, digit or `*`), or `#`",
                    ));
                }
            }
            let mark = drawn.first().map(|&c| row[c]).filter(|_| !blocked);
            Ok((
                Cell {
                    blocked,
                    wall_east,
                    wall_north: wall_north[column],
                },
                mark,
            ))
        })
        .collect()
}

fn build(rows: Vec<String>, cell: f64, drawn: &[Vec<Drawn>]) -> Map {
    let (height, width) = (drawn.len(), drawn[0].len());
    let mut map = Map {
        rows,
        cell,
        ..Map::default()
    };
    map.grid = Grid {
        columns: width as i64,
        rows: height as i64,
        cells: Vec::with_capacity(width * height),
    };
    for (row, line) in drawn.iter().rev().enumerate() {
        for (column, &(kind, mark)) in line.iter().enumerate() {
            let [west, east] = [column, column + 1].map(|index| map.edge(index as i64));
            let [south, north] = [row, row + 1].map(|index| map.edge(index as i64));
            let region = Region::new(vec![
                (0, Interval::new(west, east)),
                (1, Interval::new(south, north)),
            ]);
            if kind.blocked {
                map.blocked.push(region.clone());
            }
            if kind.wall_east && column + 1 < width {
                map.walls.push([[east, south], [east, north]]);
            }
            if kind.wall_north && row + 1 < height {
                map.walls.push([[west, north], [east, north]]);
            }
            map.marks.extend(mark.map(|mark| (mark, region)));
            map.grid.cells.push(kind);
        }
    }
    map
}
