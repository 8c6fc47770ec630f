//! What a report shows, and that no text in it is taken for anything but text.

use html5gum::{DefaultEmitter, Token, Tokenizer};
use proptest::prelude::*;

use super::super::finding::*;
use super::*;

/// A report of every kind of thing, with one text in all places where a text can be.
fn report(text: &str) -> Report {
    let own = |_| text.to_owned();
    let finding = |verdict| Finding {
        id: format!("table-{}", verdict as u8),
        title: own(()),
        thesis: own(()),
        tables: vec![Table {
            caption: own(()),
            columns: vec![own(()), own(())],
            rows: vec![vec![own(()), "1.5".to_owned()]],
        }],
        figures: vec![Figure {
            caption: own(()),
            svg: own(()),
        }],
        verdict,
        why: own(()),
    };
    Report {
        version: own(()),
        seed: 7,
        quick: false,
        recordings: vec![recording(text)],
        algorithms: vec![Algorithm {
            name: own(()),
            needs: own(()),
            gives: own(()),
            choose: own(()),
            gap: own(()),
        }],
        findings: Verdict::ALL.map(finding).to_vec(),
    }
}

fn recording(text: &str) -> Recording {
    let hypothesis = Hypothesis {
        weight: 1.0,
        mode: text.to_owned(),
        mean: vec![0.5],
        covariance: vec![0.1],
    };
    let frame = Frame {
        state: vec![0.5],
        mode: "m".to_owned(),
        hypotheses: vec![hypothesis],
        valid: 0,
        node: 0,
        action: text.to_owned(),
        reward: 1.0,
    };
    Recording {
        id: "corridor-blind".to_owned(),
        title: text.to_owned(),
        about: text.to_owned(),
        states: vec![text.to_owned()],
        bounds: vec![(0.0, 1.0)],
        places: vec![(vec![0.0], vec![1.0], text.to_owned())],
        blocked: Vec::new(),
        walls: Vec::new(),
        nodes: vec![text.to_owned()],
        frames: vec![frame],
    }
}

/// What a browser's tokenizer makes of a page, with scripts and styles read as such.
fn tokens(page: &str) -> impl Iterator<Item = Token> {
    let mut emitter = DefaultEmitter::default();
    emitter.naively_switch_states(true);
    Tokenizer::new_with_emitter(page, emitter).map(|Ok(token)| token)
}

/// Tags with the names of their attributes, in order, as a browser's tokenizer sees them; and the text of the page.
fn structure(page: &str) -> (Vec<String>, String) {
    let mut tags = Vec::new();
    let mut text = String::new();
    for token in tokens(page) {
        match token {
            Token::StartTag(tag) => {
                let names = tag.attributes.keys();
                let names: Vec<_> = names.map(|name| String::from_utf8_lossy(name)).collect();
                let tag = String::from_utf8_lossy(&tag.name);
                tags.push(format!("<{tag} {}>", names.join(" ")));
            }
            Token::EndTag(tag) => {
                tags.push(format!("</{}>", String::from_utf8_lossy(&tag.name)));
            }
            Token::String(found) => text += &String::from_utf8_lossy(&found),
            Token::Comment(_) => tags.push("<!--".to_owned()),
            Token::Doctype(_) | Token::Error(_) => {}
        }
    }
    (tags, text)
}

/// Texts made of what markup is made of.
fn hostile() -> impl Strategy<Value = String> {
    let piece = prop_oneof![
        Just("</script>"),
        Just("<script>"),
        Just("<!--"),
        Just("-->"),
        Just("]]>"),
        Just("\""),
        Just("'"),
        Just("<"),
        Just(">"),
        Just("&"),
        Just("&lt;"),
        Just("</"),
        Just("<img src=x onerror=y>"),
        Just("\\"),
        Just("|"),
        Just("`"),
        Just("\n"),
        Just("="),
        Just(" "),
        Just("a"),
        Just("é"),
    ];
    prop::collection::vec(piece, 1..12).prop_map(|pieces| pieces.concat())
}

proptest! {
    #[test]
    fn no_text_breaks_out_of_the_page(text in hostile()) {
        let page = page_html(&report(&text));
        let (tags, shown) = structure(&page);
        prop_assert_eq!(&tags, &structure(&page_html(&report("a"))).0);
        // It stands there as it was given: as title, and in the recording.
        prop_assert!(shown.contains(&text));
        let (_, data) = page.split_once("<script type=\"application/json\">").expect("a recording");
        let (data, _) = data.split_once("</script>").expect("its end");
        let read: Recording = serde_json::from_str(data).expect("JSON");
        prop_assert_eq!(read, recording(&text));
    }

    #[test]
    fn tables_come_back_from_csv(text in hostile()) {
        for finding in &report(&text).findings {
            let files = tables_csv(finding);
            prop_assert_eq!(files.len(), 1);
            prop_assert_eq!(&files[0].0, &format!("{}.csv", finding.id));
            let mut reader = csv::Reader::from_reader(files[0].1.as_bytes());
            let head: Vec<&str> = reader.headers().expect("heads").iter().collect();
            prop_assert_eq!(head, vec![&*text; 2]);
            let rows: Vec<csv::StringRecord> = reader.records().collect::<Result<_, _>>().expect("rows");
            prop_assert_eq!(rows.len(), 1);
            prop_assert_eq!(rows[0].iter().collect::<Vec<_>>(), vec![&*text, "1.5"]);
        }
    }

    #[test]
    fn a_table_in_markdown_keeps_its_columns(text in hostile()) {
        let (markdown, _) = page_markdown(&report(&text), "figures");
        let bars = |line: &str| {
            let mut escaped = false;
            let bare = |c: char| {
                let counts = c == '|' && !escaped;
                escaped = c == '\\' && !escaped;
                counts
            };
            line.chars().filter(|&c| c != '\n').map(bare).filter(|&counts| counts).count()
        };
        for line in markdown.lines().filter(|line| line.starts_with('|')) {
            prop_assert!([3, 6].contains(&bars(line)), "{}", line);
        }
    }
}

#[test]
fn every_finding_is_linked_and_there() {
    let report = report("a text");
    let page = page_html(&report);
    let (markdown, figures) = page_markdown(&report, "figures");
    for finding in &report.findings {
        assert!(page.contains(&format!("href=\"#finding-{}\"", finding.id)));
        assert_eq!(
            page.matches(&format!("id=\"finding-{}\"", finding.id))
                .count(),
            1
        );
        assert!(markdown.contains(&format!("(#{})", finding.id)));
        assert!(markdown.contains(&format!("<a id=\"{}\"></a>", finding.id)));
    }
    for (name, svg) in &figures {
        assert!(markdown.contains(&format!("](<figures/{name}>)")));
        assert_eq!(svg, "a text");
    }
    assert_eq!(figures.len(), report.findings.len());
}

#[test]
fn nothing_on_the_page_is_elsewhere() {
    let page = page_html(&report("a text"));
    for token in tokens(&page) {
        let Token::StartTag(tag) = token else {
            continue;
        };
        for (name, value) in &tag.attributes {
            let value = String::from_utf8_lossy(value);
            match name.as_slice() {
                b"href" | b"src" => assert!(value.starts_with(['#']) || value.starts_with("data:")),
                b"style" | b"srcset" | b"action" => panic!("{value}"),
                _ => {}
            }
        }
    }
    assert!(!page.contains("@import") && !page.contains("url("));
}

#[test]
fn several_tables_have_a_number_each() {
    let mut finding = report("a").findings[0].clone();
    finding.tables.push(finding.tables[0].clone());
    let names: Vec<String> = tables_csv(&finding)
        .into_iter()
        .map(|file| file.0)
        .collect();
    assert_eq!(names, ["table-0-1.csv", "table-0-2.csv"]);
    finding.tables.clear();
    assert!(tables_csv(&finding).is_empty());
}

#[test]
fn an_empty_report_is_a_page_too() {
    let empty = Report {
        recordings: Vec::new(),
        algorithms: Vec::new(),
        findings: Vec::new(),
        ..report("a")
    };
    assert!(page_html(&empty).contains("What came out"));
    let framed = Recording {
        frames: Vec::new(),
        ..recording("a")
    };
    let without_frames = Report {
        recordings: vec![framed],
        ..empty
    };
    assert!(!page_html(&without_frames).contains("<article"));
}

#[test]
fn a_small_report_in_markdown() {
    let mut report = report("3 < 4 | *not* `markup`, $x_1$ & more");
    report.version = "1.2.3".to_owned();
    report.findings.truncate(2);
    insta::assert_snapshot!(page_markdown(&report, "figures").0);
}
