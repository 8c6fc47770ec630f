//! From a [`Path`](crate::model::Path) to the bytes of a text where it stands.

use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::model::{Fault, Step};

/// The bytes of `text` that a fault is about; those of the nearest table or list around it when it is not written there.
pub(super) fn locate(text: &str, fault: &Fault) -> Range<usize> {
    let Ok(root) = DeTable::parse(text) else {
        return 0..0;
    };
    let Some((Step::Key(first), mut steps)) = fault.path.steps().split_first() else {
        return 0..0;
    };
    let Some((mut key, mut value)) = entry(root.get_ref(), first) else {
        return 0..0;
    };
    while let Some((step, rest)) = steps.split_first() {
        match (step, value.get_ref(), rest) {
            (Step::Key(name), DeValue::Table(table), _) => match entry(table, name) {
                Some(inner) => (key, value) = inner,
                None => return value.span(),
            },
            (Step::Index(index), DeValue::Array(list), _) => match list.get(*index) {
                Some(inner) => value = inner,
                None => return value.span(),
            },
            (Step::Index(row), DeValue::String(drawing), [Step::Index(column)]) => {
                return in_drawing(text, value.span(), drawing, *row, *column)
                    .unwrap_or(value.span());
            }
            // A list of one may be written without its brackets.
            (Step::Index(_), ..) => {}
            (Step::Key(_), ..) => return value.span(),
        }
        steps = rest;
    }
    if fault.on_key { key } else { value.span() }
}

fn entry<'a, 'i>(
    table: &'a DeTable<'i>,
    name: &str,
) -> Option<(Range<usize>, &'a Spanned<DeValue<'i>>)> {
    table
        .iter()
        .find(|(key, _)| key.get_ref() == name)
        .map(|(key, value)| (key.span(), value))
}

/// The bytes of one character of a drawing, if it is written verbatim between its quotes.
fn in_drawing(
    text: &str,
    literal: Range<usize>,
    drawing: &str,
    row: usize,
    column: usize,
) -> Option<Range<usize>> {
    let start = literal.start + text.get(literal.clone())?.find(drawing)?;
    let mut rows = drawing.split_inclusive('\n');
    let row_start: usize = rows.by_ref().take(row).map(str::len).sum();
    let (offset, character) = rows.next()?.char_indices().nth(column)?;
    let first = start + row_start + offset;
    Some(first..first + character.len_utf8())
}
