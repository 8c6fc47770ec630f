//! Inputs that are nearly right: real files, changed a little where it hurts.

use pilotage::random::{Rng, Role, stream, uniform};

/// What is written in the place of a number.
const NUMBERS: &[&str] = &[
    "0",
    "-0.0",
    "1",
    "-1",
    "2",
    "3",
    "7",
    "1e-320",
    "5e-324",
    "-1e-300",
    "0.1",
    "0.5",
    "0.999999",
    "1e3",
    "1e9",
    "1e17",
    "1e50",
    "-1e50",
    "1e150",
    "1e154",
    "-1e155",
    "1e200",
    "1e300",
    "1.7e308",
    "-1.7e308",
    "1e309",
    "1e999",
    "nan",
    "inf",
    "-inf",
    "null",
    "100000",
    "1000000",
    "2147483647",
    "4294967295",
    "4294967296",
    "9007199254740993",
    "9223372036854775807",
    "-9223372036854775808",
    "18446744073709551615",
    "18446744073709551616",
    "1e99999999",
    "0x7fffffffffffffff",
    "true",
    "\"x\"",
    "[]",
    "{}",
    "[1.0]",
    "1979-05-27",
];

/// What is written anywhere.
const PIECES: &[&str] = &[
    "",
    "[",
    "]",
    "{",
    "}",
    ",",
    "=",
    ":",
    "\"",
    "'''",
    "\n",
    "#",
    "\\",
    "\u{1b}[31m",
    "\u{0}",
    "\u{202e}",
    "\r\n",
    "é",
    "[[",
    "]]",
    "[start]\n",
    "[world]\n",
    "[[reward]]\n",
    "null",
    "nan",
    "inf",
    "-",
    ".",
    "e",
    "+",
    "|",
    "*",
    "kind = \"robot\"\n",
    "kind = \"cart-pole\"\n",
    "walls = \"clip\"\n",
    "hypotheses = \"track\"\n",
];

/// The input of a number: the same for the same corpus, seed and number.
pub fn input(corpus: &[Vec<u8>], seed: u64, number: u64) -> Vec<u8> {
    let mut rng = stream(seed, number, Role::Planner);
    let mut bytes = corpus[below(&mut rng, corpus.len())].clone();
    for _ in 0..1 + below(&mut rng, 4) {
        change(&mut bytes, corpus, &mut rng);
        if bytes.is_empty() {
            break;
        }
    }
    bytes
}

/// A whole number from 0 up to, not including, `end`, which is at least 1.
fn below(rng: &mut Rng, end: usize) -> usize {
    ((uniform(rng) * end as f64) as usize).min(end - 1)
}

fn change(bytes: &mut Vec<u8>, corpus: &[Vec<u8>], rng: &mut Rng) {
    let at = below(rng, bytes.len());
    match below(rng, 32) {
        // Numbers, most of all.
        0..=13 => {
            let numbers = numbers(bytes);
            if !numbers.is_empty() {
                let (from, to) = numbers[below(rng, numbers.len())];
                let new = NUMBERS[below(rng, NUMBERS.len())].as_bytes();
                bytes.splice(from..to, new.iter().copied());
            }
        }
        14..=15 => bytes[at] ^= 1 << below(rng, 8),
        16 => bytes[at] = below(rng, 256) as u8,
        17..=18 => {
            let piece = PIECES[below(rng, PIECES.len())].as_bytes();
            bytes.splice(at..at, piece.iter().copied());
        }
        19 => bytes.truncate(at),
        // Entries and lines dropped, doubled and swapped.
        20..=22 => {
            let (from, to) = entry(bytes, at);
            bytes.drain(from..to);
        }
        23..=24 => {
            let (from, to) = entry(bytes, at);
            let copy = bytes[from..to].to_vec();
            bytes.splice(to..to, copy);
        }
        25 => {
            let (from, to) = entry(bytes, at);
            let copy = bytes[from..to].to_vec();
            bytes.drain(from..to);
            let at = below(rng, bytes.len() + 1);
            bytes.splice(at..at, copy);
        }
        26 => {
            let line = |at: usize| {
                let from = bytes[..at]
                    .iter()
                    .rposition(|b| *b == b'\n')
                    .map_or(0, |at| at + 1);
                let to = bytes[at..].iter().position(|b| *b == b'\n');
                (from, to.map_or(bytes.len(), |to| at + to + 1))
            };
            let (from, to) = line(at);
            bytes.drain(from..to);
        }
        // A part of another file.
        27..=28 => {
            let other = &corpus[below(rng, corpus.len())];
            let (from, to) = entry(other, below(rng, other.len()));
            bytes.splice(at..at, other[from..to].iter().copied());
        }
        // Nests and heaps.
        29 => {
            let depth = 1 << below(rng, 16);
            let pair = [("[", "]"), ("{\"a\":", "}"), ("{ a = ", "}")][below(rng, 3)];
            let closing = pair.1.repeat(if uniform(rng) < 0.5 { depth } else { 0 });
            bytes.splice(at..at, (pair.0.repeat(depth) + &closing).into_bytes());
        }
        30 => {
            let numbers = numbers(bytes);
            if !numbers.is_empty() {
                let (from, to) = numbers[below(rng, numbers.len())];
                let item = String::from_utf8_lossy(&bytes[from..to]).into_owned();
                let heap = vec![item; 1 << below(rng, 13)].join(", ");
                let heap = if uniform(rng) < 0.5 {
                    format!("[{heap}]")
                } else {
                    heap
                };
                bytes.splice(from..to, heap.into_bytes());
            }
        }
        _ => {
            let (from, to) = entry(bytes, at);
            let copies = bytes[from..to].repeat(1 + below(rng, 200));
            bytes.splice(to..to, copies);
        }
    }
}

/// Where numbers stand: runs of characters that numbers are made of, beginning with a digit, a sign or a point.
pub fn numbers(bytes: &[u8]) -> Vec<(usize, usize)> {
    let part = |byte: u8| byte.is_ascii_digit() || b"+-.eE_".contains(&byte);
    let mut found = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        let first = at == 0 || !(bytes[at - 1].is_ascii_alphanumeric() || bytes[at - 1] == b'_');
        if first
            && (bytes[at].is_ascii_digit()
                || (bytes[at] == b'-' && bytes.get(at + 1).is_some_and(u8::is_ascii_digit)))
        {
            let length = bytes[at..].iter().position(|byte| !part(*byte));
            let end = length.map_or(bytes.len(), |length| at + length);
            found.push((at, end));
            at = end;
        }
        at += 1;
    }
    found
}

/// The entry around a place: from the comma, bracket or line end before it up to, and with, the next.
fn entry(bytes: &[u8], at: usize) -> (usize, usize) {
    let ends = |byte: &u8| b",[]{}\n".contains(byte);
    let from = bytes[..at].iter().rposition(ends).map_or(0, |at| at + 1);
    let to = bytes[at..].iter().position(ends);
    (from, to.map_or(bytes.len(), |to| at + to + 1))
}
