//! Policy graphs: what runs without a belief, how it is kept in a file, and where there is none.
#![allow(clippy::unwrap_used)]

mod common;

use common::automata::{any_graph, sealed};
use common::{built_in, scenario};
use pilotage::Error;
use pilotage::belief::Reading;
use pilotage::model::Model;
use pilotage::policy::{Automaton, GraphNode, GraphRunner, PolicyGraph, Saved};
use pilotage::progress::Silent;
use pilotage::scenario::Scenario;
use pilotage::simulate::{Agent, Options, evaluate_agent};
use pilotage::solve::{Form, Registry, Request, Solution, solve};
use proptest::prelude::*;
use serde_json::{Value, json};

/// Up until it is bright, down for two steps, and stop.
fn by_hand() -> PolicyGraph {
    let node = |action, next: &[usize], visits, gone: &[f64]| GraphNode {
        action,
        next: next.to_vec(),
        visits,
        gone: gone.to_vec(),
    };
    PolicyGraph {
        planned_value: Some(1.5),
        nodes: vec![
            node(1, &[1, 0, 0], 0.5, &[0.125, 0.375, 0.0]),
            node(2, &[2, 2, 1], 0.125, &[0.0625, 0.0625, 0.0]),
            node(2, &[3, 3, 3], 0.125, &[0.0625, 0.0625, 0.0]),
            node(0, &[], 0.25, &[]),
        ],
        ..PolicyGraph::new(&built_in("light-dark-binary"), "by hand")
    }
}

#[test]
fn a_graph_is_told_in_words() {
    let words = "0  UP    on bright go to 1; on dark or nothing go to 0
1  DOWN  on bright or dark go to 2; on nothing go to 1
2  DOWN  go to 3
3  STOP  the episode ends or begins again";
    assert_eq!(by_hand().in_words(), words);
}

#[test]
fn signals_lead_from_node_to_node() {
    let mut runner = GraphRunner::new(&by_hand());
    let mut visited = Vec::new();
    let readings = [
        Reading::Symbol(1),
        Reading::Nothing,
        Reading::Symbol(0),
        Reading::Nothing,
        // Numbers, and a signal that the graph does not know, say nothing.
        Reading::Values(&[1.0]),
        Reading::Symbol(7),
        Reading::Symbol(0),
        Reading::Symbol(1),
        // It stays where no episode goes on.
        Reading::Symbol(1),
    ];
    for reading in readings {
        visited.push(runner.decide());
        runner.observe(reading);
    }
    visited.push(runner.decide());
    let expected = [0, 0, 0, 1, 1, 1, 1, 2, 3, 3].map(|node| (node, [1, 2, 2, 0][node]));
    assert_eq!(visited, expected);
    runner.reset();
    assert_eq!(runner.decide(), (0, 1));
    // Without nodes there is still something to do.
    let none = PolicyGraph::new(&built_in("light-dark-binary"), "none");
    let mut runner = GraphRunner::new(&none);
    runner.observe(Reading::Symbol(0));
    assert_eq!(runner.decide(), (0, 0));
}

fn solved(scenario: &Scenario, request: &Request) -> pilotage::Result<Solution> {
    let settings = [("beliefs", "150"), ("rounds", "3")];
    let settings = settings.map(|(name, value)| (name.to_owned(), value.to_owned()));
    let solver = Registry::builtin().find("point-based")?.solver(&settings)?;
    solve(&solver, scenario, request, &Silent)
}

#[test]
fn what_is_planned_is_earned_and_threads_change_nothing() {
    let scenario = scenario("light-dark-binary");
    let request = Request {
        nodes: Some(12),
        ..Request::form(Form::Graph)
    };
    let options = Options {
        episodes: 4000,
        seed: 5,
    };
    let with_threads = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| {
            let solution = solved(&scenario, &request).unwrap();
            let earned = solution.earned(&scenario, options, &Silent).unwrap();
            (solution.graph().cloned().unwrap(), earned)
        })
    };
    let (graph, earned) = with_threads(1);
    assert!(with_threads(3) == (graph.clone(), earned.clone()));

    assert!(graph.nodes.len() <= 12);
    let (planned, got) = (graph.planned_value.unwrap(), earned.assumed.discounted);
    assert!(planned > 2.0, "{planned}");
    // Cells are coarse: what is so on them misses the world by up to 2 %.
    let allowed = 3.0 * got.stderr + 0.02 * planned.abs();
    assert!((planned - got.mean).abs() < allowed, "{planned} {got:?}");
    // The rule of thumb of the model is run on the beliefs that the model asks for.
    assert!(earned.rule.unwrap().earned.discounted.mean > 2.0);
    let agent = || -> Box<dyn Agent> { Box::new(GraphRunner::new(&graph)) };
    let again = evaluate_agent(&scenario, &agent, options, &Silent);
    assert_eq!(again, earned.world);
}

#[test]
fn what_a_graph_costs_is_measured_in_the_same_episodes() {
    let scenario = scenario("light-dark-binary");
    let graph = solved(&scenario, &Request::form(Form::Graph)).unwrap();
    let planner = solved(&scenario, &Request::form(Form::Grid)).unwrap();
    let options = Options {
        episodes: 300,
        seed: 1,
    };
    let lost = graph
        .value_lost(&planner, &scenario, options, &Silent)
        .unwrap();
    let [planner, graph] = [planner, graph].map(|solution| {
        let earned = solution.evaluate(&scenario, options, &Silent).unwrap();
        earned.discounted.mean
    });
    assert!((lost.mean - (planner - graph)).abs() < 1e-9);
}

#[test]
fn where_there_is_no_graph_it_is_said_what_would_do() {
    let said = |scenario: &Scenario, name: &str| {
        let registry = Registry::builtin();
        let solver = registry.find(name).unwrap().solver(&[]).unwrap();
        let request = Request::form(Form::Graph);
        let error = solve(&solver, scenario, &request, &Silent).map(|_| ());
        error.unwrap_err().to_string()
    };
    let continuous = said(&scenario("light-dark-5"), "point-based");
    assert!(
        continuous.contains("needs a discrete sensor") && continuous.contains("such as tree"),
        "{continuous}"
    );
    for name in ["codebook", "point-based"] {
        let solver = Registry::builtin().find(name).unwrap().solver(&[]).unwrap();
        let refused = solver.gives(Form::Graph, &built_in("light-dark-binary"));
        assert_eq!(refused.is_ok(), name == "point-based");
    }
    let other = said(&scenario("light-dark-binary"), "codebook");
    assert!(other.contains("use point-based"), "{other}");
    let learner = said(&scenario("corridor-blind"), "kafaq");
    assert!(learner.contains("needs a discrete sensor"), "{learner}");

    for (nodes, loss, form, said) in [
        (Some(0), None, Form::Graph, "at least 1"),
        (None, Some(-0.1), Form::Graph, "at least 0"),
        (
            Some(3),
            None,
            Form::Grid,
            "for the forms tree and graph alone",
        ),
        (
            None,
            Some(0.1),
            Form::Nearest,
            "for the forms tree and graph alone",
        ),
    ] {
        let request = Request {
            nodes,
            loss,
            ..Request::form(form)
        };
        let error = solved(&scenario("light-dark-binary"), &request).map(|_| ());
        let error = error.unwrap_err().to_string();
        assert!(error.contains(said), "{error}");
    }
}

#[test]
fn a_file_gives_the_same_graph_back() {
    let graph = by_hand();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("policy.json");
    graph.save(&path).unwrap();
    let saved = Saved::load(&path).unwrap();
    assert_eq!(saved, Saved::Graph(graph));
    assert_eq!((saved.problem(), saved.nodes()), ("light-dark-binary", 4));
    assert_eq!(
        (saved.solver(), saved.planned_value()),
        ("by hand", Some(1.5))
    );

    let said = |error: pilotage::Result<()>| error.unwrap_err().to_string();
    let own = built_in("light-dark-binary");
    saved.check_problem(&own, "policy.json").unwrap();
    saved.check_world(&own, "policy.json").unwrap();
    let other = said(saved.check_problem(&built_in("tiger"), "policy.json"));
    assert!(other.contains("not for tiger"), "{other}");
    let renamed = |change: &dyn Fn(&mut Model)| {
        let mut model = own.clone();
        change(&mut model);
        said(saved.check_world(&model, "policy.json"))
    };
    let signals = renamed(&|model| model.laws.symbols[0] = "light".to_owned());
    assert!(signals.contains("the signals bright, dark"), "{signals}");
    let none = renamed(&|model| model.laws.symbols.clear());
    assert!(none.contains("has none"), "{none}");
    let actions = renamed(&|model| model.actions[0].name = "HALT".to_owned());
    assert!(actions.contains("the actions STOP, UP, DOWN"), "{actions}");

    let no_automaton = Automaton::load(&path).unwrap_err().to_string();
    assert!(
        no_automaton.contains("this policy is a graph"),
        "{no_automaton}"
    );
}

/// What reading a good file says after a change of its policy, whose checksum is made right again.
fn refusal_of(change: impl FnOnce(&mut Value)) -> String {
    let mut file: Value = serde_json::from_str(&by_hand().to_json().unwrap()).unwrap();
    change(&mut file["policy"]);
    match Saved::from_json(&sealed(file), "policy.json") {
        Err(Error::Policy { reason, .. }) => reason,
        other => panic!("{other:?}"),
    }
}

#[test]
fn damaged_graphs_are_refused_with_the_place() {
    for (place, bad, said) in [
        (
            "/nodes/0/next/1",
            json!(4),
            "nodes[0].next[1]: 4, and there are 4 nodes, counted from 0",
        ),
        (
            "/nodes/0/next",
            json!([0, 1]),
            "nodes[0].next: 2 items where 3 belong",
        ),
        (
            "/nodes/0/next",
            json!([0, 1, 2, 3]),
            "nodes[0].next: 4 items where 3 belong",
        ),
        (
            "/nodes/2/action",
            json!(3),
            "nodes[2].action: 3, and there are 3 actions",
        ),
        (
            "/nodes/1/visits",
            json!(1.5),
            "nodes[1].visits: 1.5 is no share",
        ),
        (
            "/nodes/1/gone/2",
            json!(-0.5),
            "nodes[1].gone[2]: -0.5 is no share",
        ),
        (
            "/nodes/3/gone",
            json!([0.5]),
            "nodes[3].gone: 1 items where 0 belong",
        ),
        ("/nodes", json!([]), "nodes: the list is empty"),
        (
            "/signals",
            json!(["bright"]),
            "nodes[0].next: 3 items where 2 belong",
        ),
        (
            "/signals/1",
            json!("bright"),
            "signals[1]: `bright` is there already",
        ),
        ("/signals", json!([]), "signals: the list is empty"),
        (
            "/actions/0",
            json!("ST\u{7}OP"),
            "actions[0]: the control character",
        ),
        ("/planned_value", json!(1e61), "planned_value"),
        ("/nodes/0/mode", json!(0), "unknown field `mode`"),
        ("/states", json!(["y"]), "unknown field `states`"),
        ("/nodes/0/next/0", json!(-1), "invalid value"),
        ("/nodes/0/next/0", json!(1.0), "invalid type"),
    ] {
        let reason = refusal_of(|policy| {
            let (table, key) = place.rsplit_once('/').unwrap();
            match policy.pointer_mut(place) {
                Some(value) => *value = bad,
                None => policy.pointer_mut(table).unwrap()[key] = bad,
            }
        });
        assert!(reason.contains(said), "{place}: {reason}");
    }
    for key in ["problem", "fingerprint", "solver", "actions", "nodes"] {
        let reason = refusal_of(|policy| {
            policy.as_object_mut().unwrap().remove(key);
        });
        assert!(
            reason.contains(&format!("missing field `{key}`")),
            "{reason}"
        );
    }
    // What cannot be read again is not written.
    let mut graph = by_hand();
    graph.nodes[1].next[0] = 9;
    let error = graph.to_json().unwrap_err().to_string();
    assert!(
        error.contains("cannot be kept in a file: nodes[1].next[0]: 9"),
        "{error}"
    );
}

#[test]
fn a_step_allocates_nothing() {
    let mut runner = GraphRunner::new(&by_hand());
    let mut nodes = 0;
    let counted = allocation_counter::measure(|| {
        for time in 0..200 {
            if time % 50 == 0 {
                runner.reset();
            }
            nodes += runner.decide().0;
            runner.observe(Reading::Symbol(time % 3));
        }
    });
    assert!(nodes > 0);
    assert_eq!(counted.count_total, 0);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]

    #[test]
    fn any_graph_is_read_as_it_was_written(graph in any_graph()) {
        let text = graph.to_json().unwrap();
        let read = Saved::from_json(&text, "policy.json").unwrap();
        prop_assert_eq!(read, Saved::Graph(graph));
    }

    /// Any number of a file put elsewhere is refused, or leads nowhere outside.
    #[test]
    fn no_number_leads_outside(graph in any_graph(), node in any::<prop::sample::Index>(), to in 0usize..40, signals in prop::collection::vec(0u32..6, 0..30)) {
        let mut file: Value = serde_json::from_str(&graph.to_json().unwrap()).unwrap();
        let node = node.index(graph.nodes.len());
        for key in ["next", "action"] {
            match &mut file["policy"]["nodes"][node][key] {
                Value::Array(list) => list.iter_mut().for_each(|next| *next = json!(to)),
                Value::Null => {}
                value => *value = json!(to % 4),
            }
        }
        if let Ok(Saved::Graph(read)) = Saved::from_json(&sealed(file), "policy.json") {
            let mut runner = GraphRunner::new(&read);
            for signal in signals {
                let (node, action) = runner.decide();
                prop_assert!(node < read.nodes.len() && action < read.actions.len());
                runner.observe(Reading::Symbol(signal));
            }
        }
    }
}
