//! What careless or hostile input meets: a result or one message, never a panic, a hang or a broken file.
#![cfg(unix)]
#![allow(clippy::unwrap_used)]

use std::ffi::OsStr;
use std::fs;
use std::io::Read;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::{FileTypeExt, PermissionsExt, symlink};
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

/// A command in a folder.
fn pilotage(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pilotage"));
    command.current_dir(folder).args(arguments);
    command
}

/// A command line of the shell, in which `pilotage` is the program.
fn shell(folder: &Path, line: &str) -> Output {
    let binary = env!("CARGO_BIN_EXE_pilotage");
    let script = format!("pilotage() {{ '{binary}' \"$@\"; }}\n{line}");
    Command::new("bash")
        .current_dir(folder)
        .args(["-c", &script])
        .output()
        .unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Whether some command of the system succeeds.
fn system(folder: &Path, command: &[&str]) -> bool {
    let status = Command::new(command[0])
        .current_dir(folder)
        .args(&command[1..])
        .status();
    status.is_ok_and(|status| status.success())
}

/// A policy that is quickly made.
const SOLVE: [&str; 6] = ["solve", "tiger", "--episodes", "10", "--seed", "1"];

fn solve_to(folder: &Path, out: &str) -> Output {
    let arguments = [&SOLVE[..], &["--out", out]].concat();
    pilotage(folder, &arguments).output().unwrap()
}

/// Changes the policy in a file, and gives it the checksum of what it has become: FNV-1a over the policy without white space between its
/// values.
fn edit(file: &Path, edit: impl FnOnce(&mut serde_json::Value)) {
    let mut whole: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(file).unwrap()).unwrap();
    edit(&mut whole["policy"]);
    let policy = whole["policy"].to_string();
    let checksum = policy
        .bytes()
        .fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        });
    whole["checksum"] = format!("fnv1a64-{checksum:016x}").into();
    fs::write(file, whole.to_string()).unwrap();
}

fn is_policy(text: &str) -> bool {
    text.contains("\"policy\"")
}

/// Names of what lies in a folder.
fn listing(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let mut names: Vec<String> = entries
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn an_output_that_is_no_file_is_written_to_or_refused_and_stays_what_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let kind = |name: &str| fs::symlink_metadata(here.join(name)).unwrap().file_type();

    fs::create_dir(here.join("folder")).unwrap();
    let refused = solve_to(here, "folder");
    assert!(!refused.status.success());
    assert!(text(&refused.stderr).contains("folder: this is a directory"));
    assert!(kind("folder").is_dir());

    let _socket = std::os::unix::net::UnixListener::bind(here.join("socket")).unwrap();
    let refused = solve_to(here, "socket");
    assert!(!refused.status.success());
    assert!(text(&refused.stderr).contains("a device or a socket"));
    assert!(kind("socket").is_socket());

    assert!(system(here, &["mkfifo", "pipe"]));
    let mut child = pilotage(here, &[&SOLVE[..], &["--out", "pipe"]].concat())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let mut piped = String::new();
    fs::File::open(here.join("pipe"))
        .unwrap()
        .read_to_string(&mut piped)
        .unwrap();
    assert!(child.wait().unwrap().success());
    assert!(is_policy(&piped));
    assert!(kind("pipe").is_fifo());

    // Nodes like /dev/null and /dev/loop0, which only root may make.
    if system(here, &["mknod", "null", "c", "1", "3"]) {
        assert!(solve_to(here, "null").status.success());
        assert!(kind("null").is_char_device());
    }
    if system(here, &["mknod", "disk", "b", "7", "200"]) {
        let refused = solve_to(here, "disk");
        assert!(!refused.status.success());
        assert!(text(&refused.stderr).contains("a device or a socket"));
        assert!(kind("disk").is_block_device());
    }
}

#[test]
fn a_link_stays_and_what_it_leads_to_is_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    fs::create_dir(here.join("store")).unwrap();
    fs::write(here.join("store/policy.json"), "old").unwrap();
    symlink("store/policy.json", here.join("link.json")).unwrap();
    symlink("link.json", here.join("link-of-link.json")).unwrap();
    symlink("store/new.json", here.join("dangling.json")).unwrap();
    symlink("circle", here.join("circle")).unwrap();
    symlink("missing/new.json", here.join("nowhere.json")).unwrap();
    for (link, file) in [
        ("link.json", "store/policy.json"),
        ("link-of-link.json", "store/policy.json"),
        ("dangling.json", "store/new.json"),
    ] {
        let solved = solve_to(here, link);
        assert!(solved.status.success(), "{}", text(&solved.stderr));
        assert!(fs::symlink_metadata(here.join(link)).unwrap().is_symlink());
        assert!(is_policy(&fs::read_to_string(here.join(file)).unwrap()));
        fs::write(here.join("store/policy.json"), "old").unwrap();
    }
    for link in ["circle", "nowhere.json"] {
        let refused = solve_to(here, link);
        assert!(!refused.status.success());
        assert!(text(&refused.stderr).contains(link));
    }
    assert_eq!(listing(&here.join("store")), ["new.json", "policy.json"]);
}

#[test]
fn a_file_that_is_replaced_hands_its_permissions_on() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("policy.json");
    fs::write(&path, "secret").unwrap();
    fs::set_permissions(&path, fs::Permissions::from_mode(0o600)).unwrap();
    assert!(solve_to(folder.path(), "policy.json").status.success());
    let mode = fs::metadata(&path).unwrap().permissions().mode();
    assert_eq!(mode & 0o777, 0o600);
}

#[test]
fn a_policy_can_be_written_to_the_standard_streams() {
    let folder = tempfile::tempdir().unwrap();
    let solve = SOLVE.join(" ");
    for line in [
        format!("pilotage {solve} --out /dev/stdout"),
        format!("pilotage {solve} --out /dev/stdout | cat"),
        format!("pilotage {solve} --out /dev/stdout > file; cat file"),
        format!("echo before > file; pilotage {solve} --out /dev/stdout >> file; cat file"),
        format!("pilotage {solve} --out /dev/stderr 2>&1"),
        format!("pilotage {solve} --out >(cat > file); sleep 0.5; cat file"),
    ] {
        let output = shell(folder.path(), &line);
        let printed = text(&output.stdout);
        assert!(output.status.success(), "{line}: {}", text(&output.stderr));
        assert!(is_policy(&printed), "{line}");
        assert_eq!(line.contains("before"), printed.starts_with("before"));
        if !line.contains(">(") {
            assert!(printed.contains("discounted return"), "{line}");
        }
    }
    let full = shell(folder.path(), &format!("pilotage {solve} --out /dev/full"));
    assert!(!full.status.success());
    assert!(text(&full.stderr).contains("error: /dev/full"));
}

#[test]
fn a_wrong_name_for_the_output_is_known_before_the_work_is_done() {
    let folder = tempfile::tempdir().unwrap();
    let clock = Instant::now();
    for wrong in ["--out=missing/p.json", "--curves=missing/p.svg", "--out=."] {
        let hours = [
            "solve",
            "stations-5x5",
            "--with",
            "kafaq",
            "--learn",
            "epoch=100000000",
            wrong,
        ];
        let output = pilotage(folder.path(), &hours).output().unwrap();
        assert!(!output.status.success());
        assert_eq!(text(&output.stderr).matches("error:").count(), 1);
    }
    assert!(clock.elapsed() < Duration::from_secs(10));
}

/// The program, told to hear signals that whoever started the tests may ignore, as `nohup` does.
fn hearing_signals(folder: &Path, arguments: &[&str]) -> Command {
    if !cfg!(target_os = "linux") {
        return pilotage(folder, arguments);
    }
    let mut command = Command::new("env");
    command
        .arg("--default-signal=HUP,INT,TERM")
        .arg(env!("CARGO_BIN_EXE_pilotage"))
        .args(arguments)
        .current_dir(folder);
    command
}

/// A learner writes its checkpoint all the time; whenever it is ended, by whatever signal, nothing else is left behind.
#[test]
fn signals_leave_no_temporary_files() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let learn = [
        "solve",
        "maze-4x4",
        "--with",
        "kafaq",
        "--learn",
        "epoch=100",
        "--learn",
        "epoch_per_cell=1",
        "--learn",
        "epoch_limit=100000",
        "--learn",
        "calm=1000000",
        "--checkpoint",
        "run.json",
    ];
    for (round, signal) in ["TERM", "INT", "HUP", "KILL"]
        .iter()
        .cycle()
        .take(16)
        .enumerate()
    {
        let mut child = hearing_signals(here, &learn)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        std::thread::sleep(Duration::from_millis(60 + 17 * round as u64));
        assert!(system(
            here,
            &["kill", "-s", signal, &child.id().to_string()]
        ));
        let clock = Instant::now();
        let ended = loop {
            match child.try_wait().unwrap() {
                Some(status) => break status,
                None if clock.elapsed() > Duration::from_secs(30) => {
                    child.kill().unwrap();
                    panic!("{signal} did not end it");
                }
                None => std::thread::sleep(Duration::from_millis(5)),
            }
        };
        assert!(!ended.success());
        let left = listing(here);
        assert!(left.iter().all(|name| name == "run.json"), "{left:?}");
    }
    assert_eq!(listing(here), ["run.json"]);
}

fn built_in(name: &str) -> String {
    let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models");
    fs::read_to_string(models.join(format!("{name}.toml"))).unwrap()
}

/// A command that must end with one message that holds certain words, and in time.
fn refused(folder: &Path, arguments: &[&str], says: &str) {
    let clock = Instant::now();
    let output = pilotage(folder, arguments).output().unwrap();
    let said = text(&output.stderr);
    let code = output.status.code();
    assert!(
        matches!(code, Some(1 | 2)),
        "{arguments:?}: {code:?}, {said}"
    );
    assert_eq!(said.matches("error:").count(), 1, "{arguments:?}: {said}");
    assert!(said.contains(says), "{arguments:?}: {said}");
    assert!(output.stdout.is_empty(), "{arguments:?} prints a result");
    assert!(clock.elapsed() < Duration::from_secs(20), "{arguments:?}");
}

const MAX: &str = "18446744073709551615";

#[test]
fn no_verb_starts_a_hundred_thousand_threads() {
    let folder = tempfile::tempdir().unwrap();
    for verb in ["solve tiger", "simulate tiger --policy p.json", "reproduce"] {
        for threads in ["100000", MAX] {
            let line = format!("{verb} --threads {threads}");
            let arguments: Vec<&str> = line.split(' ').collect();
            refused(folder.path(), &arguments, "at most 1024");
        }
    }
}

#[test]
fn extreme_settings_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let rows: &[(&[&str], &str)] = &[
        (
            &["--with", "policy-search", "--effort", "nan"],
            "error: --effort NaN is no value of it: Factor on the length of all simulations; more than 0, at most 1000, and 1 is the \
             thorough search.\n",
        ),
        (
            &["--with", "policy-search", "--effort", "inf"],
            "error: --effort inf is no value of it: Factor on the length of all simulations; more than 0, at most 1000",
        ),
        (
            &["--with", "policy-search", "--set", "effort=nan"],
            "error: effort = nan is no value of it: Factor on the length of all simulations; more than 0, at most 1000",
        ),
        (
            &["--with", "policy-search", "--set", "objective=luck"],
            "error: objective = luck is no value of it: What is sought: `return`, or `survival`",
        ),
        (
            &["--with", "policy-search", "--effort", "0"],
            "error: --effort 0 is out of range: above 0, at most 1000\n",
        ),
        (
            &["--with", "policy-search", "--effort", "1e300"],
            "is out of range: above 0, at most 1000\n",
        ),
        (
            &["--with", "policy-search", "--set", "effort=0"],
            "error: effort = 0 is out of range: above 0, at most 1000\n",
        ),
        (
            &["--with", "lqg", "--state-weights", "nan"],
            "error: --state-weights [NaN] is no value of it: ",
        ),
        (&["--grid", "0"], "--grid 0 is out of range"),
        (&["--grid", "1"], "--grid 1 is out of range"),
        (&["--set", "points=0"], "points = 0 is out of range"),
        (
            &["--runs", MAX],
            "runs = 18446744073709551615 is out of range",
        ),
        (
            &["--with", "kbvi", "--runs", MAX],
            "runs = 18446744073709551615 is out of range",
        ),
        (
            &[
                "--with",
                "kbvi",
                "--first-horizon",
                MAX,
                "--last-horizon",
                MAX,
            ],
            "first-horizon 18446744073709551615 is out of range",
        ),
        (
            &["--with", "kbvi", "--last-horizon", MAX],
            "last-horizon 18446744073709551615 is out of range",
        ),
        (&["--grid", "100000000"], "more than the 1024 MiB allowed"),
        (&["--grid", MAX, "--memory", MAX], "MiB are free here"),
        (
            &["--with", "mls", "--grid", "100000000000", "--memory", MAX],
            "MiB are free here",
        ),
        (
            &["--with", "qmdp", "--grid", "0"],
            "--grid 0 is out of range",
        ),
    ];
    for (settings, says) in rows {
        refused(
            folder.path(),
            &[&["solve", "corridor-blind"], *settings].concat(),
            says,
        );
    }
}

/// What is kept of a grid may have room where what a sweep looks up at its points has none.
#[cfg(target_os = "linux")]
#[test]
fn memory_is_counted_before_it_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    let table = fs::read_to_string("/proc/meminfo").unwrap();
    let free = table.lines().find_map(|line| {
        let number = line.strip_prefix("MemAvailable:")?;
        number.split_whitespace().next()?.parse::<u64>().ok()
    });
    // Less than a third of what is free for the functions, and more than all of it with three look-ups of 200 bytes a point.
    let points = free.unwrap() * 1024 / 550;
    let limited = format!(
        "ulimit -v 4000000; '{}' solve corridor --grid {points} --memory {MAX}",
        env!("CARGO_BIN_EXE_pilotage")
    );
    let output = shell(folder.path(), &limited);
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("MiB are free here"), "{said}");
}

#[test]
fn counts_of_a_learner_that_no_run_comes_to_the_end_of_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let common = ["calm", "epoch", "epoch_limit", "trial"];
    let own: [(&str, &[&str]); 2] = [
        (
            "kafaq",
            &["cell_limit", "cells_along", "epoch_per_cell", "window"],
        ),
        (
            "arkaq",
            &[
                "scout",
                "settle",
                "explore_limit",
                "state_limit",
                "epoch_per_entry",
                "depth",
            ],
        ),
    ];
    for (learner, own) in own {
        for key in common.iter().chain(own) {
            let setting = format!("{key}={MAX}");
            let arguments = ["solve", "basic", "--with", learner, "--learn", &setting];
            let says = format!("{key} = {MAX} is out of range");
            refused(folder.path(), &arguments, &says);
        }
    }
}

#[test]
fn a_checkpoint_is_a_file_that_can_be_written() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    assert!(system(here, &["mkfifo", "pipe"]));
    for (learner, checkpoint, says) in [
        ("kafaq", "/dev/null", "this is no file"),
        ("arkaq", "/dev/zero", "this is no file"),
        ("arkaq", "pipe", "this is no file"),
        ("kafaq", ".", "this is a directory"),
        ("arkaq", "missing/run.json", "missing/run.json"),
    ] {
        let arguments = [
            "solve",
            "stations-5x5",
            "--with",
            learner,
            "--learn",
            "epoch=100000000",
            "--checkpoint",
            checkpoint,
        ];
        refused(here, &arguments, says);
    }
}

/// A disk that is full, or a policy too large for a file, is met only when the work is done; what it came to is told all the same.
#[test]
fn a_policy_that_cannot_be_kept_is_not_lost_without_a_word() {
    let folder = tempfile::tempdir().unwrap();
    for (json, shows) in [
        (None, "discounted return"),
        (Some("--json"), "\"evaluation\""),
    ] {
        let arguments = [&SOLVE[..], &["--out", "/dev/full"]].concat();
        let mut command = pilotage(folder.path(), &arguments);
        let output = command.args(json).output().unwrap();
        let (printed, said) = (text(&output.stdout), text(&output.stderr));
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.starts_with("error: /dev/full: "), "{said}");
        assert!(printed.contains(shows), "{printed}");
        assert!(!printed.contains("kept in"), "{printed}");
    }
}

#[test]
fn streams_that_are_full_or_closed_end_in_an_exit_code() {
    let folder = tempfile::tempdir().unwrap();
    for (line, fits) in [
        ("pilotage check corridor > /dev/full", false),
        ("pilotage check --schema > /dev/full", false),
        ("pilotage list > /dev/full", false),
        ("pilotage list --json > /dev/full", false),
        ("pilotage --help > /dev/full", false),
        ("pilotage --version > /dev/full", false),
        ("pilotage solve tiger --episodes 10 > /dev/full", false),
        ("pilotage check nowhere 2> /dev/full", false),
        ("pilotage check nowhere 2>&-", false),
        ("pilotage check nowhere 2> >(true)", false),
        ("pilotage solve corridor --seed x 2> /dev/full", false),
        ("pilotage check nowhere > /dev/full 2>&1", false),
        ("pilotage reproduce --list > /dev/full", false),
        ("pilotage solve tiger --episodes 10 2> /dev/full", true),
        ("pilotage solve tiger --episodes 10 2>&-", true),
        ("pilotage check corridor 2> /dev/full", true),
        ("pilotage check corridor 2>&-", true),
        ("pilotage check corridor <&- 2>&-", true),
    ] {
        let output = shell(folder.path(), &format!("{line}\nexit $?"));
        let code = output.status.code();
        assert!(
            if fits {
                code == Some(0)
            } else {
                matches!(code, Some(1 | 2))
            },
            "{line}: {code:?}"
        );
        assert!(!text(&output.stderr).contains("panicked"), "{line}");
    }
}

#[test]
fn a_path_that_is_not_utf8_is_a_path() {
    let folder = tempfile::tempdir().unwrap();
    let (model, policy) = (
        OsStr::from_bytes(b"hall\xff.toml"),
        OsStr::from_bytes(b"p\xfe.json"),
    );
    fs::write(folder.path().join(model), built_in("corridor-blind")).unwrap();
    let (out, problem) = (OsStr::new("--out"), OsStr::new("--problem"));
    let word = OsStr::new;
    let episodes = [word("--episodes"), word("10")];
    for arguments in [
        vec![word("check"), model],
        vec![word("solve"), model, out, policy, episodes[0], episodes[1]],
        vec![
            word("simulate"),
            model,
            word("--policy"),
            policy,
            word("--world"),
            model,
            episodes[0],
            episodes[1],
        ],
        vec![word("draw"), policy, problem, model],
    ] {
        let output = pilotage(folder.path(), &[])
            .args(&arguments)
            .output()
            .unwrap();
        assert!(
            output.status.success(),
            "{arguments:?}: {}",
            text(&output.stderr)
        );
    }
    let pictures = fs::read_dir(folder.path()).unwrap();
    let names: Vec<_> = pictures.map(|entry| entry.unwrap().file_name()).collect();
    assert!(
        names.contains(&OsStr::from_bytes(b"p\xfe-map.svg").to_owned()),
        "{names:?}"
    );
}

/// What is written into a model file in the place of something else, and what the program says to it.
#[test]
fn models_beyond_all_numbers_are_refused_by_every_verb() {
    let folder = tempfile::tempdir().unwrap();
    for (base, good, bad, says) in [
        (
            "corridor-blind",
            "H = [[1.0]]",
            "H = [[-1e308]]",
            "uncertainty level 0",
        ),
        (
            "cart-pole",
            "step = 0.02",
            "step = 9.0",
            "the smallest eigenvalue",
        ),
        (
            "cart-pole",
            "gravity = 9.8",
            "gravity = 1e307",
            "shorter `step`",
        ),
        (
            "corridor-blind",
            "name = \"corridor-blind\"",
            "name = \"\\u001b[31mred\"",
            "\\u{1b}",
        ),
        (
            "scalar-lqg",
            "length = 10",
            "length = 1000000000000",
            "a gain for every step",
        ),
    ] {
        let model = built_in(base);
        assert!(model.contains(good), "{good}");
        fs::write(folder.path().join("m.toml"), model.replacen(good, bad, 1)).unwrap();
        for solver in ["kbvi-closed", "lqg", "kafaq", "arkaq"] {
            if base == "scalar-lqg" && solver != "lqg" {
                continue;
            }
            refused(folder.path(), &["solve", "m.toml", "--with", solver], says);
        }
        if base != "scalar-lqg" {
            refused(folder.path(), &["check", "m.toml"], says);
        }
    }
}

#[test]
fn a_hundred_thousand_levels_are_checked_and_planned_for() {
    let folder = tempfile::tempdir().unwrap();
    let many = "level_tolerance = 0.0\nlevel_limit = 100000";
    let model = built_in("tiger").replacen("level_tolerance = 1e-4", many, 1);
    fs::write(folder.path().join("many.toml"), model).unwrap();
    let clock = Instant::now();
    for arguments in [
        &["check", "many.toml"][..],
        &[
            "solve",
            "many.toml",
            "--grid",
            "2",
            "--runs",
            "10",
            "--episodes",
            "10",
        ],
    ] {
        let output = pilotage(folder.path(), arguments).output().unwrap();
        assert!(output.status.success(), "{}", text(&output.stderr));
    }
    assert!(clock.elapsed() < Duration::from_secs(30));
}

/// A policy names its problem; that is no reason to read whatever file it names.
#[test]
fn a_policy_does_not_choose_the_files_that_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    fs::write(here.join("secret"), "password = 'abc'").unwrap();
    fs::write(here.join("corridor.toml"), built_in("corridor-blind")).unwrap();
    assert!(solve_to(here, "p.json").status.success());
    for named in ["secret", "./secret", "corridor.toml"] {
        edit(&here.join("p.json"), |policy| {
            policy["problem"] = named.into()
        });
        let output = pilotage(here, &["draw", "p.json"]).output().unwrap();
        let said = text(&output.stderr);
        assert!(!said.contains("password"), "{said}");
        refused(here, &["draw", "p.json"], "which is not built in");
    }
}

/// Numbers and names of a policy file, edited by hand by somebody who corrects its checksum.
#[test]
fn a_policy_whose_numbers_lead_nowhere_is_refused_or_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let file = here.join("p.json");
    let solve = "solve corridor-blind --episodes 10 --grid 101 --out p.json";
    let solve: Vec<&str> = solve.split(' ').collect();
    assert!(pilotage(here, &solve).output().unwrap().status.success());
    let whole = fs::read_to_string(&file).unwrap();
    let simulate = [
        "simulate",
        "corridor-blind",
        "--policy",
        "p.json",
        "--episodes",
        "10",
    ];
    edit(&file, |_| {});
    let unchanged = pilotage(here, &simulate).output().unwrap();
    assert!(unchanged.status.success(), "{}", text(&unchanged.stderr));

    let huge = "no number may be larger than";
    for (pointer, value, says) in [
        ("/filter/A/0/0", serde_json::json!(1e200), huge),
        ("/filter/Bu/0/0", serde_json::json!(-1e200), huge),
        ("/filter/H/0/0", serde_json::json!(1e308), huge),
        (
            "/filter/levels/0/steps/0/gain/0/0",
            serde_json::json!(1e200),
            huge,
        ),
        ("/start/mean/0", serde_json::json!(1e200), huge),
        ("/nodes/0/value", serde_json::json!(-1e308), huge),
        (
            "/filter/levels/0/covariance/0/0",
            serde_json::json!(-1),
            "not positive semi-definite",
        ),
        (
            "/filter/levels/0/steps/0/next",
            serde_json::json!(u64::MAX),
            "levels, counted from 0",
        ),
        ("/scale/0", serde_json::json!(1e-320), "where at least"),
        ("/scale/0", serde_json::json!(0), "where at least"),
        ("/nodes", serde_json::json!([]), "the list is empty"),
        (
            "/solver",
            serde_json::json!("\u{1b}]0;owned\u{7}"),
            "\\u{1b}",
        ),
        ("/problem", serde_json::json!("corridor\u{7}"), "\\u{7}"),
        ("/actions/0", serde_json::json!("EAST\u{202e}"), "\\u{202e}"),
        ("/states/0", serde_json::json!("x\u{9b}2J"), "\\u{9b}"),
    ] {
        fs::write(&file, &whole).unwrap();
        edit(&file, |policy| {
            *policy.pointer_mut(pointer).unwrap() = value;
        });
        refused(here, &simulate, says);
        refused(here, &["draw", "p.json"], says);
    }
    // Each number is allowed, and together they grow from step to step.
    fs::write(&file, &whole).unwrap();
    edit(&file, |policy| {
        *policy.pointer_mut("/filter/A/0/0").unwrap() = serde_json::json!(1e20);
    });
    refused(here, &simulate, "the mean of the belief is");
}

/// Whatever a file or its name holds, nothing of it reaches the terminal that the terminal would obey.
#[test]
fn nothing_that_a_terminal_obeys_is_printed() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let (escape, wrong) = ("\u{1b}]0;owned\u{7}", "a\u{1b}[2J.toml");
    let (policy, setting) = ("p\u{1b}[2J.json", "a\u{1b}=1");
    let corridor = built_in("corridor-blind");
    fs::write(here.join(wrong), &corridor).unwrap();
    for (file, old, new) in [
        ("raw.toml", "EAST", escape),
        ("escaped.toml", "EAST", "\\u001b]0;owned\\u0007"),
        ("c1.toml", "discount", "# \u{9b}2J\ndiscont"),
        ("key.toml", "discount", "\"\\u001b[2J\" = 1\ndiscount"),
    ] {
        assert!(corridor.contains(old));
        fs::write(here.join(file), corridor.replacen(old, new, 1)).unwrap();
    }
    let header = format!("{{\"format\": \"{escape}\"}}");
    fs::write(here.join("policy.json"), header).unwrap();
    let newer = "{\"format\": 99, \"pilotage\": \"\\u001b[2J\"}";
    fs::write(here.join("newer.json"), newer).unwrap();
    fs::write(here.join("run.json"), format!("{newer}\n{{}}\n")).unwrap();
    let commands: &[&[&str]] = &[
        &["check", wrong],
        &["check", "raw.toml"],
        &["check", "escaped.toml"],
        &["check", "c1.toml"],
        &["check", "key.toml"],
        &["check", escape],
        &["solve", wrong, "--episodes", "10", "--out", policy],
        &["simulate", wrong, "--policy", policy, "--episodes", "10"],
        &["draw", policy, "--problem", wrong],
        &["draw", "policy.json"],
        &["draw", "newer.json"],
        &["draw", escape],
        &["solve", "corridor-blind", "--with", escape],
        &["solve", "corridor-blind", "--policy", escape],
        &["solve", "corridor-blind", "--seed", escape],
        &["solve", "corridor-blind", "--set", setting],
        &["solve", "corridor-blind", "--set", escape],
        &[
            "solve",
            "corridor-blind",
            "--with",
            "kafaq",
            "--learn",
            setting,
        ],
        &["solve", "corridor-blind", escape],
        &["reproduce", "--only", escape],
        &["solve", "basic", "--with", "kafaq", "--checkpoint", policy],
        &[
            "solve",
            "basic",
            "--with",
            "kafaq",
            "--checkpoint",
            "run.json",
        ],
        &[
            "solve",
            "basic",
            "--with",
            "kafaq",
            "--checkpoint",
            "n\u{1b}/x",
        ],
    ];
    for arguments in commands {
        let output = pilotage(here, arguments).output().unwrap();
        let printed = text(&output.stdout) + &text(&output.stderr);
        assert!(!printed.is_empty(), "{arguments:?}");
        let obeyed = |c: char| c.is_control() && c != '\n' && c != '\t';
        assert!(!printed.contains(obeyed), "{arguments:?}: {printed:?}");
    }
}

/// However many episodes are asked for, few are kept.
#[test]
fn a_million_million_episodes_take_no_memory() {
    let folder = tempfile::tempdir().unwrap();
    assert!(solve_to(folder.path(), "p.json").status.success());
    for line in [
        "simulate tiger --policy p.json --episodes 1000000000000",
        &format!("simulate tiger --policy p.json --episodes {MAX}"),
        "solve tiger --value-lost --episodes 1000000000000",
        "solve scalar-lqg --with lqg --episodes 1000000000000",
    ] {
        let limited = format!(
            "ulimit -v 2000000; timeout 1.5 '{}' {line}",
            env!("CARGO_BIN_EXE_pilotage")
        );
        let output = shell(folder.path(), &limited);
        // Still at it when it was told to stop.
        assert_eq!(
            output.status.code(),
            Some(124),
            "{line}: {}",
            text(&output.stderr)
        );
    }
}
