use super::*;
use crate::belief::{Cells, Keeping};
use crate::model::Then;
use crate::parallel;
use crate::progress::Silent;
use crate::scenario::{Scenario, find, read};
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

/// Share of its value that a graph may lose for fewer nodes.
const SPARE: f64 = 2e-3;

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
    earned(
        scenario,
        episodes,
        || 0,
        |node: &mut usize| graph.nodes[*node].action,
        |node, _, reading| {
            let next = &graph.nodes[*node].next;
            *node = match reading {
                None => 0,
                Some(crate::belief::Reading::Symbol(symbol)) => next[symbol as usize],
                Some(_) => next[next.len() - 1],
            }
        },
    )
}

fn tiger() -> Scenario {
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
    read(text, "tiger").unwrap()
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
    let graph = &plan.policy.graph(SPARE, &Silent).unwrap();
    assert!((plan.value - exact).abs() < 1e-3, "{} {exact}", plan.value);
    assert!(
        (graph.value - exact).abs() < 1e-3,
        "{} {exact}",
        graph.value
    );
    assert_eq!(graph.nodes.len(), 5);
    let (mean, error) = earned_by_graph(&scenario, graph, 4000);
    assert!((mean - graph.value).abs() < 3.0 * error, "{mean} {error}");
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
        if let Some(graph) = &plan.policy.graph(SPARE, &Silent) {
            let (mean, error) = earned_by_graph(&scenario, graph, 4000);
            assert!(
                (graph.value - mean).abs() < 4.0 * error,
                "{} {mean} {error}",
                graph.value
            );
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
