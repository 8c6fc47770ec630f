//! Tables as CSV.

use super::super::finding::{Finding, Table};

/// File name and text (RFC 4180, heads first) of each table of a finding: `table-4.1.csv`, or `table-4.1-1.csv` and so on where
/// there are several.
pub fn tables_csv(finding: &Finding) -> Vec<(String, String)> {
    let names = numbered(&finding.id, finding.tables.len(), "csv");
    names.zip(finding.tables.iter().map(csv)).collect()
}

/// Names of so many files of one kind.
pub fn numbered(id: &str, count: usize, extension: &str) -> impl Iterator<Item = String> {
    (1..=count).map(move |number| match count {
        1 => format!("{id}.{extension}"),
        _ => format!("{id}-{number}.{extension}"),
    })
}

fn csv(table: &Table) -> String {
    let mut writer = csv::WriterBuilder::new()
        .flexible(true)
        .from_writer(Vec::new());
    for row in std::iter::once(&table.columns).chain(&table.rows) {
        // Writing to memory cannot fail.
        let _ = writer.write_record(row);
    }
    let bytes = writer.into_inner().unwrap_or_default();
    String::from_utf8(bytes).unwrap_or_default()
}
