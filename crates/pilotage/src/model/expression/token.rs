//! The words of an expression.

use std::ops::Range;

use super::ExpressionError;

/// A word and the bytes of the source it covers.
#[derive(Debug, Clone)]
pub(super) struct Token<'a> {
    pub(super) kind: Kind<'a>,
    pub(super) span: Range<usize>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Kind<'a> {
    Number(f64),
    /// A name as it stands.
    Name(&'a str),
    /// A name in backticks.
    Quoted(&'a str),
    /// An operator, a parenthesis or a comma.
    Symbol(&'static str),
    /// The end of the source.
    End,
}

/// Signs; one that begins like another comes before it.
const SIGNS: [&str; 15] = [
    "<=", ">=", "==", "!=", "<", ">", "+", "-", "*", "/", "%", "^", "(", ")", ",",
];

/// Operators that look like names.
const WORDS: [&str; 3] = ["and", "or", "not"];

/// The words of a source, and its end.
pub(super) fn tokens(source: &str) -> Result<Vec<Token<'_>>, ExpressionError> {
    let mut tokens = Vec::new();
    let mut rest = source.trim_start();
    while let Some(first) = rest.chars().next() {
        let start = source.len() - rest.len();
        let (kind, length) = match first {
            '0'..='9' | '.' => number(rest, start)?,
            'a'..='z' | 'A'..='Z' | '_' => name(rest),
            '`' => quoted(rest, start)?,
            _ => sign(rest).ok_or_else(|| unexpected(first, start))?,
        };
        tokens.push(Token {
            kind,
            span: start..start + length,
        });
        rest = rest[length..].trim_start();
    }
    tokens.push(Token {
        kind: Kind::End,
        span: source.len()..source.len(),
    });
    Ok(tokens)
}

fn digits(text: &str) -> usize {
    text.bytes().take_while(u8::is_ascii_digit).count()
}

fn number(text: &str, start: usize) -> Result<(Kind<'_>, usize), ExpressionError> {
    let mut length = digits(text);
    if text[length..].starts_with('.') {
        length += 1 + digits(&text[length + 1..]);
    }
    if let Some(exponent) = text[length..].strip_prefix(['e', 'E']) {
        let power = exponent.strip_prefix(['+', '-']).unwrap_or(exponent);
        // Without digits it is the beginning of a name.
        if digits(power) > 0 {
            length += 1 + (exponent.len() - power.len()) + digits(power);
        }
    }
    match text[..length].parse::<f64>() {
        Ok(value) if value.is_finite() => Ok((Kind::Number(value), length)),
        Ok(_) => Err(ExpressionError::new(
            start..start + length,
            "a number that is too large",
            "the largest is about 1.8e308; `inf` is infinity",
        )),
        Err(_) => Err(unexpected('.', start)),
    }
}

fn name(text: &str) -> (Kind<'_>, usize) {
    let is_part = |byte: &u8| byte.is_ascii_alphanumeric() || *byte == b'_';
    let length = text.bytes().take_while(is_part).count();
    let name = &text[..length];
    let word = WORDS.into_iter().find(|word| *word == name);
    (word.map_or(Kind::Name(name), Kind::Symbol), length)
}

fn quoted(text: &str, start: usize) -> Result<(Kind<'_>, usize), ExpressionError> {
    match text[1..].find('`') {
        Some(length) => Ok((Kind::Quoted(&text[1..=length]), length + 2)),
        None => Err(ExpressionError::new(
            start..start + text.len(),
            "a name in backticks that does not end",
            "close it with another backtick",
        )),
    }
}

fn sign(text: &str) -> Option<(Kind<'_>, usize)> {
    let sign = SIGNS.into_iter().find(|sign| text.starts_with(sign))?;
    Some((Kind::Symbol(sign), sign.len()))
}

fn unexpected(character: char, start: usize) -> ExpressionError {
    let hint = match character {
        '=' => "write `==` to compare",
        '!' => "write `not`, and `!=` for what differs",
        '&' => "write `and`",
        '|' => "write `or`, and `abs(x)` for what x is without its sign",
        '[' | ']' | '{' | '}' => "group with `(` and `)`",
        '.' => "a number has a digit beside its point",
        other if other.is_alphanumeric() => {
            "put a name that has other letters than a to z in backticks"
        }
        _ => "write numbers, names, operators and functions, such as `abs(x - 5)/2`",
    };
    ExpressionError::new(
        start..start + character.len_utf8(),
        format!("unexpected character `{}`", character.escape_debug()),
        hint,
    )
}
