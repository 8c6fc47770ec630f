use super::graph::{Grapher, Node};
use super::*;
use crate::belief::{Cells, Keeping};
use crate::model::Then;
use crate::parallel;
use crate::policy::{GraphRunner, PolicyGraph};
use crate::progress::Silent;
use crate::scenario::{Scenario, find, read};
use crate::simulate::{Agent, Options, evaluate_agent};
use crate::solve::Size;
use crate::world::{Observation, ProblemWorld, Streams, World};

/// Mean of the discounted returns that someone earns in a world, and its standard error. A mind is made for every episode.
fn earned<M>(
    scenario: &Scenario,
    episodes: usize,
    begin: impl Fn() -> M + Sync + Send,
    act: impl Fn(&mut M) -> usize + Sync + Send,
    hear: impl Fn(&mut M, usize, Option<crate::belief::Reading<'_>>) + Sync + Send,
) -> (f64, f64) {
    let returns = parallel::map(episodes, |episode| {
        let mut world = ProblemWorld::new(scenario);
        let mut draws = Streams::new(11, episode as u64);
        let mut observation = Observation::new(scenario.model.observation_dim());
        let (mut weight, mut sum, mut mind) = (1.0, 0.0, begin());
        world.reset(&mut draws);
        for _ in 0..scenario.model.episode.length {
            let action = act(&mut mind);
            let step = world.step(action, &mut draws, &mut observation);
            sum += weight * step.reward;
            weight *= scenario.model.discount;
            match step.then {
                Then::End => break,
                Then::Restart => hear(&mut mind, action, None),
                Then::Continue => hear(&mut mind, action, Some(observation.reading())),
            }
        }
        sum
    });
    let mean = returns.iter().sum::<f64>() / episodes as f64;
    let spread: f64 = returns.iter().map(|one| (one - mean).powi(2)).sum();
    (mean, spread.sqrt() / episodes as f64)
}

/// A graph may lose this share of its value for fewer nodes.
const SIZE: Size = Size {
    nodes: None,
    loss: Some(2e-3),
};

fn graph_of(plan: &PointBasedPlan, scenario: &Scenario) -> Option<PolicyGraph> {
    plan.policy.graph(&scenario.model, SIZE, &Silent)
}

/// What the vectors earn: the action of the best one, or that by one look ahead.
fn earned_by_vectors(
    scenario: &Scenario,
    plan: &PointBasedPlan,
    episodes: usize,
    ahead: bool,
) -> (f64, f64) {
    let (policy, keeping) = (&plan.policy, plan.policy.keeping());
    earned(
        scenario,
        episodes,
        || keeping.start(),
        |full: &mut Cells| match ahead {
            true => crate::policy::first_best(&policy.look_ahead(full)),
            false => policy.action(full),
        },
        |full, action, reading| match reading {
            None => *full = keeping.start(),
            Some(reading) => {
                keeping.act(full, action, 0);
                keeping.sense(full, action, 0, reading);
            }
        },
    )
}

/// What the graph earns.
fn earned_by_graph(scenario: &Scenario, graph: &PolicyGraph, episodes: usize) -> (f64, f64) {
    let agent = || -> Box<dyn Agent> { Box::new(GraphRunner::new(graph)) };
    let options = Options { episodes, seed: 11 };
    let earned = evaluate_agent(scenario, &agent, options, &Silent).discounted;
    (earned.mean, earned.stderr)
}

fn tiger() -> Scenario {
    tiger_heard(1.0)
}

/// The tiger, of which something is heard with this probability.
fn tiger_heard(present: f64) -> Scenario {
    let text = r#"
        format = 1
        name = "tiger-on-cells"
        discount = 0.95
        [state]
        names = ["door"]
        bounds = [[0.0, 1.0]]
        integer = ["door"]
        [[start]]
        mean = [0.0]
        covariance = [[0.0]]
        [[start]]
        mean = [1.0]
        covariance = [[0.0]]
        [motion]
        A = [[1.0]]
        B = [[1.0]]
        noise = [[0.0]]
        [sensor]
        symbols = { left = "0.85 - 0.7*door", right = "rest" }
        present = PRESENT
        [actions]
        LISTEN = { u = [0.0] }
        LEFT = { u = [0.0], then = "restart" }
        RIGHT = { u = [0.0], then = "restart" }
        [[reward]]
        action = "LISTEN"
        value = -1.0
        [[reward]]
        action = "LEFT"
        value = "if(door < 0.5, -100, 10)"
        [[reward]]
        action = "RIGHT"
        value = "if(door < 0.5, 10, -100)"
        [episode]
        length = 400
    "#;
    read(&text.replace("PRESENT", &format!("{present:?}")), "tiger").unwrap()
}

/// The value of the tiger problem over the difference of what was heard: 19.3714 (A. R. Cassandra's `tiger.95`).
fn tiger_by_counts() -> f64 {
    const MOST: usize = 30;
    let right = |k: usize| 1.0 / (1.0 + (0.15f64 / 0.85).powi(k as i32 - MOST as i32));
    let mut values = vec![0.0; 2 * MOST + 1];
    for _ in 0..2000 {
        let start = values[MOST];
        let listen = |k: usize| {
            let up = right(k) * 0.85 + (1.0 - right(k)) * 0.15;
            let (above, below) = (values[(k + 1).min(2 * MOST)], values[k.saturating_sub(1)]);
            -1.0 + 0.95 * (up * above + (1.0 - up) * below)
        };
        let open = |p: f64| 10.0 * p - 100.0 * (1.0 - p) + 0.95 * start;
        let value = |k: usize| listen(k).max(open(right(k))).max(open(1.0 - right(k)));
        values = (0..values.len()).map(value).collect();
    }
    values[MOST]
}

#[test]
fn the_tiger_problem_has_its_known_value() {
    let exact = tiger_by_counts();
    assert!((exact - 19.3714).abs() < 1e-3, "{exact}");
    let scenario = tiger();
    let settings = PointBased {
        apart: 1e-3,
        epsilon: 1e-6,
        rounds: 60,
        ..PointBased::default()
    };
    let plan = solve(&scenario.model, &settings, 1, &Silent).unwrap();
    let graph = &graph_of(&plan, &scenario).unwrap();
    let value = graph.planned_value.unwrap();
    assert!((plan.value - exact).abs() < 1e-3, "{} {exact}", plan.value);
    assert!((value - exact).abs() < 1e-3, "{value} {exact}");
    assert_eq!(graph.nodes.len(), 5);
    let (mean, error) = earned_by_graph(&scenario, graph, 4000);
    assert!((mean - value).abs() < 3.0 * error, "{mean} {error}");
}

/// Whoever listens until something is heard, and opens the other door, has `v = -1 + d (1 - p) v + d p (0.85 * 10 - 0.15 * 100 + d v)`, where
/// `p` is how likely something is heard and `d` the discount.
#[test]
fn a_graph_made_by_hand_has_the_value_computed_by_hand() {
    for p in [1.0, 0.8] {
        let scenario = tiger_heard(p);
        let model = &scenario.model;
        let node = |action, next: &[usize]| Node {
            action,
            next: next.to_vec(),
        };
        let nodes = vec![node(0, &[2, 1, 0]), node(1, &[]), node(2, &[])];
        let keeping = Arc::new(CellsKeeping::new(model).unwrap());
        let backup = Backup::new(keeping, model.discount, 2);
        let grapher = Grapher::new(&backup);
        let values = vec![vec![0.0; backup.keeping.states()]; nodes.len()];
        let graph = grapher.valued(nodes, values);

        let d = model.discount;
        let by_hand = (-1.0 - 6.5 * d * p) / (1.0 - d * (1.0 - p) - d * d * p);
        let apart = |value: f64| (value - by_hand).abs();
        assert!(apart(graph.value) < 1e-5, "{} {by_hand}", graph.value);
        let in_an_episode = grapher.earned(&graph.nodes, model.episode.length);
        assert!(apart(in_an_episode) < 1e-5, "{in_an_episode} {by_hand}");
        let one_step = grapher.earned(&graph.nodes, 1);
        assert!((one_step + 1.0).abs() < 1e-12);

        // Every attempt is one opening, and 1 / p times listening.
        let shares = occupied::shares(&grapher, &graph, model.episode.length);
        let listening = 1.0 / (1.0 + p);
        assert!((shares.visits[0] - listening).abs() < 2e-3);
        assert!((shares.gone[0][2] - (1.0 - p) * listening).abs() < 2e-3);

        let policy = grapher.told(model, &graph);
        let (mean, error) = earned_by_graph(&scenario, &policy, 4000);
        assert!(apart(mean) < 4.0 * error, "{mean} {error} {by_hand}");
    }
}

/// What is tuned or made smaller is worth what is said, and no more nodes are kept than may be.
#[test]
fn a_graph_is_no_larger_than_it_may_be() {
    let scenario = light(52, BINARY);
    let plan = solve(&scenario.model, &quick(), 1, &Silent).unwrap();
    let sized = |nodes| {
        let size = Size { nodes, loss: None };
        plan.policy.graph(&scenario.model, size, &Silent).unwrap()
    };
    let free = sized(None);
    let mut most = free.planned_value.unwrap();
    for nodes in [12, 6, 1] {
        let graph = sized(Some(nodes));
        assert!(graph.nodes.len() <= nodes, "{}", graph.nodes.len());
        let value = graph.planned_value.unwrap();
        assert!(value <= most + 1e-6, "{nodes}: {value} {most}");
        most = value;
        let visits: f64 = graph.nodes.iter().map(|node| node.visits).sum();
        assert!((visits - 1.0).abs() < 1e-9);
    }
}

/// A light at 5 shows where one is; to stop near 0 pays (LightDark1D of POMDPModels.jl, with the sensor given).
fn light(cells: usize, sensor: &str) -> Scenario {
    let text = format!(
        r#"
        format = 1
        name = "light"
        discount = 0.9
        [state]
        names = ["y"]
        bounds = [[-12.0, 14.0]]
        [start]
        mean = [2.0]
        covariance = [[9.0]]
        [motion]
        A = [[1.0]]
        B = [[1.0]]
        noise = [[0.0]]
        [sensor]
        {sensor}
        [actions]
        DOWN = {{ u = [-1.0] }}
        STOP = {{ u = [0.0], then = "end" }}
        UP = {{ u = [1.0] }}
        [[reward]]
        action = "STOP"
        value = -10.0
        [[reward]]
        action = "STOP"
        in = {{ y = [-1.0, 1.0] }}
        value = 20.0
        [episode]
        length = 100
        [belief]
        cells = {cells}
    "#
    );
    read(&text, "light").unwrap()
}

/// One sees the light, or does not.
const BINARY: &str =
    r#"symbols = { bright = "0.05 + 0.9/(1 + exp(-6*(1.5 - abs(y - 5))))", dark = "rest" }"#;

/// One reads where one is, best at the light.
const GRADED: &str = r#"noise = [["(abs(y - 5)/sqrt(2) + 0.01)^2"]]"#;

fn quick() -> PointBased {
    PointBased {
        beliefs: 150,
        rounds: 3,
        bins: Some(12),
        ..PointBased::default()
    }
}

/// Four times in a hundred thousand a mean of draws is lower by four standard errors.
#[test]
fn no_more_is_promised_than_is_earned() {
    for (sensor, least) in [(BINARY, 2.5), (GRADED, 3.0)] {
        let scenario = light(104, sensor);
        let plan = solve(&scenario.model, &quick(), 1, &Silent).unwrap();
        assert!(plan.value > least, "{sensor}: {}", plan.value);
        let (mean, error) = earned_by_vectors(&scenario, &plan, 4000, false);
        assert!(
            plan.value < mean + 4.0 * error,
            "{sensor}: {} {mean} {error}",
            plan.value
        );
        if let Some(graph) = &graph_of(&plan, &scenario) {
            let value = graph.planned_value.unwrap();
            let (mean, error) = earned_by_graph(&scenario, graph, 4000);
            assert!((value - mean).abs() < 4.0 * error, "{value} {mean} {error}");
        }
    }
}

#[cfg(feature = "parallel")]
#[test]
fn threads_change_nothing() {
    let scenario = light(52, GRADED);
    let settings = PointBased {
        beliefs: 40,
        rounds: 2,
        ..quick()
    };
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let pool = pool.build().unwrap();
        pool.install(|| solve(&scenario.model, &settings, 1, &Silent).unwrap())
    };
    let (one, two) = (with(1), with(2));
    assert_eq!(one.value.to_bits(), two.value.to_bits());
    assert_eq!(one.policy.vectors(), two.policy.vectors());
}

#[test]
fn what_cannot_be_planned_is_refused_with_what_would_do() {
    for (name, said) in [("cart-pole", "state variables"), ("scalar-lqg", "discount")] {
        let model = find(name).unwrap().model;
        let error = solve(&model, &PointBased::default(), 1, &Silent).unwrap_err();
        assert!(error.to_string().contains(said), "{error}");
    }
    let settings = PointBased {
        apart: 3.0,
        ..PointBased::default()
    };
    assert!(settings.validate().is_err());
    assert!(PointBased::default().validate().is_ok());
}
