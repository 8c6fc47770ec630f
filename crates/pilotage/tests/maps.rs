//! Grid maps: what a drawing means, and that motion stops at walls.
#![allow(clippy::unwrap_used)]

use pilotage::model::{self, Map, Model};
use pilotage::scenario;
use proptest::prelude::*;

fn read(drawing: &str, cell: f64) -> Result<Model, model::ModelError> {
    let text = scenario::builtin("maze-2d").unwrap();
    let text = text.replace("cell = 1.0", &format!("cell = {cell:?}"));
    let text = text
        .replace("....\n....\n....\n...*\n", drawing)
        .replace("mean = [0.0, 4.0]", "mean = [0.0, 0.0]");
    scenario::read(&text, "map.toml").map(|scenario| scenario.model)
}

fn map(drawing: &str, cell: f64) -> Map {
    read(drawing, cell)
        .unwrap_or_else(|error| panic!("{error}\n{drawing}"))
        .map
        .unwrap()
}

const COMPACT: &str = "..a\n.#.\n..*\n";
const WALLED: &str =
    "+--+--+--+\n|     | a|\n+  +--+  +\n|  |##   |\n+  +  +  +\n|       *|\n+--+--+--+\n";

#[test]
fn both_forms_of_the_documentation_mark_and_block_the_same_cells() {
    let (compact, walled) = (map(COMPACT, 1.0), map(WALLED, 1.0));
    assert_eq!(
        (&compact.marks, &compact.blocked),
        (&walled.marks, &walled.blocked)
    );
    assert_eq!(
        walled
            .marks
            .iter()
            .map(|(mark, _)| *mark)
            .collect::<String>(),
        "*a"
    );
    assert!(walled.marks[0].1.contains(&[2.5, 0.5]) && walled.marks[1].1.contains(&[2.0, 2.0]));
    assert_eq!(
        walled.walls,
        [
            [[1.0, 1.0], [1.0, 2.0]],
            [[1.0, 2.0], [2.0, 2.0]],
            [[2.0, 2.0], [2.0, 3.0]]
        ]
    );
    assert!(compact.walls.is_empty());
}

#[test]
fn a_mark_on_several_cells_pays_in_each() {
    let model = read("*.*\n...\n.*.\n", 1.0).unwrap();
    assert_eq!(model.rewards.len(), 3);
    assert!(model.rewards.iter().all(|reward| reward.value == 1.0));
}

#[test]
fn motion_stops_at_the_first_thing_in_its_way() {
    let map = map(WALLED, 1.0);
    let stops = |from, to, expected: [f64; 2]| {
        let end = map.travel(from, to);
        assert!(
            (0..2).all(|i| (end[i] - expected[i]).abs() < 1e-12),
            "{from:?} to {to:?}: {end:?}"
        );
    };
    stops([0.5, 0.5], [2.5, 0.5], [2.5, 0.5]); // free
    stops([0.5, 0.5], [9.0, 0.5], [3.0, 0.5]); // east edge
    stops([0.5, 0.5], [-9.0, 0.25], [0.0, 0.5 - 0.25 * 0.5 / 9.5]); // west edge
    stops([0.5, 1.5], [2.5, 1.5], [1.0, 1.5]); // thin wall
    stops([2.5, 1.5], [0.5, 1.5], [2.0, 1.5]); // blocked cell, from the east
    stops([1.5, 0.5], [1.5, 2.5], [1.5, 1.0]); // blocked cell, from the south
    stops([1.5, 2.5], [2.5, 2.5], [2.0, 2.5]); // thin wall, from the west
    stops([2.5, 2.5], [1.5, 2.5], [2.0, 2.5]); // thin wall, from the east
    stops([2.5, 2.5], [2.5, f64::INFINITY], [2.5, 3.0]);
    stops([2.5, 2.5], [f64::NAN, 0.0], [2.5, 2.5]);
}

fn random_map() -> impl Strategy<Value = String> {
    (2usize..6, 2usize..6, 1usize..4).prop_flat_map(|(columns, rows, inside)| {
        let bits = proptest::collection::vec(any::<u8>(), columns * rows);
        bits.prop_map(move |bits| draw(columns, rows, inside, &bits))
    })
}

/// A walled drawing with a goal, a free bottom left cell, and walls and blocks where the bits of each cell say so.
fn draw(columns: usize, rows: usize, inside: usize, bits: &[u8]) -> String {
    let mut text = String::new();
    for row in 0..rows {
        let line = &bits[row * columns..(row + 1) * columns];
        for cell in line {
            let wall = row == 0 || cell & 3 == 0;
            text += &format!("+{}", if wall { "-" } else { " " }.repeat(inside));
        }
        text += "+\n|";
        for (column, cell) in line.iter().enumerate() {
            let start = (row, column) == (rows - 1, 0);
            let goal = (row, column) == (0, columns - 1);
            let filling = if goal {
                '*'
            } else if cell & 48 == 48 && !start {
                '#'
            } else {
                ' '
            };
            text += &format!("{filling:<inside$}");
            text.push(if column + 1 == columns || cell & 12 == 0 {
                '|'
            } else {
                ' '
            });
        }
        text.push('\n');
    }
    text + &format!("+{}", "-".repeat(inside)).repeat(columns) + "+\n"
}

/// Whether the way from one point to the other passes through a thin wall; touching its line does not count.
fn crosses(wall: &[[f64; 2]; 2], from: [f64; 2], to: [f64; 2]) -> bool {
    let axis = usize::from(wall[0][0] != wall[1][0]);
    let (at, other) = (wall[0][axis], 1 - axis);
    let (below, above) = (from[axis].min(to[axis]), from[axis].max(to[axis]));
    if !(below < at && at < above) {
        return false;
    }
    let share = (at - from[axis]) / (to[axis] - from[axis]);
    let met = from[other] + share * (to[other] - from[other]);
    let margin = 1e-9;
    wall[0][other] + margin < met && met < wall[1][other] - margin
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn travel_ends_in_free_cells_and_crosses_no_wall(
        drawing in random_map(),
        cell in prop_oneof![Just(1.0), Just(0.25), Just(0.1), 0.01f64..20.0],
        points in proptest::collection::vec((-0.2f64..1.2, -0.2f64..1.2), 2..12),
    ) {
        let map = map(&drawing, cell);
        let [east, north] = map.extent();
        let mut at = [0.5 * cell, 0.5 * cell];
        for (x, y) in points {
            let to = [x * east.high, y * north.high];
            let end = map.travel(at, to);
            prop_assert!(map.free(end), "{at:?} to {to:?} ends at {end:?}\n{drawing}");
            prop_assert!(!map.blocked.iter().any(|block| block.contains(&end)), "{end:?} is blocked");
            for wall in &map.walls {
                prop_assert!(!crosses(wall, at, end), "{at:?} to {end:?} crosses {wall:?}\n{drawing}");
            }
            for share in (0..=1000).map(|i| f64::from(i) / 1000.0) {
                let between = [0, 1].map(|i| at[i] + share * (end[i] - at[i]));
                let depth = |block: &model::Region| block.sides.iter()
                    .map(|&(i, side)| (between[i] - side.low).min(side.high - between[i]))
                    .fold(f64::INFINITY, f64::min);
                prop_assert!(map.blocked.iter().all(|block| depth(block) < 1e-9 * cell), "{at:?} to {end:?}\n{drawing}");
            }
            let way = |point: [f64; 2]| (to[0] - point[0]).hypot(to[1] - point[1]);
            prop_assert!(way(end) <= way(at) * (1.0 + 1e-9), "{at:?} to {to:?} ends farther off, at {end:?}");
            at = end;
        }
    }

    #[test]
    fn an_open_map_lets_everything_pass(
        from in (0.0f64..4.0, 0.0f64..4.0),
        to in (0.0f64..4.0, 0.0f64..4.0),
    ) {
        let map = map("....\n....\n....\n...*\n", 1.0);
        prop_assert_eq!(map.travel(from.into(), to.into()), <[f64; 2]>::from(to));
    }
}
