//! From text to operations, by precedence climbing (V. R. Pratt, *Top down operator precedence*, 1973).

use std::ops::Range;

use super::ExpressionError;
use super::function::{Call, FUNCTIONS, Function, meant};
use super::tape::{Binary, MOST_HELD, Tape, Unary};
use super::token::{Kind, Token, tokens};
use crate::model::error::suggest;

/// How deep parentheses and operators may be nested.
const MOST_NESTED: usize = 200;

/// How tightly operators bind, the loosest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Level {
    Whole,
    Or,
    And,
    Not,
    Comparison,
    Sum,
    Product,
    Sign,
    Power,
}

const CONSTANTS: [(&str, f64); 3] = [
    ("pi", std::f64::consts::PI),
    ("e", std::f64::consts::E),
    ("inf", f64::INFINITY),
];

type Parsed = Result<(), ExpressionError>;

/// The operations that a source means.
pub(super) fn parse(source: &str, names: &[&str]) -> Result<Tape, ExpressionError> {
    let mut parser = Parser {
        source,
        names,
        tokens: tokens(source)?,
        next: 0,
        nested: 0,
        tape: Tape::default(),
    };
    if parser.peek() == Kind::End {
        return Err(ExpressionError::new(
            0..source.len(),
            "the expression is empty",
            "write a number, or something like `x + 1`",
        ));
    }
    parser.expression(Level::Whole)?;
    match parser.peek() {
        Kind::End => Ok(parser.tape),
        Kind::Symbol(")") => Err(ExpressionError::new(
            parser.span(),
            "a `)` that closes nothing",
            "leave it out, or open it with `(`",
        )),
        _ => Err(parser.stray_comma()),
    }
}

struct Parser<'a> {
    source: &'a str,
    names: &'a [&'a str],
    tokens: Vec<Token<'a>>,
    next: usize,
    nested: usize,
    tape: Tape,
}

impl<'a> Parser<'a> {
    fn peek(&self) -> Kind<'a> {
        self.tokens[self.next].kind
    }

    /// Bytes of the next token.
    fn span(&self) -> Range<usize> {
        self.tokens[self.next].span.clone()
    }

    /// Goes past the next token, unless it is the end.
    fn advance(&mut self) -> Token<'a> {
        let token = self.tokens[self.next].clone();
        self.next = (self.next + 1).min(self.tokens.len() - 1);
        token
    }

    /// An operand and all operators after it that bind tighter than `outer`. What follows is another operator, a comma, a closing
    /// parenthesis or the end.
    fn expression(&mut self, outer: Level) -> Parsed {
        if self.nested > MOST_NESTED {
            return Err(ExpressionError::new(
                self.span(),
                format!("nested more than {MOST_NESTED} deep"),
                "leave out parentheses and signs that change nothing",
            ));
        }
        self.nested += 1;
        self.operand(outer)?;
        while let Some((binary, level)) = infix(self.peek())
            && level > outer
        {
            self.advance();
            // Powers go to the right: what follows may be one, or have a sign.
            let right = if level == Level::Power {
                Level::Sign
            } else {
                level
            };
            self.expression(right)?;
            self.tape.binary(binary);
            if level == Level::Comparison {
                self.refuse_chain()?;
            }
        }
        self.nested -= 1;
        self.refuse_neighbour()
    }

    fn operand(&mut self, outer: Level) -> Parsed {
        let token = self.advance();
        match token.kind {
            Kind::Number(value) => self.constant(value, token.span),
            Kind::Name(name) => self.name(name, token.span),
            Kind::Quoted(name) => match self.variable_named(name) {
                Some(variable) => self.variable(variable, token.span),
                None => Err(ExpressionError::new(
                    token.span,
                    format!("unknown name `{name}`"),
                    suggest(name, self.names.iter().copied()),
                )),
            },
            Kind::Symbol("(") => {
                self.expression(Level::Whole)?;
                self.close(token.span)
            }
            Kind::Symbol("+") => self.expression(Level::Sign),
            Kind::Symbol("-") => {
                self.expression(Level::Sign)?;
                self.tape.unary(Unary::Negate);
                Ok(())
            }
            Kind::Symbol("not") if outer > Level::Not => Err(ExpressionError::new(
                token.span,
                "`not` after an operator that binds tighter",
                "put it in parentheses: `1 - (not x)`",
            )),
            Kind::Symbol("not") => {
                self.expression(Level::Not)?;
                self.tape.unary(Unary::Not);
                Ok(())
            }
            Kind::Symbol(symbol) => {
                let powers = symbol == "*" && self.source[..token.span.start].ends_with('*');
                Err(ExpressionError::new(
                    token.span,
                    format!("`{symbol}` where a value should be"),
                    if powers {
                        "write `^` for a power"
                    } else {
                        "write a number, a name, a function or `(` before it"
                    },
                ))
            }
            Kind::End => Err(ExpressionError::new(
                token.span,
                "the expression ends where a value should be",
                "write a number, a name, a function or `(`",
            )),
        }
    }
}

impl Parser<'_> {
    fn name(&mut self, name: &str, span: Range<usize>) -> Parsed {
        let function = FUNCTIONS.iter().find(|(known, ..)| *known == name);
        let called = self.peek() == Kind::Symbol("(");
        if let Some(function) = function
            && called
        {
            return self.call(function, span);
        }
        if let Some(variable) = self.variable_named(name) {
            return self.variable(variable, span);
        }
        if let Some((_, value)) = CONSTANTS.iter().find(|(known, _)| *known == name) {
            return self.constant(*value, span);
        }
        let (what, hint) = match function {
            Some((_, arguments, _)) => (
                format!("the function `{name}` without arguments"),
                format!("write `{name}({arguments})`"),
            ),
            None if called => (format!("unknown function `{name}`"), meant(name)),
            None => {
                let constants = CONSTANTS.iter().map(|(known, _)| *known);
                (
                    format!("unknown name `{name}`"),
                    suggest(name, self.names.iter().copied().chain(constants)),
                )
            }
        };
        Err(ExpressionError::new(span, what, hint))
    }

    /// What follows the name of a function.
    fn call(&mut self, (name, arguments, call): &Function, span: Range<usize>) -> Parsed {
        let open = self.advance().span;
        let mut count = 0;
        if self.peek() != Kind::Symbol(")") {
            loop {
                self.expression(Level::Whole)?;
                count += 1;
                call.take(count, &mut self.tape);
                if self.peek() != Kind::Symbol(",") {
                    break;
                }
                self.advance();
            }
        }
        let end = self.span().end;
        self.close(open)?;
        let (few, takes) = call.takes();
        if count == few || count > few && matches!(call, Call::Many(_)) {
            return Ok(());
        }
        Err(ExpressionError::new(
            span.start..end,
            format!("`{name}` takes {takes}, not {count}"),
            format!("write `{name}({arguments})`"),
        ))
    }

    fn close(&mut self, open: Range<usize>) -> Parsed {
        match self.peek() {
            Kind::Symbol(")") => {
                self.advance();
                Ok(())
            }
            Kind::End => Err(ExpressionError::new(
                open,
                "a `(` that is not closed",
                "close it with `)`",
            )),
            _ => Err(self.stray_comma()),
        }
    }

    fn stray_comma(&self) -> ExpressionError {
        ExpressionError::new(
            self.span(),
            "a `,` that separates no arguments",
            "decimals are written with a point: `0.5`",
        )
    }

    fn variable_named(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|known| *known == name)
    }

    fn constant(&mut self, value: f64, span: Range<usize>) -> Parsed {
        self.refuse_overflow(span)?;
        self.tape.constant(value);
        Ok(())
    }

    fn variable(&mut self, variable: usize, span: Range<usize>) -> Parsed {
        self.refuse_overflow(span)?;
        self.tape.variable(variable);
        Ok(())
    }

    fn refuse_overflow(&self, span: Range<usize>) -> Parsed {
        if !self.tape.is_full() {
            return Ok(());
        }
        Err(ExpressionError::new(
            span,
            format!("more than {MOST_HELD} values that wait for each other"),
            "begin with what is nested: `(b + c) + a` for `a + (b + c)`",
        ))
    }

    /// `a < b < c` would compare 0 or 1 with `c`.
    fn refuse_chain(&self) -> Parsed {
        match infix(self.peek()) {
            Some((_, Level::Comparison)) => Err(ExpressionError::new(
                self.span(),
                "a second comparison in a row",
                "compare two at a time: `a < b and b < c`",
            )),
            _ => Ok(()),
        }
    }

    /// `2x` and `(a)(b)` lack an operator.
    fn refuse_neighbour(&self) -> Parsed {
        match self.peek() {
            Kind::End => return Ok(()),
            Kind::Symbol(symbol) if symbol != "(" && symbol != "not" => return Ok(()),
            _ => {}
        }
        let text = |index: usize| &self.source[self.tokens[index].span.clone()];
        let (left, right) = (text(self.next - 1), text(self.next));
        Err(ExpressionError::new(
            self.span(),
            format!("no operator between `{left}` and `{right}`"),
            match self.peek() {
                Kind::Symbol("not") => "write `and not`, or `!=`".to_owned(),
                _ => format!("to multiply, write `{left}*{right}`"),
            },
        ))
    }
}

/// The binary operation of a symbol, and how tightly it binds.
fn infix(kind: Kind<'_>) -> Option<(Binary, Level)> {
    let Kind::Symbol(symbol) = kind else {
        return None;
    };
    Some(match symbol {
        "or" => (Binary::Or, Level::Or),
        "and" => (Binary::And, Level::And),
        "<" => (Binary::Less, Level::Comparison),
        "<=" => (Binary::AtMost, Level::Comparison),
        ">" => (Binary::More, Level::Comparison),
        ">=" => (Binary::AtLeast, Level::Comparison),
        "==" => (Binary::Equal, Level::Comparison),
        "!=" => (Binary::Unequal, Level::Comparison),
        "+" => (Binary::Add, Level::Sum),
        "-" => (Binary::Subtract, Level::Sum),
        "*" => (Binary::Multiply, Level::Product),
        "/" => (Binary::Divide, Level::Product),
        "%" => (Binary::Remainder, Level::Product),
        "^" => (Binary::Power, Level::Power),
        _ => return None,
    })
}
