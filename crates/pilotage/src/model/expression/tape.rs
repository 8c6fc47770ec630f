//! An expression as a list of operations, each of which takes what those before it have left.

/// Most values that are held at once.
pub(super) const MOST_HELD: usize = 32;

/// As many as most expressions hold: much room takes long to clear.
const FEW_HELD: usize = 6;

/// What is made of one value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Unary {
    Negate,
    Not,
    Abs,
    Sqrt,
    Exp,
    Ln,
    Log10,
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Sign,
    Floor,
    Round,
}

/// What is made of two values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Binary {
    Add,
    Subtract,
    Multiply,
    Divide,
    Remainder,
    Power,
    Less,
    AtMost,
    More,
    AtLeast,
    Equal,
    Unequal,
    And,
    Or,
    Min,
    Max,
    Atan2,
    Hypot,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Op {
    Constant(f64),
    Variable(u32),
    Unary(Unary),
    Binary(Binary),
    /// A binary operation whose right side is a constant.
    WithConstant(Binary, f64),
    /// A binary operation whose right side is a variable.
    WithVariable(Binary, u32),
    /// A binary operation of a variable and a constant.
    OfVariable(Binary, u32, f64),
    /// The square of a value.
    Square,
    /// Of a condition and two values, the first value where the condition is true.
    Choose,
}

/// Operations in the order in which they are done.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Tape {
    ops: Vec<Op>,
    held: usize,
    /// Most values that are held on the way.
    deepest: usize,
}

impl Tape {
    /// Whether no further value can be held.
    pub(super) fn is_full(&self) -> bool {
        self.held == MOST_HELD
    }

    pub(super) fn constant(&mut self, value: f64) {
        self.ops.push(Op::Constant(value));
        self.hold();
    }

    pub(super) fn variable(&mut self, variable: usize) {
        self.ops.push(Op::Variable(variable as u32));
        self.hold();
    }

    fn hold(&mut self) {
        self.held += 1;
        self.deepest = self.deepest.max(self.held);
    }

    pub(super) fn unary(&mut self, unary: Unary) {
        if let [.., Op::Constant(x)] = self.ops[..] {
            self.fold(1, unary.of(x), Op::Unary(unary));
        } else {
            self.ops.push(Op::Unary(unary));
        }
    }

    pub(super) fn binary(&mut self, binary: Binary) {
        self.held -= 1;
        match self.ops[..] {
            [.., Op::Constant(x), Op::Constant(y)] => {
                self.fold(2, binary.of(x, y), Op::Binary(binary));
            }
            [.., Op::Constant(2.0)] if binary == Binary::Power => self.replace(1, Op::Square),
            [.., Op::Variable(x), Op::Constant(y)] => {
                self.replace(2, Op::OfVariable(binary, x, y));
            }
            [.., Op::Constant(y)] => self.replace(1, Op::WithConstant(binary, y)),
            [.., Op::Variable(y)] => self.replace(1, Op::WithVariable(binary, y)),
            _ => self.turned(binary),
        }
    }

    /// Adds and multiplies the other way round where that is shorter: it comes to the same.
    fn turned(&mut self, binary: Binary) {
        let turns = matches!(binary, Binary::Add | Binary::Multiply);
        let left = self.last_begins().checked_sub(1).filter(|_| turns);
        let (left, op) = match left.map(|left| (left, self.ops[left])) {
            Some((left, Op::Constant(x))) => (left, Op::WithConstant(binary, x)),
            Some((left, Op::Variable(x))) => (left, Op::WithVariable(binary, x)),
            _ => return self.ops.push(Op::Binary(binary)),
        };
        self.ops.remove(left);
        self.ops.push(op);
    }

    /// Where the operations begin of which the last value is made.
    fn last_begins(&self) -> usize {
        let mut missing = 1;
        let from_the_end = self.ops.iter().enumerate().rev();
        let mut begins = from_the_end.skip_while(|(_, op)| {
            missing = missing - 1 + op.takes();
            missing > 0
        });
        begins.next().map_or(0, |(at, _)| at)
    }

    pub(super) fn choose(&mut self) {
        self.held -= 2;
        self.ops.push(Op::Choose);
    }

    /// Puts a value for the last constants, of which the operation would make it. A NaN is not written down: a tape equals itself.
    fn fold(&mut self, constants: usize, value: f64, op: Op) {
        if value.is_nan() {
            self.ops.push(op);
        } else {
            self.replace(constants, Op::Constant(value));
        }
    }

    fn replace(&mut self, last: usize, op: Op) {
        self.ops.truncate(self.ops.len() - last);
        self.ops.push(op);
    }

    /// The variables that are used, each as often as it is.
    pub(super) fn variables(&self) -> impl Iterator<Item = usize> {
        self.ops.iter().filter_map(|op| match *op {
            Op::Variable(variable)
            | Op::WithVariable(_, variable)
            | Op::OfVariable(_, variable, _) => Some(variable as usize),
            _ => None,
        })
    }

    pub(super) fn value(&self, variables: &[f64]) -> f64 {
        match self.deepest <= FEW_HELD {
            true => self.value_in(&mut [0.0; FEW_HELD], variables),
            false => self.value_in(&mut [0.0; MOST_HELD], variables),
        }
    }

    /// The value, with room for those that wait. The last one is kept apart, so that most operations do not touch the others; `below[0]` is
    /// never read.
    fn value_in(&self, below: &mut [f64], variables: &[f64]) -> f64 {
        let mut held = 0;
        let mut last = 0.0;
        for op in &self.ops {
            match *op {
                Op::Constant(value) => {
                    below[held] = last;
                    held += 1;
                    last = value;
                }
                Op::Variable(variable) => {
                    below[held] = last;
                    held += 1;
                    last = variables[variable as usize];
                }
                Op::OfVariable(binary, variable, value) => {
                    below[held] = last;
                    held += 1;
                    last = binary.of(variables[variable as usize], value);
                }
                Op::Unary(unary) => last = unary.of(last),
                Op::Binary(binary) => {
                    held -= 1;
                    last = binary.of(below[held], last);
                }
                Op::WithConstant(binary, value) => last = binary.of(last, value),
                Op::WithVariable(binary, variable) => {
                    last = binary.of(last, variables[variable as usize]);
                }
                Op::Square => last *= last,
                Op::Choose => {
                    held -= 2;
                    if is_true(below[held]) {
                        last = below[held + 1];
                    }
                }
            }
        }
        last
    }
}

impl Op {
    /// Values that it takes off those that are held.
    fn takes(self) -> usize {
        match self {
            Self::Constant(_) | Self::Variable(_) | Self::OfVariable(..) => 0,
            Self::Unary(_) | Self::WithConstant(..) | Self::WithVariable(..) | Self::Square => 1,
            Self::Binary(_) => 2,
            Self::Choose => 3,
        }
    }
}

impl Unary {
    fn of(self, x: f64) -> f64 {
        match self {
            Self::Negate => -x,
            Self::Not => truth(!is_true(x)),
            Self::Abs => x.abs(),
            Self::Sqrt => x.sqrt(),
            Self::Exp => x.exp(),
            Self::Ln => x.ln(),
            Self::Log10 => x.log10(),
            Self::Sin => x.sin(),
            Self::Cos => x.cos(),
            Self::Tan => x.tan(),
            Self::Asin => x.asin(),
            Self::Acos => x.acos(),
            Self::Atan => x.atan(),
            Self::Sign if x == 0.0 => 0.0,
            Self::Sign => x.signum(),
            Self::Floor => x.floor(),
            Self::Round => x.round(),
        }
    }
}

impl Binary {
    /// Inlined wherever it is used: most of what a model costs is spent here.
    #[inline(always)]
    fn of(self, x: f64, y: f64) -> f64 {
        match self {
            Self::Add => x + y,
            Self::Subtract => x - y,
            Self::Multiply => x * y,
            Self::Divide => x / y,
            Self::Remainder => remainder(x, y),
            Self::Power => power(x, y),
            Self::Less => truth(x < y),
            Self::AtMost => truth(x <= y),
            Self::More => truth(x > y),
            Self::AtLeast => truth(x >= y),
            Self::Equal => truth(x == y),
            Self::Unequal => truth(x != y),
            Self::And => truth(is_true(x) && is_true(y)),
            Self::Or => truth(is_true(x) || is_true(y)),
            // Those of the standard library pass over a NaN.
            Self::Min if x < y || x.is_nan() => x,
            Self::Max if x > y || x.is_nan() => x,
            Self::Min | Self::Max => y,
            Self::Atan2 => x.atan2(y),
            Self::Hypot => hypot(x, y),
        }
    }
}

/// The length of `(x, y)`. The general function takes several times as long as a root, and is only needed where squares leave the range of
/// numbers.
fn hypot(x: f64, y: f64) -> f64 {
    let square = x * x + y * y;
    match (1e-280..1e280).contains(&square) {
        true => square.sqrt(),
        false => x.hypot(y),
    }
}

fn is_true(x: f64) -> bool {
    x != 0.0
}

fn truth(holds: bool) -> f64 {
    f64::from(u8::from(holds))
}

/// What is left of `x` below a whole multiple of `y`, with the sign of `y` and nearer to 0 than `y`.
fn remainder(x: f64, y: f64) -> f64 {
    let rest = x % y;
    if rest == 0.0 {
        return 0.0_f64.copysign(y);
    }
    if (rest < 0.0) == (y < 0.0) {
        return rest;
    }
    let moved = rest + y;
    if moved != y {
        return moved;
    }
    // The sum was rounded to `y` itself.
    if y > 0.0 { y.next_down() } else { y.next_up() }
}

/// `x^y`, by multiplication for small whole `y`: rounding errors of many multiplications would add up.
fn power(x: f64, y: f64) -> f64 {
    if y.abs() <= 64.0 && y.trunc() == y {
        x.powi(y as i32)
    } else {
        x.powf(y)
    }
}
