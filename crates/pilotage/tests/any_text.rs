//! No text makes the reader panic, and every error points into its text.
#![allow(clippy::unwrap_used)]

use pilotage::scenario;
use proptest::prelude::*;

fn read_without_panic(text: &str) {
    if let Err(error) = scenario::read(text, "any.toml") {
        let place = error.place.clone().unwrap();
        assert!(
            text.get(place.span.clone()).is_some(),
            "{error} at {:?}",
            place.span
        );
        assert!(place.line <= text.matches('\n').count() + 1, "{error}");
        assert!(
            !error.message.is_empty() && !error.hint.is_empty(),
            "{error}"
        );
    }
}

#[test]
fn deep_nesting() {
    read_without_panic(&format!("name = {}", "[".repeat(100_000)));
    read_without_panic(&"[a.".repeat(100_000));
    read_without_panic(&format!("format = 1\n{} = 1", "a.".repeat(100_000)));
}

fn built_in() -> impl Strategy<Value = &'static str> {
    let texts: Vec<&str> = scenario::names().filter_map(scenario::builtin).collect();
    proptest::sample::select(texts)
}

/// Pieces that a hand might put into a file by mistake.
fn piece() -> impl Strategy<Value = String> {
    let pieces = [
        "",
        "0",
        "-1",
        "1e308",
        "1e999",
        "nan",
        "inf",
        "-inf",
        "[]",
        "[[]]",
        "{}",
        "\"\"",
        "'''",
        "#",
        "+",
        "|",
        "*",
        "=",
        ".",
        "\n",
        "true",
        "1979-05-27",
        "[start]",
        "[[start]]",
        "[map]",
        "[world]",
        "é",
        "\u{feff}",
        "9223372036854775807",
        "1e-320",
    ];
    prop_oneof![
        proptest::sample::select(pieces.map(str::to_owned).to_vec()),
        "\\PC{0,8}"
    ]
}

/// Cuts a stretch of the text out and puts a piece in.
fn edit(text: &str, from: usize, length: usize, piece: &str) -> String {
    let characters: Vec<char> = text.chars().collect();
    let from = from % (characters.len() + 1);
    let to = (from + length).min(characters.len());
    characters[..from]
        .iter()
        .chain(piece.chars().collect::<Vec<_>>().iter())
        .chain(&characters[to..])
        .collect()
}

/// Replaces one of the numbers of the text.
fn replace_number(text: &str, which: usize, piece: &str) -> String {
    let words: Vec<&str> = text.split_inclusive([' ', '[', ']', ',', '\n']).collect();
    let numbers: Vec<usize> = (0..words.len())
        .filter(|&i| words[i].starts_with(|c: char| c.is_ascii_digit() || c == '-'))
        .collect();
    let chosen = numbers[which % numbers.len()];
    let last = words[chosen].chars().last().unwrap();
    let replaced = format!("{piece}{last}");
    words
        .iter()
        .enumerate()
        .map(|(i, &word)| if i == chosen { replaced.as_str() } else { word })
        .collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn bytes_as_text(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
        read_without_panic(&String::from_utf8_lossy(&bytes));
    }

    #[test]
    fn good_files_with_mistakes(
        text in built_in(),
        edits in proptest::collection::vec((any::<usize>(), 0usize..40, piece()), 1..4),
    ) {
        let text = edits.iter().fold(text.to_owned(), |text, (from, length, piece)| edit(&text, *from, *length, piece));
        read_without_panic(&text);
    }

    #[test]
    fn good_files_with_other_numbers(text in built_in(), which in any::<usize>(), piece in piece()) {
        read_without_panic(&replace_number(text, which, &piece));
    }

    #[test]
    fn good_files_with_other_drawings(drawing in "[-+| #.a*]{0,9}(\n[-+| #.a*]{0,9}){0,6}") {
        let text = scenario::builtin("maze-2d").unwrap();
        read_without_panic(&text.replace("....\n....\n....\n...*\n", &drawing));
    }

    #[test]
    fn good_files_with_lines_gone(text in built_in(), gone in proptest::collection::vec(any::<usize>(), 1..4)) {
        let mut lines: Vec<&str> = text.lines().collect();
        for line in gone {
            if !lines.is_empty() {
                lines.remove(line % lines.len());
            }
        }
        read_without_panic(&lines.join("\n"));
    }
}
