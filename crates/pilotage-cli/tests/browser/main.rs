//! The report's page in a real browser.
//!
//! Needs Chromium, whose path the environment variable `PILOTAGE_CHROMIUM` gives, as `.ci/run` sets it; without it nothing is
//! tested. `PILOTAGE_PAGE` may name the page of a real report, which is then tested as well. With `PILOTAGE_SCREENSHOTS` naming a folder, pictures of the page are left there.
#![allow(clippy::print_stderr)]

mod devtools;

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use devtools::Tab;
use pilotage::progress::Silent;
use pilotage_report::{
    Algorithm, Figure, Finding, Report, Series, Table, Verdict, curves_svg, page_html,
};
use pilotage_thesis::episodes;
use serde_json::{Value, json};

/// All that a page can hold: every verdict, wide tables, wide figures, texts that look like markup, long words.
fn report() -> Report {
    let words = "Words that fill a few lines on a phone and one on a desk, with <b>no</b> </script> markup in them.";
    let algorithm = |name: &str| Algorithm {
        name: name.to_owned(),
        needs: words.to_owned(),
        gives: words.to_owned(),
        choose: words.to_owned(),
        gap: "0.3% +- 0.1%".to_owned(),
    };
    let curve = Series {
        name: "return".to_owned(),
        points: (0..50)
            .map(|x| (f64::from(x), f64::from(x).sqrt()))
            .collect(),
        band: None,
    };
    let finding = |(number, verdict): (usize, Verdict)| Finding {
        id: format!("table-{number}.1"),
        title: format!("Table {number}.1: something measured"),
        thesis: words.to_owned(),
        tables: vec![Table {
            caption: "Many columns".to_owned(),
            columns: (0..14).map(|column| format!("column {column}")).collect(),
            rows: vec![vec!["0.8293 \u{b1} 0.0012".to_owned(); 14]; 3],
        }],
        figures: vec![Figure {
            caption: "A curve".to_owned(),
            svg: curves_svg("A curve", "steps", "return", std::slice::from_ref(&curve))
                .expect("finite points"),
        }],
        verdict,
        why: format!("{words} {}", "long".repeat(40)),
    };
    Report {
        version: "0.0.0".to_owned(),
        seed: 1,
        quick: true,
        recordings: episodes(1, &Silent).expect("built-in models"),
        algorithms: vec![algorithm("one"), algorithm("another")],
        findings: (1..).zip(Verdict::ALL).map(finding).collect(),
    }
}

#[test]
fn the_page_works_in_a_browser() {
    let Some(browser) = std::env::var_os("PILOTAGE_CHROMIUM") else {
        eprintln!("browser test left out: set PILOTAGE_CHROMIUM to the path of Chromium");
        return;
    };
    let mut tab = Tab::open(&PathBuf::from(browser));
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("report.html");
    std::fs::write(&file, page_html(&report())).expect("a file");
    try_out(&mut tab, &file);
    if let Some(real) = std::env::var_os("PILOTAGE_PAGE") {
        let real = std::fs::canonicalize(real).expect("PILOTAGE_PAGE names a file");
        try_out(&mut tab, &real);
    }
}

fn try_out(tab: &mut Tab, file: &Path) {
    let url = format!("file://{}", file.display());
    let page = std::fs::read_to_string(file).expect("a page");
    let pictures = page.matches("<img").count();
    assert!(pictures >= 4, "{url}: {pictures} pictures");
    for (width, scheme) in [
        (360, "light"),
        (360, "dark"),
        (1280, "light"),
        (1280, "dark"),
    ] {
        let what = format!("{scheme}, {width} pixels wide");
        tab.events();
        tab.emulate(width, scheme, "reduce");
        tab.go(&url);
        everything_is_to_be_seen(tab, width, pictures, &what);
        episodes_play_when_asked(tab, &what);
        keep_picture(tab, &format!("{pictures}-{scheme}-{width}.png"));
        nothing_went_wrong(&tab.events(), &url, &what);
    }
    tab.emulate(1280, "light", "no-preference");
    tab.go(&url);
    // The first episode opens the page, for readers who have nothing against motion.
    wait_until(
        tab,
        "document.querySelector('.episode').dataset.frame !== '0'",
    );
    nothing_went_wrong(&tab.events(), &url, "with motion");
}

fn everything_is_to_be_seen(tab: &mut Tab, width: u32, pictures: usize, what: &str) {
    let widest = tab.value("document.documentElement.scrollWidth");
    assert!(
        widest.as_u64() <= Some(u64::from(width)),
        "{what}: page is {widest} wide"
    );
    let images = tab.value(
        "Promise.all(Array.from(document.images, async (image) => {
            await image.decode();
            const box = image.getBoundingClientRect();
            return image.naturalWidth > 0 && image.naturalHeight > 0 && box.width > 100 && box.height > 50
                && image.checkVisibility({ opacityProperty: true, visibilityProperty: true });
        }))",
    );
    assert_eq!(images, json!(vec![true; pictures]), "{what}");
    // Every episode has drawn its state and belief within its stage, none of its words beyond the edge.
    let drawn = tab.value(
        "Array.from(document.querySelectorAll('.episode'), (episode) => {
            const stage = episode.querySelector('.stage').getBoundingClientRect();
            const inside = (shape) => {
                const box = shape.getBoundingClientRect();
                return box.left >= stage.left - 1 && box.right <= stage.right + 1 && box.top >= stage.top - 1 && box.bottom <= stage.bottom + 1;
            };
            const texts = Array.from(episode.querySelectorAll('.stage text'));
            return stage.height > 150 && texts.length > 0 && texts.every(inside)
                && inside(episode.querySelector('.stage .true')) && episode.querySelector('.stage .belief') !== null
                && episode.querySelectorAll('.nodes [aria-current]').length === 1;
        })",
    );
    assert_eq!(drawn, json!([true, true, true]), "{what}");
    let dead = tab.value(
        "Array.from(document.querySelectorAll('a[href^=\"#\"]')).filter((link) => !document.getElementById(decodeURIComponent(link.hash.slice(1)))).length",
    );
    assert_eq!(dead, 0, "{what}: links that lead nowhere");
}

fn episodes_play_when_asked(tab: &mut Tab, what: &str) {
    for episode in 0..3 {
        let here = format!("document.querySelectorAll('.episode')[{episode}]");
        let frame = format!("Number({here}.dataset.frame)");
        let press = |button: &str| format!("{here}.querySelector('[data-do={button}]').click()");
        let last = tab.value(&format!("Number({here}.querySelector('input').max)"));
        assert!(last.as_u64() >= Some(5), "{what}: {last} steps");

        assert_eq!(tab.value(&frame), 0, "{what}: plays unasked");
        tab.value(&press("forward"));
        tab.value(&press("forward"));
        tab.value(&press("back"));
        assert_eq!(tab.value(&frame), 1, "{what}: two steps, one back");
        let drawing = format!("{here}.querySelector('.stage').innerHTML");
        let before = tab.value(&drawing);
        tab.value(&press("play"));
        wait_until(tab, &format!("{frame} >= 2"));
        tab.value(&press("play"));
        let paused = tab.value(&frame);
        assert_ne!(before, tab.value(&drawing), "{what}: drawn anew");
        std::thread::sleep(Duration::from_millis(1100));
        assert_eq!(tab.value(&frame), paused, "{what}: pause stops");

        // The slider, as a keyboard moves it: to the end, where there is nothing more to step to.
        tab.value(&format!("{here}.querySelector('input').focus()"));
        for kind in ["keyDown", "keyUp"] {
            let end =
                json!({ "type": kind, "key": "End", "code": "End", "windowsVirtualKeyCode": 35 });
            tab.call("Input.dispatchKeyEvent", end);
        }
        wait_until(tab, &format!("{frame} === {last}"));
        let disabled = format!("{here}.querySelector('[data-do=forward]').disabled");
        assert_eq!(tab.value(&disabled), true, "{what}");
        let paid = tab.value(&format!(
            "{{ const data = JSON.parse({here}.querySelector('script').textContent);
               Math.abs(data.frames.reduce((sum, frame) => sum + frame.reward, 0) - Number({here}.querySelector('[data-show=sum]').textContent.replace('\u{2212}', '-'))) < 0.006 }}"
        ));
        assert_eq!(paid, true, "{what}: the sum of what was paid");
        tab.value(&format!(
            "{here}.querySelector('input').value = 4; {here}.querySelector('input').dispatchEvent(new Event('input'))"
        ));
        assert_eq!(tab.value(&frame), 4, "{what}: slider");
    }
}

fn wait_until(tab: &mut Tab, condition: &str) {
    let started = Instant::now();
    while tab.value(condition) != json!(true) {
        assert!(
            started.elapsed() < Duration::from_secs(20),
            "never: {condition}"
        );
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// No error, no warning, and no request but for the page itself and the pictures in it.
fn nothing_went_wrong(events: &[Value], url: &str, what: &str) {
    let mut pages = 0;
    for event in events {
        match event["method"].as_str().unwrap_or_default() {
            method
            @ ("Runtime.exceptionThrown" | "Runtime.consoleAPICalled" | "Log.entryAdded") => {
                panic!("{what}: {method} {}", event["params"]);
            }
            "Network.requestWillBeSent" => {
                let asked = event["params"]["request"]["url"]
                    .as_str()
                    .unwrap_or_default();
                assert!(
                    asked == url || asked.starts_with("data:"),
                    "{what}: asks for {asked}"
                );
                pages += u32::from(asked == url);
            }
            _ => {}
        }
    }
    assert_eq!(pages, 1, "{what}: the page is asked for once");
}

/// Leaves a picture of the whole page, where the environment says so.
fn keep_picture(tab: &mut Tab, name: &str) {
    let Some(folder) = std::env::var_os("PILOTAGE_SCREENSHOTS") else {
        return;
    };
    let picture = tab.call(
        "Page.captureScreenshot",
        json!({ "captureBeyondViewport": true }),
    );
    let bytes = picture["data"].as_str().unwrap_or_default();
    let path = PathBuf::from(folder).join(name);
    std::fs::write(path, BASE64.decode(bytes).expect("base64")).expect("the folder exists");
}
