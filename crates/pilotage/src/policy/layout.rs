//! JSON laid out for people: what fits on a line stands on a line.

/// Longest line.
const WIDTH: usize = 120;
/// Longest item of a list that shares its line with others.
const SHORT: usize = 32;

/// The same JSON with line breaks and blanks between its tokens, and a line break at the end. `compact` is JSON without white space
/// between tokens.
pub(super) fn lay_out(compact: &str) -> String {
    let mut text = String::with_capacity(2 * compact.len());
    value(compact, 0, 0, &mut text);
    text.push('\n');
    text
}

/// Lays out a value whose line is indented by `indent` blanks and already has `used` characters.
fn value(compact: &str, indent: usize, used: usize, text: &mut String) {
    let short = compact.len() <= WIDTH.saturating_sub(used);
    let line = short.then(|| inline(compact));
    if let Some(line) = line.filter(|line| used + line.len() <= WIDTH) {
        text.push_str(&line);
        return;
    }
    let ends = ['[', '{'].iter().find(|open| compact.starts_with(**open));
    let (Some(open), [_, inside @ .., _]) = (ends, compact.as_bytes()) else {
        text.push_str(compact);
        return;
    };
    let inside = &compact[1..=inside.len()];
    let inner = indent + 2;
    text.push(*open);
    let short = |item: &str| item.len() <= SHORT && !item.contains(['{', '"']);
    if *open == '[' && items(inside).all(short) {
        fill(items(inside).map(inline), inner, text);
    } else {
        for (i, item) in items(inside).enumerate() {
            if i > 0 {
                text.push(',');
            }
            break_line(inner, text);
            let (key, item) = match *open {
                '{' => item.split_at(end_of_string(item) + 1),
                _ => ("", item),
            };
            text.push_str(key);
            if !key.is_empty() {
                text.push(' ');
            }
            value(item, inner, inner + key.len() + 2, text);
        }
    }
    break_line(indent, text);
    text.push(if *open == '{' { '}' } else { ']' });
}

/// Items, as many as fit on every line.
fn fill(items: impl Iterator<Item = String>, indent: usize, text: &mut String) {
    let mut used = WIDTH;
    for (i, item) in items.enumerate() {
        if i > 0 {
            text.push(',');
        }
        if used + 2 + item.len() > WIDTH {
            break_line(indent, text);
            used = indent;
        } else {
            text.push(' ');
            used += 2;
        }
        text.push_str(&item);
        used += item.len();
    }
}

fn break_line(indent: usize, text: &mut String) {
    text.push('\n');
    text.extend(std::iter::repeat_n(' ', indent));
}

/// On one line, with a blank after every comma and colon.
fn inline(compact: &str) -> String {
    let mut text = String::with_capacity(2 * compact.len());
    let mut quoted = Quoted::default();
    for c in compact.chars() {
        text.push(c);
        if !quoted.after(c) && matches!(c, ',' | ':') {
            text.push(' ');
        }
    }
    text
}

/// The items of a list, or of a table with their keys.
fn items(inside: &str) -> impl Iterator<Item = &str> {
    let mut quoted = Quoted::default();
    let mut depth = 0_usize;
    inside.split(move |c| {
        if quoted.after(c) {
            return false;
        }
        match c {
            '[' | '{' => depth += 1,
            ']' | '}' => depth -= 1,
            _ => {}
        }
        c == ',' && depth == 0
    })
}

/// The byte after the text in quotes that a key is.
fn end_of_string(item: &str) -> usize {
    let mut quoted = Quoted::default();
    let mut ends = item.char_indices().skip(1);
    quoted.after('"');
    let end = ends.find(|&(_, c)| !quoted.after(c));
    end.map_or(item.len(), |(end, _)| end)
}

/// Follows JSON character by character, and knows whether it is inside a text in quotes.
#[derive(Default)]
pub(super) struct Quoted {
    inside: bool,
    escaped: bool,
}

impl Quoted {
    /// Whether a character belongs to a text in quotes; the quotes do, too.
    pub(super) fn after(&mut self, c: char) -> bool {
        let was_inside = self.inside;
        if self.escaped {
            self.escaped = false;
        } else if c == '"' {
            self.inside = !self.inside;
        } else {
            self.escaped = self.inside && c == '\\';
        }
        was_inside || self.inside
    }
}

#[cfg(test)]
mod tests {
    use super::{WIDTH, lay_out};

    #[test]
    fn what_fits_stands_on_a_line_and_what_does_not_is_broken() {
        for (compact, expected) in [
            ("{}", "{}\n"),
            (
                r#"{"a":[1.5,-2],"b":"x,y:\"]"}"#,
                "{\"a\": [1.5, -2], \"b\": \"x,y:\\\"]\"}\n",
            ),
        ] {
            assert_eq!(lay_out(compact), expected);
        }
        let long = "x".repeat(WIDTH);
        let broken = format!("{{\n  \"a\": 1,\n  \"b,\": [\n    \"{long}\"\n  ]\n}}\n");
        assert_eq!(lay_out(&format!("{{\"a\":1,\"b,\":[\"{long}\"]}}")), broken);
    }

    #[test]
    fn short_items_fill_their_lines() {
        let pairs = vec!["[0,1.25]"; 40].join(",");
        let text = lay_out(&format!("[{pairs}]"));
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!((lines[0], lines[lines.len() - 1]), ("[", "]"));
        assert!(lines.iter().all(|line| line.len() <= WIDTH));
        assert!(lines[1].len() > WIDTH - 12, "{text}");
        assert_eq!(text.replace([' ', '\n'], ""), format!("[{pairs}]"));
    }
}
