//! Every mistake in a model file has a message with a place and a hint. Each row of the table edits a good file once.
#![allow(clippy::unwrap_used)]

use pilotage::model::ModelError;
use pilotage::scenario;

/// One mistake: in the built-in model `base`, `good` is replaced by `bad`. The error is placed at the first occurrence of
/// `at` in the edited text.
struct Mistake {
    base: &'static str,
    good: &'static str,
    bad: &'static str,
    at: &'static str,
    message: &'static str,
    hint: &'static str,
}

const fn row(
    base: &'static str,
    good: &'static str,
    bad: &'static str,
    at: &'static str,
    message: &'static str,
    hint: &'static str,
) -> Mistake {
    Mistake {
        base,
        good,
        bad,
        at,
        message,
        hint,
    }
}

const START: &str = "mean = [0.0]";
const GOAL: &str = "in = { x = [3.0, 4.0] }";
const EAST: &str = "EAST = { u = [1.0] }";

#[rustfmt::skip]
const MISTAKES: &[Mistake] = &[
    // Not TOML, or not this format.
    row("corridor-blind", "discount = 0.75", "discount 0.75", "0.75", "expected", "TOML"),
    row("corridor-blind", "name = \"corridor-blind\"", "name = \"corridor-blind", "\nabout", "invalid", "TOML"),
    row("corridor-blind", "format = 1", "format = 2", "2", "format 2", "reads format 1"),
    row("corridor-blind", "format = 1", "", "#:schema", "`format` is missing", "add `format`"),
    row("corridor-blind", "format = 1", "format = \"1\"", "\"1\"", "string \"1\"", "whole number"),
    row("corridor-blind", "discount = 0.75", "", "#:schema", "`discount` is missing", "add `discount`"),
    row("corridor-blind", "discount = 0.75", "discount = \"high\"", "\"high\"", "unexpected string", "write a number"),
    row("corridor-blind", "discount = 0.75", "discount = 0.75\ndiscount = 0.8", "discount = 0.8", "twice", "rename or delete"),
    // Unknown keys, with the nearest known one.
    row("corridor-blind", "discount =", "discont =", "discont", "unknown key `discont`", "`discount`"),
    row("corridor-blind", "covariance = ", "variance = ", "variance", "unknown key `variance`", "`covariance`"),
    row("corridor-blind", "names = ", "name = ", "name = [", "unknown key `name`", "`names`"),
    row("corridor-blind", EAST, "EAST = { v = [1.0] }", "v = [1.0] }", "unknown key `v`", "`u`"),
    row("corridor-blind", "value = 1.0", "value = 1.0\ncolour = \"red\"", "colour", "unknown key `colour`", "known here: `action`"),
    row("corridor-blind", "walls = \"clamp\"", "walls = \"clamps\"", "\"clamps\"", "unknown value `clamps`", "`clamp`"),
    row("corridor-blind", "length = 60", "lenght = 60", "lenght", "unknown key `lenght`", "`length`"),
    row("cart-pole", "cart_mass", "cart_masss", "cart_masss", "unknown key `cart_masss`", "`cart_mass`"),
    // Numbers.
    row("corridor-blind", "discount = 0.75", "discount = 1.0", "1.0", "the discount is 1", "a [cost]"),
    row("corridor-blind", "discount = 0.75", "discount = -0.5", "-0.5", "the discount is -0.5", "from 0"),
    row("corridor-blind", "discount = 0.75", "discount = nan", "nan", "not a number", "finite"),
    row("scalar-lqg", "discount = 1.0", "discount = 1.5", "1.5", "the discount is 1.5", "from 0"),
    row("scalar-lqg", "length = 10", "", "1.0 # a finite", "a discount of 1 needs a stated length", "`length`"),
    row("corridor-blind", "A = [[1.0]]", "A = [[inf]]", "inf", "infinite", "finite"),
    row("corridor-blind", "A = [[1.0]]", "A = [[nan]]", "nan", "not a number", "finite"),
    row("corridor-blind", START, "mean = [-inf]", "-inf", "infinite", "finite"),
    row("corridor-blind", EAST, "EAST = { u = [nan] }", "nan", "not a number", "finite"),
    row("corridor-blind", "value = 1.0", "value = inf", "inf", "infinite", "finite"),
    row("corridor-blind", "[[0.0, 4.0]]", "[[0.0, inf]]", "inf", "infinite", "finite"),
    row("corridor-blind", "noise = [[0.45]]", "noise = [[inf]]", "inf", "infinite", "finite"),
    row("load-unload", "reward = 1.0", "reward = nan", "nan", "not a number", "finite"),
    row("cart-pole", "length = 0.3", "length = 0.0", "0.0\ninertia", "this is 0", "more than 0"),
    row("cart-pole", "force_noise = 0.45", "force_noise = -1", "-1 # act", "this is -1", "0 or more"),
    row("corridor-blind", "length = 60", "length = 0", "0 # 0.75", "no steps", "at least 1"),
    row("corridor-blind", "length = 60", "length = -1", "-1 # 0.75", "-1", "not negative"),
    row("tiger", "level_tolerance = 1e-4", "level_tolerance = -1e-4", "-1e-4", "the tolerance is", "0 or more"),
    row("tiger", "level_tolerance = 1e-4", "level_limit = 0", "0 # the variance", "no level", "at least 1"),
    // Shapes.
    row("corridor-blind", "A = [[1.0]]", "A = [[1.0, 0.0]]", "[[1.0, 0.0]]", "a 1 x 2 matrix where 1 x 1 belongs", "1 state variable"),
    row("corridor-blind", "B = [[1.0]]", "B = [[1.0], [0.0]]", "[[1.0], [0.0]]", "a 2 x 1 matrix where 1 x 1 belongs", "1 state variable"),
    row("corridor-blind", "H = [[1.0]]", "H = [[1.0, 2.0]]", "[[1.0, 2.0]]", "a 1 x 2 matrix where 1 x 1 belongs", "1 state variable"),
    row("corridor-blind", "H = [[1.0]]", "H = [[1.0], [1.0]]", "[[0.45]]", "a 1 x 1 matrix where 2 x 2 belongs", "2 readings"),
    row("corridor-blind", "covariance = [[0.30]]", "covariance = []", "[] #", "a 0 x 0 matrix where 1 x 1 belongs", "1 state variable"),
    row("corridor-blind", "A = [[1.0]]", "A = 1.0", "1.0\nB", "unexpected", "a list"),
    row("corridor-blind", START, "mean = [0.0, 0.0]", "[0.0, 0.0]", "2 numbers where 1 belong", "1 state variable"),
    row("corridor-blind", EAST, "EAST = { u = [1.0, 2.0] }", "[1.0, 2.0]", "2 numbers where 1 belong", "1 control"),
    row("maze-2d", "A = [[1.0, 0.0], [0.0, 1.0]]", "A = [[1.0, 0.0], [0.0]]", "[0.0]]", "row 2 has 1 number", "equally long"),
    row("maze-2d", "NORTH = { u = [0.0, 1.0] }", "NORTH = { u = [0.0, 1.0], noise = [[0.1]] }", "[[0.1]]", "a 1 x 1 matrix where 2 x 2", "2 state variables"),
    row("corridor-blind", "[[0.0, 4.0]]", "[[0.0, 4.0], [0.0, 1.0]]", "[[0.0, 4.0], [0.0", "2 pairs of bounds for 1 state variable", "`names`"),
    row("corridor-blind", "[[0.0, 4.0]]", "[[0.0, 4.0, 5.0]]", "[0.0, 4.0, 5.0]", "length 3", "two numbers"),
    row("scalar-lqg", "control = [[1.0]]", "control = [[1.0, 0.0], [0.0, 1.0]]", "[[1.0, 0.0]", "a 2 x 2 matrix where 1 x 1", "1 control"),
    row("corridor-blind", "[world]", "[world]\nkind = \"cart-pole\"", "\"cart-pole\"", "parameters of the cart and pole are missing", "[world.cart-pole]"),
    row("corridor-blind", "[world]", "[world]\nkind = \"boat\"", "\"boat\"", "unknown value `boat`", "`linear`"),
    // Covariances.
    row("maze-2d", "noise = [[0.15, 0.0], [0.0, 0.15]]", "noise = [[0.15, 0.1], [0.2, 0.15]]", "0.1],", "row 1, column 2 is 0.1 and row 2, column 1 is 0.2", "the same"),
    row("maze-2d", "noise = [[0.20, 0.0], [0.0, 0.20]]", "noise = [[0.2, 0.3], [0.3, 0.2]]", "[[0.2, 0.3]", "eigenvalue is -0.1", "correlations"),
    row("corridor-blind", "covariance = [[0.30]]", "covariance = [[-0.3]]", "[[-0.3]]", "eigenvalue is -0.3", "negative"),
    row("tiger", "LISTEN = {}", "LISTEN = { sensor_noise = [[-1.0]] }", "[[-1.0]]", "eigenvalue is -1", "negative"),
    // Regions.
    row("corridor-blind", GOAL, "in = { x = [3.0, 3.0] }", "[3.0, 3.0]", "the region [3, 3] is empty", "lower end first"),
    row("corridor-blind", GOAL, "in = { x = [4.0, 3.0] }", "[4.0, 3.0]", "the region [4, 3] is inverted", "lower end first"),
    row("corridor-blind", GOAL, "in = { x = [nan, 3.0] }", "[nan, 3.0]", "not a number", "`-inf`"),
    row("corridor-blind", "[[0.0, 4.0]]", "[[4.0, 0.0]]", "[4.0, 0.0]", "the bounds [4, 0] is inverted", "lower end first"),
    row("corridor-blind", GOAL, "in = { y = [3.0, 4.0] }", "y = [3.0", "unknown state variable `y`", "`x`"),
    row("corridor-blind", GOAL, "in = 3", "3\nvalue", "unexpected number `3`", "intervals such as"),
    row("corridor-blind", GOAL, "in = \"*\"", "\"*\"", "this model has no map", "add a [map]"),
    row("cart-pole", "alive = { position", "alive = { positon", "positon", "unknown state variable `positon`", "`position`"),
    row("corridor-blind", "length = 60", "length = 60\nfailure_reward = -1.0", "failure_reward", "nothing says what failure is", "`alive"),
    // Names.
    row("tiger", "action = \"LISTEN\"", "action = \"LISTN\"", "\"LISTN\"", "unknown action `LISTN`", "`LISTEN`"),
    row("tiger", "action = \"LISTEN\"", "action = [\"OPEN-LEFT\", \"SHOUT\"]", "\"SHOUT\"", "unknown action `SHOUT`", "`LISTEN`, `OPEN-LEFT`"),
    row("tiger", "action = \"LISTEN\"", "action = []", "[]\n", "list of actions is empty", "delete the key"),
    row("corridor-blind", GOAL, "mode = \"loaded\"", "\"loaded\"", "unknown mode `loaded`", "none is declared"),
    row("load-unload", "becomes = \"loaded\"", "becomes = \"laoded\"", "\"laoded\"", "unknown mode `laoded`", "`loaded`"),
    row("load-unload", "action = \"UNLOAD\"", "action = \"UNLAOD\"", "\"UNLAOD\"", "unknown action `UNLAOD`", "`UNLOAD`"),
    row("load-unload", "in = { x = [0.0, 1.0] }", "in = { z = [0.0, 1.0] }", "z = [0.0", "unknown state variable `z`", "`x`"),
    row("load-unload", "mode = \"empty\"\nmean", "mode = \"full\"\nmean", "\"full\"", "unknown mode `full`", "`empty`"),
    row("corridor-blind", "WEST = {", "EAST = {", "EAST = { u = [-1.0]", "twice", "rename"),
    row("maze-2d", "names = [\"x\", \"y\"]", "names = [\"x\", \"x\"]", "\"x\"] ", "two state variables are called `x`", "rename"),
    row("load-unload", "\"empty\", \"loaded\"]", "\"empty\", \"empty\"]", "\"empty\"]", "two modes are called `empty`", "rename"),
    row("corridor-blind", "names = [\"x\"]", "names = []", "[]\n", "no state variable", "name at least one"),
    row("corridor-blind", "name = \"corridor-blind\"", "name = \"\"", "\"\"\n", "no name", "short name"),
    row("tiger", "[actions]\nLISTEN = {}\nOPEN-LEFT = { then = \"end\" }\nOPEN-RIGHT = { then = \"end\" }", "[actions]", "[actions]", "no action", "STOP"),
    row("tiger", "then = \"end\"", "then = \"ends\"", "\"ends\"", "unknown value `ends`", "`end`"),
    // Names that a terminal would obey, or that are not what they look like.
    row("corridor-blind", "name = \"corridor-blind\"", "name = \"corri\\u001b[31mdor\"", "\"corri", "the character \\u{1b}", "can be seen"),
    row("corridor-blind", "about = \"", "about = \"\\u009b2J", "\"\\u009b", "a text with the character \\u{9b}", "can be seen"),
    row("corridor-blind", "names = [\"x\"]", "names = [\"x\\u0007\"]", "\"x\\u0007", "the character \\u{7}", "can be seen"),
    row("corridor-blind", EAST, "\"EA\\nST\" = { u = [1.0] }", "\"EA", "the character \\u{a}", "can be seen"),
    row("corridor-blind", EAST, "\"\u{202e}TSAE\" = { u = [1.0] }", "\"\u{202e}", "the character \\u{202e}", "can be seen"),
    row("load-unload", "\"empty\", \"loaded\"]", "\"empty\", \"load\\bed\"]", "\"load\\b", "the character \\u{8}", "can be seen"),
    // More than anyone waits for.
    row("tiger", "level_tolerance = 1e-4", "level_limit = 100001", "100001", "100001 levels", "at most 100000"),
    row("corridor-blind", "[[0.0, 4.0]]", "[[-1e308, 1e308]]", "[-1e308", "infinite", "finite"),
    // Starts.
    row("tiger", "weight = 0.5", "weight = 0.7", "0.5", "sum to 1.2", "sum to 1"),
    row("tiger", "weight = 0.5", "weight = -0.5", "-0.5", "the weight is -0.5", "above 0"),
    row("corridor-blind", START, "mean = [-0.5]", "-0.5", "x = -0.5 is outside the bounds", "between 0 and 4"),
    row("cart-pole", "[episode]", "[episode]\nfailure_reward = nan", "nan", "not a number", "finite"),
    row("cart-pole", "alive = { position = [-2.4, 2.4]", "alive = { position = [1.0, 2.4]", "[0.0, 0.0, 0.0, 0.0]", "outside `episode.alive`", "start inside"),
    // Cart and pole.
    row("cart-pole", "linearise = \"cart-pole\"", "linearise = \"cart-pole\"\nA = [[1.0]]", "A = [[", "also comes from `linearise`", "delete"),
    row("cart-pole", "linearise = \"cart-pole\"", "A = [[1.0]]", "[motion]", "`noise` is missing", "add `noise`"),
    row("cart-pole", "kind = \"cart-pole\"", "kind = \"linear\"\n[world.cart-poles]", "cart-poles", "unknown key `cart-poles`", "`cart-pole`"),
    row("cart-pole", "gravity = 9.8\n", "", "[world.cart-pole]", "`gravity` is missing", "add `gravity`"),
    row("cart-pole", "gravity = 9.8", "gravity = 1e307", "[world.cart-pole]", "farther in a step than numbers reach", "shorter `step`"),
    row("cart-pole", "step = 0.02", "step = 90.0", "[world.cart-pole]", "farther in a step than numbers reach", "shorter `step`"),
    // Walls and maps.
    row("corridor-blind", "bounds = [[0.0, 4.0]]", "", "\"clamp\"", "there are no bounds", "add `bounds`"),
    row("maze-2d", "....\n...*", "...\n...*", "...\n...*", "row 3 has 3 characters and the first row has 4", "equally long"),
    row("maze-2d", "....\n...*", ".@..\n...*", "@..\n", "unknown character `@`", "`#` is blocked"),
    row("maze-2d", "....\n...*", "....\n....", "\"*\"", "no cell of the map is marked `*`", "it has no marks"),
    row("maze-2d", "in = \"*\"", "in = \"g\"", "\"g\"", "no cell of the map is marked `g`", "its marks: `*`"),
    row("maze-2d", "'''\n....", "'''\n#...", "[0.0, 4.0] #", "inside a blocked cell", "a free cell"),
    row("maze-2d", "cell = 1.0", "cell = 0.0", "0.0\nrows", "the side of a cell is 0", "above 0"),
    row("maze-2d", "....\n....\n....\n...*\n", "", "'''", "the drawing is empty", "`#` is blocked"),
    row("maze-2d", "....\n....\n....\n...*", "+--+\n|  |\n+- +", " +\n'''", "` ` where a whole wall", "`+` at every corner"),
    row("maze-2d", "....\n....\n....\n...*", "+--+\n|ab|\n+--+", "b|", "unexpected `b` inside a cell", "one mark"),
    row("maze-2d", "....\n....\n....\n...*", "+--+\n   |\n+--+", "   |", "` ` where a wall", "`+` at every corner"),
    row("maze-2d", "....\n....\n....\n...*", "+--+--\n|  |  \n+--+--", "+--+--\n", "not evenly spaced", "`+` at every corner"),
    row("u-maze", "...**\n....#.##..", "...**\n....#.##.", "....#.##.\n", "row 3 has 9 characters and the first row has 10", "equally long"),
    row("u-maze", "....#...**\n....#...**", "....#.....\n....#.....", "\"*\"", "no cell of the map is marked `*`", "mark one in the drawing"),
    row("n-maze", "mean = [2.5, 0.5]", "mean = [3.25, 0.5]", "[3.25, 0.5]", "inside a blocked cell", "a free cell"),
    row("n-maze", "mean = [2.5, 0.5]", "mean = [2.5, 5.5]", "5.5", "y = 5.5 is outside the bounds", "between 0 and 5"),
    row("n-maze", "......#...", "......?...", "?...", "unknown character `?`", "`#` is blocked"),
    row("n-maze", "hypotheses = \"track\"", "hypotheses = \"tracked\"", "\"tracked\"", "unknown value `tracked`", "`track`"),
    row("corridor-blind", GOAL, "in = \"#\"", "\"#\"", "this model has no map", "add a [map]"),
    row("load-unload", "mode = \"loaded\"", "mode = \"full\"", "\"full\"", "unknown mode `full`", "`empty`"),
    row("load-unload", "in = { x = [4.0, 5.0] }", "in = \"u\"", "\"u\"", "this model has no map", "add a [map]"),
    row("corridor-blind", "[world]", "[map]\ncell = 1.0\nrows = \"..\"\n[world]", "[\"x\"]", "a map has two directions", "two state variables"),
    // The robot and its arena.
    row("robot-basic", "kind = \"robot\"", "kind = \"robots\"", "\"robots\"", "unknown value `robots`", "`robot`"),
    row("robot-basic", "kind = \"robot\"", "walls = \"clamp\"", "robot]", "nothing uses", "`kind = \"robot\"`"),
    row("basic", "walls = \"clamp\"", "kind = \"robot\"", "\"robot\"", "the parameters of the robot are missing", "[world.robot]"),
    row("robot-basic", "radius = 0.05", "", "[world.robot]", "`radius` is missing", "add `radius`"),
    row("robot-basic", "radius = 0.05", "radius = 0.05\ncolour = 3", "colour", "unknown key `colour`", "known here"),
    row("robot-basic", "cell = 0.25", "cell = 0.0", "0.0 # m\nradius", "this is 0", "more than 0"),
    row("robot-basic", "speed = 0.15", "speed = -1.0", "-1.0 # m/s", "this is -1", "more than 0"),
    row("robot-basic", "tick = 0.032", "tick = 1e-9", "1e-9", "commands to the wheels", "longer tick"),
    row("robot-basic", "speed = 0.15", "speed = 1e-300", "0.032 # s", "commands to the wheels", "more `speed`"),
    row("robot-basic", "tick = 0.032", "tick = 0.0", "0.0 # s", "this is 0", "more than 0"),
    row("robot-basic", "slip = 0.3", "slip = -0.3", "-0.3", "this is -0.3", "0 or more"),
    row("robot-basic", "compass_noise = 0.02", "compass_noise = nan", "nan", "not a number", "finite"),
    row("robot-basic", "axle = 0.08", "axle = 0.2", "0.2 # m", "wheels 0.2 m apart", "twice the radius"),
    row("robot-basic", "radius = 0.05", "radius = 0.2", "0.2 # m", "does not fit an arena 0.25 m wide", "make it smaller"),
    row("robot-basic", "radius = 0.05", "radius = 0.42\nhallway = 2.0", "0.42", "the robot cannot move", "make it smaller"),
    row("robot-basic", "range = 1.0", "range = 0.3", "0.3 # m", "sees no wall", "at least 0.45"),
    row("robot-basic", "uniform = { x = [0.0, 4.0] }", "mean = [0.1]\ncovariance = [[0.1]]", "[0.1]\ncov", "stand in a wall", "between 0.2 and 3.8"),
    row("robot-basic", "H = [[1.0]]", "H = [[2.0]]", "\"robot\" # two", "its place", "identity"),
    row("robot-basic", "bounds = [[0.0, 4.0]]", "", "\"robot\" # two", "no wall along x", "finite `bounds`"),
    // When rewards are paid, uniform starts, true motion.
    row("basic", "when = \"after\"", "when = \"later\"", "\"later\"", "unknown value `later`", "`after`"),
    row("cart-load-unload", "when = \"after\"", "when = 1", "1\nmode", "unexpected value", "string"),
    row("basic", "uniform = { x = [0.0, 4.0] }", "uniform = { y = [0.0, 4.0] }", "y = ", "`y`", "`x`"),
    row("basic", "uniform = { x = [0.0, 4.0] }", "uniform = { x = [4.0, 0.0] }", "[4.0, 0.0]", "4", "lower"),
    row("maze-4x4", "uniform = { x = [0.0, 4.0], y = [0.0, 4.0] }", "uniform = { x = [0.0, 4.0] }", "{ x", "y", "y"),
    row("basic", "uniform = { x = [0.0, 4.0] }", "uniform = { x = [0.0, 4.0] }\nmean = [1.0]", "mean", "uniform", "uniform"),
    row("basic", "uniform = { x = [0.0, 4.0] }", "uniform = { x = [-inf, 4.0] }", "[-inf", "is no box", "two numbers"),
    row("shuttle-blind", "[[world.motion.control]]", "[[world.motion.controls]]", "controls", "unknown key `controls`", "`control`"),
    // A rule of thumb.
    row("thermostat", "do = \"HEAT\"", "do = \"HEET\"", "\"HEET\"", "unknown action `HEET`", "`HEAT`"),
    row("thermostat", "when = \"temperature <", "when = \"temperatur <", "temperatur <", "unknown name `temperatur`", "`temperature`"),
    row("thermostat", "p_home > 0.2", "p_hom > 0.2", "p_hom >", "unknown name `p_hom`", "`p_home`"),
    row("thermostat", "do = \"HEAT\"\n", "do = \"HEAT\"\nif = 3\n", "if = 3", "unknown key `if`", "`when`"),
    row("thermostat", "[[rule]]\ndo = \"OFF\"", "", "when = \"temperature <", "nothing is said of what to do", "without `when`"),
    row("thermostat", "[[rule]]\ndo = \"OFF\"", "[[rule]]\ndo = \"OFF\"\n[[rule]]\ndo = \"HEAT\"", "[[rule]]\ndo = \"OFF\"", "never asked", "condition"),
];

fn error_of(text: &str) -> ModelError {
    scenario::read(text, "bad.toml")
        .map(|_| ())
        .expect_err(text)
}

fn line_and_column(text: &str, offset: usize) -> (usize, usize) {
    let before = &text[..offset];
    let line = before.rsplit('\n').next().unwrap_or(before);
    (before.matches('\n').count() + 1, line.chars().count() + 1)
}

#[test]
fn every_mistake_is_shown_at_its_place_with_a_hint() {
    let mut wrong = Vec::new();
    for Mistake {
        base,
        good,
        bad,
        at,
        message,
        hint,
    } in MISTAKES
    {
        let text = scenario::builtin(base).unwrap();
        assert!(text.contains(good), "{base} has no {good:?}");
        let text = text.replacen(good, bad, 1);
        let expected = line_and_column(
            &text,
            text.find(at)
                .unwrap_or_else(|| panic!("no {at:?} beside {bad:?}")),
        );
        let error = match scenario::read(&text, "bad.toml") {
            Ok(_) => {
                wrong.push(format!("{base}: {bad:?} is accepted"));
                continue;
            }
            Err(error) => error,
        };
        let place = error.place.clone().unwrap();
        if (place.line, place.column) != expected
            || !error.message.contains(message)
            || !error.hint.contains(hint)
        {
            wrong.push(format!(
                "{base}: {bad:?}\n   expected {expected:?} {message:?} {hint:?}\n   found {error}"
            ));
        }
    }
    assert!(
        wrong.is_empty(),
        "{} of {}:\n{}",
        wrong.len(),
        MISTAKES.len(),
        wrong.join("\n")
    );
}

/// What is too much to be written into the table above.
#[test]
fn more_than_anyone_waits_for_is_refused_at_once() {
    let corridor = scenario::builtin("corridor-blind").unwrap();
    let many = |count: usize, item: &dyn Fn(usize) -> String| {
        (0..count).map(item).collect::<Vec<_>>().join(", ")
    };
    let drawing = |width: usize, rows: usize| {
        let rows = format!("{}\n", "*".repeat(width)).repeat(rows);
        format!("[map]\ncell = 1.0\nrows = '''\n{rows}'''\n")
    };
    let plane = corridor.replacen("names = [\"x\"]", "names = [\"x\", \"y\"]", 1);
    let row = many(65, &|_| "1.0".to_owned());
    let column = many(65, &|_| "[1.0]".to_owned());
    let names = many(65, &|i| format!("\"x{i}\""));
    let modes = many(1001, &|i| format!("\"m{i}\""));
    let actions: String = (0..1001).map(|i| format!("A{i} = {{}}\n")).collect();
    let goals = "[[reward]]\nin = \"*\"\nvalue = 1.0\n";
    for (text, good, bad, message) in [
        (
            corridor,
            "names = [\"x\"]",
            format!("names = [{names}]"),
            "65 state variables",
        ),
        (
            corridor,
            "names = [\"x\"]",
            format!("names = [\"x\"]\nmodes = [{modes}]"),
            "1001 modes",
        ),
        (
            corridor,
            "[actions]",
            format!("[actions]\n{actions}"),
            "1004 actions",
        ),
        (
            corridor,
            "B = [[1.0]]",
            format!("B = [[{row}]]"),
            "65 controls",
        ),
        (
            corridor,
            "H = [[1.0]]",
            format!("H = [{column}]"),
            "65 sensor readings",
        ),
        (
            corridor,
            "[world]",
            drawing(500, 501) + "[world]",
            "250500 characters",
        ),
        (
            &plane,
            "[world]",
            drawing(400, 400) + goals + "[world]",
            "160001 boxes",
        ),
    ] {
        assert!(text.contains(good), "{good}");
        let clock = std::time::Instant::now();
        let error = error_of(&text.replacen(good, &bad, 1));
        assert!(
            error.message.contains(message),
            "{message}: {}",
            error.message
        );
        assert!(clock.elapsed().as_secs_f64() < 1.0, "{message}");
    }
}

/// `B u` is of two numbers, each of which is one.
#[test]
fn a_displacement_beyond_all_numbers_is_refused() {
    let text = scenario::builtin("corridor-blind").unwrap();
    let text = text.replacen("B = [[1.0]]", "B = [[1e200]]", 1);
    let error = error_of(&text.replacen(EAST, "EAST = { u = [1e200] }", 1));
    assert!(error.message.contains("B u is not finite"), "{error}");
}

#[test]
fn an_error_names_its_file() {
    let error = error_of("format = 1\nname = 3\n");
    assert_eq!(
        error.to_string(),
        "bad.toml:2:8: unexpected number `3` (hint: write a string)"
    );
}

#[test]
fn a_missing_file_is_named() {
    let error = scenario::find("no/such/file.toml").map(|_| ()).unwrap_err();
    assert_eq!(error.place, None);
    assert!(
        error
            .to_string()
            .starts_with("no/such/file.toml: cannot read the file"),
        "{error}"
    );
}

#[test]
fn a_misspelt_problem_brings_the_nearest_name() {
    let error = scenario::find("coridor").map(|_| ()).unwrap_err();
    assert_eq!(error.hint, "did you mean `corridor`?");
}

#[test]
fn a_file_that_is_not_text_is_refused_at_its_first_wrong_byte() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("image.toml");
    std::fs::write(&path, b"format = 1\nname = \"\xff\xfe\"\n").unwrap();
    let error = scenario::load(&path).map(|_| ()).unwrap_err();
    let place = error.place.clone().unwrap();
    assert_eq!((place.line, place.column), (2, 9));
    assert!(error.message.contains("not UTF-8"), "{error}");
}
