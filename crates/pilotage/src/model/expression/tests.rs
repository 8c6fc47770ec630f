use std::f64::consts::{E, FRAC_PI_2, FRAC_PI_4, PI};

use proptest::prelude::*;

use super::{Expression, ExpressionError};

const NAMES: [&str; 4] = ["x", "y", "u1", "my name"];
const POINT: [f64; 4] = [3.0, -2.0, 0.5, 7.0];

fn value(source: &str) -> f64 {
    match Expression::parse(source, &NAMES) {
        Ok(expression) => expression.value(&POINT),
        Err(error) => panic!("{source}: {error}"),
    }
}

fn error(source: &str) -> ExpressionError {
    match Expression::parse(source, &NAMES) {
        Ok(expression) => panic!("{source} is {expression:?}"),
        Err(error) => error,
    }
}

/// Whether two values are the same, where one NaN is as good as another.
fn same(a: f64, b: f64) -> bool {
    a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan()
}

#[test]
fn values_are_exact() {
    let inf = f64::INFINITY;
    for (source, expected) in [
        // Numbers, names and constants.
        ("1", 1.0),
        ("1.", 1.0),
        (".5", 0.5),
        ("1e-3", 1e-3),
        ("2E+2", 200.0),
        ("  x\n+\tu1 ", 3.5),
        ("`my name` - `x`", 4.0),
        ("pi", PI),
        ("e", E),
        ("-inf", -inf),
        // Precedence and associativity.
        ("1 + 2*3", 7.0),
        ("(1 + 2)*3", 9.0),
        ("10 - 4 - 3", 3.0),
        ("16/4/2", 2.0),
        ("17 % 10 % 4", 3.0),
        ("2*7 % 4", 2.0),
        ("7 % 4*2", 6.0),
        ("1 + 7 % 4", 4.0),
        ("2^3^2", 512.0),
        ("(2^3)^2", 64.0),
        ("-2^2", -4.0),
        ("(-2)^2", 4.0),
        ("2^-1", 0.5),
        ("2^-2^2", 0.0625),
        ("-x*y", 6.0),
        ("2*-x", -6.0),
        ("2 - -x", 5.0),
        ("--+x", 3.0),
        ("2^-1*6", 3.0),
        ("1 + 1 < 3", 1.0),
        ("1 < 2 and 3 < 2", 0.0),
        ("not 1 == 2", 1.0),
        ("not not 5", 1.0),
        ("1 or 1 and 0", 1.0),
        ("(1 or 1) and 0", 0.0),
        ("not 0 and 0", 0.0),
        ("0 and not 0 or 1", 1.0),
        ("(1 < 2) < 0.5", 0.0),
        // Comparisons and truth.
        ("x < 3", 0.0),
        ("x <= 3", 1.0),
        ("x > 3", 0.0),
        ("x >= 3", 1.0),
        ("x == 3", 1.0),
        ("x != 3", 0.0),
        ("-2 and .1", 1.0),
        ("0/0 == 0/0", 0.0),
        // The remainder has the sign of the divisor.
        ("7 % 3", 1.0),
        ("-7 % 3", 2.0),
        ("7 % -3", -2.0),
        ("-7 % -3", -1.0),
        ("-6 % 3", 0.0),
        ("-1e-20 % 1", 1.0_f64.next_down()),
        ("1e-20 % -1", (-1.0_f64).next_up()),
        ("1 % 0", f64::NAN),
        // Functions.
        ("abs(-2)", 2.0),
        ("sqrt(9)", 3.0),
        ("sqrt(-1)", f64::NAN),
        ("exp(0)", 1.0),
        ("ln(e)", 1.0),
        ("log10(1000)", 3.0),
        ("sin(0)", 0.0),
        ("cos(0)", 1.0),
        ("tan(0)", 0.0),
        ("asin(1)", FRAC_PI_2),
        ("acos(1)", 0.0),
        ("atan(1)", FRAC_PI_4),
        ("atan2(1, 0)", FRAC_PI_2),
        ("atan2(0, -1)", PI),
        ("hypot(3, 4)", 5.0),
        ("hypot(0, 0)", 0.0),
        ("hypot(3e200, 0)", 3e200),
        ("hypot(0, -4e-200)", 4e-200),
        ("y*(x*(y + x*x))", -42.0),
        ("2 + 3*(1 - x*(x + y))", -4.0),
        ("x - y*(1 + 2*(x + x*y))", -7.0),
        ("x*if(x + y > 0, 2 + sqrt(x*x), y)", 15.0),
        ("y + hypot(x*1, 4*(x + y))", 3.0),
        ("min(x, y)", -2.0),
        ("min(4, 1, 2, 3)", 1.0),
        ("max(4, 1, 2, 5, 3)", 5.0),
        ("min(1, 0/0)", f64::NAN),
        ("min(0/0, 1)", f64::NAN),
        ("max(1, 0/0)", f64::NAN),
        ("max(0/0, 1)", f64::NAN),
        ("pow(2, 10)", 1024.0),
        ("pow(4, 0.5)", 2.0),
        ("sign(-3)", -1.0),
        ("sign(0)", 0.0),
        ("sign(-0)", 0.0),
        ("sign(.1)", 1.0),
        ("floor(-1.5)", -2.0),
        ("round(2.5)", 3.0),
        ("round(-2.5)", -3.0),
        ("clamp(x, 0, 1)", 1.0),
        ("clamp(y, 0, 1)", 0.0),
        ("clamp(u1, 0, 1)", 0.5),
        ("clamp(u1, 1, 0)", 0.0),
        ("if(x < 0, -1, 1)", 1.0),
        ("if(x > 0, -1, 1)", -1.0),
        ("if(1, x, 0/0)", 3.0),
        ("if(0, ln(-1), x)", 3.0),
        ("sin (0) + (((x)))", 3.0),
        ("1 + if(x, min(x, 2), 9)*10", 21.0),
        ("(abs(x - 5)/sqrt(4) + 0.5)^2", 2.25),
    ] {
        let found = value(source);
        assert!(same(found, expected), "{source}: {found}, not {expected}");
    }
}

#[test]
fn a_whole_power_is_a_product_where_that_is_exact_enough() {
    for x in [1.1, -0.3, 7e5] {
        let cube = Expression::parse("x^3", &["x"]).unwrap();
        assert_eq!(cube.value(&[x]), x * x * x);
    }
    assert_eq!(value("1.0000001^1000000"), 1.0000001_f64.powf(1e6));
    assert!(value("(-8)^(1/3)").is_nan());
}

#[test]
fn a_variable_wins_over_a_constant_and_a_call_over_a_variable() {
    let names = ["e", "min", "and", "e"];
    let parse = |source| Expression::parse(source, &names).unwrap();
    assert_eq!(
        parse("e + min(1, 2) + min + `and`").value(&[10.0, 20.0, 30.0, 40.0]),
        61.0
    );
    assert_eq!(parse("2*e").value(&[1e3, 0.0, 0.0, 0.0]), 2e3);
}

#[test]
fn it_tells_what_it_depends_on() {
    let parse = |source| Expression::parse(source, &NAMES).unwrap();
    let sum = parse("x + u1*2");
    let used: Vec<bool> = (0..5).map(|variable| sum.uses(variable)).collect();
    assert_eq!(used, [true, false, true, false, false]);
    assert_eq!(sum.constant(), None);
    assert_eq!(sum.source(), "x + u1*2");
    assert_eq!(parse("2*sqrt(16) - 1").constant(), Some(7.0));
    assert_eq!(parse("if(1 < 2, 3, 4)").constant(), Some(3.0));
    assert_eq!(parse("if(1, 2, x)").constant(), None);
    assert!(parse("0/0 + 1").constant().unwrap().is_nan());
    assert_eq!(parse("x*(0/0)"), parse("x*(0/0)"));
    assert_ne!(parse("x"), parse("y"));
}

/// The part in `«»` is what the error is about.
#[test]
fn errors_say_what_where_and_what_to_do() {
    for (marked, what, hint) in [
        ("«»", "the expression is empty", "write a number, or"),
        ("« \n»", "the expression is empty", "write a number, or"),
        ("x + «z»", "unknown name `z`", "did you mean `x`?"),
        (
            "«my_name»",
            "unknown name `my_name`",
            "did you mean `my name`?",
        ),
        ("«`u 1`»", "unknown name `u 1`", "did you mean `u1`?"),
        ("«pie»", "unknown name `pie`", "did you mean `pi`?"),
        (
            "«velocity»",
            "unknown name `velocity`",
            "known here: `x`, `y`, `u1`, `my name`, `pi`, `e`, `inf`",
        ),
        (
            "«sgrt»(x)",
            "unknown function `sgrt`",
            "did you mean `sqrt`?",
        ),
        ("«log»(x)", "unknown function `log`", "write `ln(x)`, or"),
        (
            "1 + «sin» x",
            "the function `sin` without arguments",
            "write `sin(x)`",
        ),
        (
            "«abs(x, y)»",
            "`abs` takes 1 argument, not 2",
            "write `abs(x)`",
        ),
        (
            "2*«abs()»",
            "`abs` takes 1 argument, not 0",
            "write `abs(x)`",
        ),
        (
            "«atan2(x)» + 1",
            "`atan2` takes 2 arguments, not 1",
            "write `atan2(y, x)`",
        ),
        (
            "«min(x)»",
            "`min` takes 2 or more arguments, not 1",
            "write `min(x, y, ...)`",
        ),
        (
            "«clamp(x, 1)»",
            "`clamp` takes 3 arguments, not 2",
            "write `clamp(x, low, high)`",
        ),
        (
            "«if(x, 1, 2, 3)»",
            "`if` takes 3 arguments, not 4",
            "write `if(condition, then, else)`",
        ),
        ("x «$»", "unexpected character `$`", "write numbers, names"),
        (
            "x «=» 3",
            "unexpected character `=`",
            "write `==` to compare",
        ),
        ("«!»x", "unexpected character `!`", "write `not`"),
        ("x «&»& y", "unexpected character `&`", "write `and`"),
        ("«|»x|", "unexpected character `|`", "write `or`"),
        ("2*«[»x]", "unexpected character `[`", "group with `(`"),
        (
            "1 + «.»",
            "unexpected character `.`",
            "a number has a digit",
        ),
        (
            "gr«ö»sse",
            "unexpected character `ö`",
            "put a name that has",
        ),
        (
            "x + «`my name»",
            "a name in backticks that does not end",
            "close it",
        ),
        (
            "1 - «1e999»",
            "a number that is too large",
            "the largest is",
        ),
        (
            "2*«(»x + 1",
            "a `(` that is not closed",
            "close it with `)`",
        ),
        ("sin«(»x", "a `(` that is not closed", "close it with `)`"),
        ("x + 1«)»", "a `)` that closes nothing", "leave it out"),
        ("1«,»5", "a `,` that separates no arguments", "decimals are"),
        (
            "(1«,» 5)",
            "a `,` that separates no arguments",
            "decimals are",
        ),
        (
            "x +«»",
            "the expression ends where a value should be",
            "write",
        ),
        (
            "(«»",
            "the expression ends where a value should be",
            "write",
        ),
        ("«*» x", "`*` where a value should be", "write a number"),
        (
            "x*«*»2",
            "`*` where a value should be",
            "write `^` for a power",
        ),
        ("(«)»", "`)` where a value should be", "write a number"),
        (
            "min(x, «)»",
            "`)` where a value should be",
            "write a number",
        ),
        (
            "2«x»",
            "no operator between `2` and `x`",
            "to multiply, write `2*x`",
        ),
        (
            "(x)«(»y)",
            "no operator between `)` and `(`",
            "to multiply, write `)*(`",
        ),
        (
            "x «2»",
            "no operator between `x` and `2`",
            "to multiply, write `x*2`",
        ),
        (
            "x«(»2)",
            "no operator between `x` and `(`",
            "to multiply, write `x*(`",
        ),
        ("2«`x`»", "no operator between `2` and ``x``", "to multiply"),
        (
            "x «not» y",
            "no operator between `x` and `not`",
            "write `and not`",
        ),
        (
            "0 < x «<=» 1",
            "a second comparison in a row",
            "compare two at a time",
        ),
        (
            "x == y «==» 1",
            "a second comparison in a row",
            "compare two at a time",
        ),
        (
            "1 + «not» x",
            "`not` after an operator",
            "put it in parentheses",
        ),
        (
            "x == «not» y",
            "`not` after an operator",
            "put it in parentheses",
        ),
    ] {
        let start = marked.find('«').unwrap();
        let end = marked.find('»').unwrap() - '«'.len_utf8();
        let source = marked.replace(['«', '»'], "");
        let error = error(&source);
        assert_eq!(error.span, start..end, "{source}: {error}");
        assert!(error.what.starts_with(what), "{source}: {error}");
        assert!(error.hint.starts_with(hint), "{source}: {error}");
    }
}

#[test]
fn an_error_is_shown_with_its_hint() {
    assert_eq!(
        error("2x").to_string(),
        "no operator between `2` and `x` (hint: to multiply, write `2*x`)"
    );
}

#[test]
fn what_is_too_much_is_refused() {
    let nested = |open: &str, close: &str, deep: usize| {
        format!("{}x{}", open.repeat(deep), close.repeat(deep))
    };
    assert_eq!(value(&nested("(", ")", 200)), 3.0);
    assert_eq!(value(&nested("-", "", 200)), 3.0);
    for (open, close) in [("(", ")"), ("-", ""), ("not ", ""), ("abs(", ")")] {
        let error = error(&nested(open, close, 201));
        assert_eq!(error.what, "nested more than 200 deep");
        assert_eq!(error.span, 201 * open.len()..201 * open.len() + 1);
    }
    // The operand in the middle is held together with those before it.
    assert_eq!(value(&nested("x*(", ")", 31)), 3.0_f64.powi(32));
    assert_eq!(value(&nested("x^", "", 31)), f64::INFINITY);
    let error = error(&nested("x*(", ")", 32));
    assert_eq!(error.what, "more than 32 values that wait for each other");
    assert_eq!(error.span, 96..97);
    // What is added up one after another does not wait.
    assert_eq!(value(&format!("0{}", "+1".repeat(4999))), 4999.0);
    let long = " ".repeat(9_999) + "xx";
    assert_eq!(value(&long[..10_000]), 3.0);
    let error = Expression::parse(&long, &NAMES).unwrap_err();
    assert_eq!(error.what, "an expression of 10001 bytes");
    assert_eq!(error.span, 0..10_001);
}

/// What an expression may be, valued by the operators of the language it is tested in.
#[derive(Debug, Clone)]
enum Tree {
    Number(f64),
    Variable(usize),
    Prefix(&'static str, Box<Tree>),
    Infix(Box<Tree>, &'static str, Box<Tree>),
    Call(&'static str, Vec<Tree>),
}

impl Tree {
    fn value(&self) -> f64 {
        let truth = |holds| if holds { 1.0 } else { 0.0 };
        match self {
            Self::Number(value) => *value,
            Self::Variable(variable) => POINT[*variable],
            Self::Prefix("-", x) => -x.value(),
            Self::Prefix("+", x) => x.value(),
            Self::Prefix(_, x) => truth(x.value() == 0.0),
            Self::Infix(x, operator, y) => {
                let (x, y) = (x.value(), y.value());
                match *operator {
                    "+" => x + y,
                    "-" => x - y,
                    "*" => x * y,
                    "/" => x / y,
                    "^" if y.abs() <= 64.0 && y.fract() == 0.0 => x.powi(y as i32),
                    "^" => x.powf(y),
                    "<" => truth(x < y),
                    "<=" => truth(x <= y),
                    ">" => truth(x > y),
                    ">=" => truth(x >= y),
                    "==" => truth(x == y),
                    "!=" => truth(x != y),
                    "and" => truth(x != 0.0 && y != 0.0),
                    "or" => truth(x != 0.0 || y != 0.0),
                    other => panic!("{other}"),
                }
            }
            Self::Call(function, arguments) => {
                let values: Vec<f64> = arguments.iter().map(Self::value).collect();
                match (*function, values.as_slice()) {
                    ("abs", [x]) => x.abs(),
                    ("sin", [x]) => x.sin(),
                    ("floor", [x]) => x.floor(),
                    ("atan2", [y, x]) => y.atan2(*x),
                    ("if", [condition, then, otherwise]) => {
                        if *condition != 0.0 {
                            *then
                        } else {
                            *otherwise
                        }
                    }
                    other => panic!("{other:?}"),
                }
            }
        }
    }

    /// How tightly it holds together; from 1 for `or` to 9 for what needs no parentheses anywhere.
    fn tightness(&self) -> usize {
        match self {
            Self::Prefix("not", _) => 3,
            Self::Prefix(..) => 7,
            Self::Infix(_, operator, _) => match *operator {
                "or" => 1,
                "and" => 2,
                "+" | "-" => 5,
                "*" | "/" => 6,
                "^" => 8,
                _ => 4,
            },
            _ => 9,
        }
    }

    /// Its text, with parentheses around every part, or where they are needed.
    fn text(&self, full: bool) -> String {
        let part = |tree: &Self, needed: bool| {
            let text = tree.text(full);
            if full || needed {
                format!("({text})")
            } else {
                text
            }
        };
        let own = self.tightness();
        match self {
            Self::Number(value) => format!("{value:?}"),
            Self::Variable(3) => "`my name`".to_owned(),
            Self::Variable(variable) => NAMES[*variable].to_owned(),
            Self::Prefix(operator, x) => {
                format!("{operator} {}", part(x, x.tightness() < own))
            }
            Self::Infix(x, operator, y) => {
                let (left, right) = match *operator {
                    "^" => (9, 7),
                    "<" | "<=" | ">" | ">=" | "==" | "!=" => (5, 5),
                    _ => (own, own + 1),
                };
                let sign = matches!(**y, Self::Prefix("-" | "+", _));
                let left = part(x, x.tightness() < left);
                let right = part(y, y.tightness() < right && !sign);
                format!("{left} {operator} {right}")
            }
            Self::Call(function, arguments) => {
                let texts = arguments.iter().map(|argument| part(argument, false));
                format!("{function}({})", texts.collect::<Vec<_>>().join(","))
            }
        }
    }
}

fn any_tree() -> impl Strategy<Value = Tree> {
    let leaf = prop_oneof![
        prop_oneof![Just(0.0), Just(1.0), Just(2.0), 0.0..10.0, 1e-12..1e12].prop_map(Tree::Number),
        (0..NAMES.len()).prop_map(Tree::Variable),
    ];
    let infix = [
        "+", "-", "*", "/", "^", "<", "<=", ">", ">=", "==", "!=", "and", "or",
    ];
    leaf.prop_recursive(6, 40, 3, move |part| {
        let two = (part.clone(), part.clone());
        let three = (part.clone(), part.clone(), part.clone());
        prop_oneof![
            2 => (prop::sample::select(vec!["-", "+", "not"]), part.clone())
                .prop_map(|(operator, x)| Tree::Prefix(operator, Box::new(x))),
            6 => (part.clone(), prop::sample::select(infix.to_vec()), part.clone())
                .prop_map(|(x, operator, y)| Tree::Infix(Box::new(x), operator, Box::new(y))),
            1 => (prop::sample::select(vec!["abs", "sin", "floor"]), part)
                .prop_map(|(function, x)| Tree::Call(function, vec![x])),
            1 => two.prop_map(|(y, x)| Tree::Call("atan2", vec![y, x])),
            1 => three.prop_map(|(x, y, z)| Tree::Call("if", vec![x, y, z])),
        ]
    })
}

/// Text that is nearly an expression.
fn any_words() -> impl Strategy<Value = String> {
    let words = [
        "1",
        "2.5",
        ".",
        "1e",
        "e",
        "x",
        "y",
        "`my name`",
        "`",
        "(",
        ")",
        ",",
        "+",
        "-",
        "*",
        "/",
        "%",
        "^",
        "<",
        "<=",
        "==",
        "!",
        "and",
        "or",
        "not",
        "if(",
        "min(",
        "abs(",
        "clamp(",
        " ",
        "ö",
    ];
    prop::collection::vec(prop::sample::select(words.to_vec()), 0..40)
        .prop_map(|words| words.concat())
}

/// Whatever a text is: an expression that has a value, or an error about a part of it.
fn read_anything(source: &str) {
    match Expression::parse(source, &NAMES) {
        Ok(expression) => {
            expression.value(&POINT);
            assert_eq!(expression, expression.clone());
        }
        Err(error) => {
            assert!(source.get(error.span.clone()).is_some(), "{error:?}");
            assert!(!error.what.is_empty() && !error.hint.is_empty());
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn parentheses_that_are_not_needed_change_nothing(tree in any_tree()) {
        for full in [true, false] {
            let source = tree.text(full);
            let found = value(&source);
            prop_assert!(same(found, tree.value()), "{source}: {found}, not {}", tree.value());
        }
    }

    #[test]
    fn a_remainder_lies_between_0_and_the_divisor(x in -1e6..1e6, d in 1e-6..1e6) {
        let parse = |source| Expression::parse(source, &["x", "d"]).unwrap();
        let rest = parse("x % d").value(&[x, d]);
        prop_assert!((0.0..d).contains(&rest), "{rest}");
        prop_assert_eq!(parse("-x % -d").value(&[x, d]), -rest);
    }

    #[test]
    fn no_text_makes_it_panic(bytes in prop::collection::vec(any::<u8>(), 0..60), words in any_words()) {
        read_anything(&String::from_utf8_lossy(&bytes));
        read_anything(&words);
    }
}
