"""Returns of POMDPPlanners' PFT-DPW and POMCPOW on two light-dark problems, beside a hand rule and the automata of pilotage.

    pip install -r scripts/compare-pomdpplanners.txt
    cargo build --release
    python3 scripts/compare-pomdpplanners.py --pilotage target/release/pilotage --episodes 300 --out docs/data/pomdpplanners.json \
        --page docs/pomdpplanners.md

Prints a Markdown table, writes it as a page, and the same numbers, with every episode's return, as JSON. All methods keep the package's weighted particle
belief and meet the same worlds: start and noise of the readings come from a generator of the episode, the search from another. Automata are
planned before, for the same problems as model files say them, run in worlds of their own, and keep their own belief; their time for a decision
has the belief and the world in it. Returns are the same for the same seed; times are not.
"""

import argparse
import json
import logging
import math
import os
import platform
import random
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, dataclass
from functools import partial

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[variable] = "1"  # Before numpy is loaded: one core, so that times mean the same everywhere.

import numpy as np
import POMDPPlanners
from POMDPPlanners.core.belief import get_initial_belief
from POMDPPlanners.core.distributions import Distribution
from POMDPPlanners.core.environment import DiscreteActionsEnvironment, SpaceInfo, SpaceType
from POMDPPlanners.planners.mcts_planners.pft_dpw import PFT_DPW
from POMDPPlanners.planners.mcts_planners.pomcpow import POMCPOW
from POMDPPlanners.utils.action_samplers import DiscreteActionSampler

STOP = 0
ACTIONS = (-1, STOP, 1)
ENDED = math.nan  # The state after the end: a position that is none.
NO_READING = 0.0
START_MEAN, START_DEVIATION = 2.0, 3.0
DISCOUNT = 0.9
STEPS = 100
RULE_DEVIATION = 0.5
DEPTH = 20
ACTION_WIDENING = {"k_a": 2, "alpha_a": 0}
MODELS = {"LD(5)": "light-dark-5", "LD(10)": "light-dark-10"}
"""Built-in problems of pilotage that are the same, automata of at most `NODES` nodes for which are run for so many episodes."""
NODES = 30
EPISODES = 20_000
PLANNERS = {"PFT-DPW": PFT_DPW, "POMCPOW": POMCPOW}
SETTINGS = {
    "PFT-DPW": {"exploration_share": 1.0, "k_o": 4, "alpha_o": 1 / 10},
    "POMCPOW": {"exploration_share": 0.9, "k_o": 5, "alpha_o": 1 / 15},
}
"""Depth, exploration as a share of the reward, and widening of observations are those of the authors' experiment on light-dark (Sunberg and
Kochenderfer, "Online algorithms for POMDPs with continuous state, action, and observation spaces", ICAPS 2018; file
`icaps_2018/simpleld_table.jl` of ContinuousPOMDPTreeSearchExperiments.jl, fa080f6). Leaves are valued by random actions, as the
package does; the authors valued them by the fully observed problem. Three actions want no widening: while
children <= k_a visits^alpha_a, the package takes an action at random instead of by its bound, so k_a is below three and alpha_a is 0."""


@dataclass(frozen=True)
class Problem:
    """A light-dark problem: stop within 1 of the origin, having looked at the light to know where one is."""

    name: str
    light: float
    slope: float
    """Standard deviation of a reading per distance from the light."""
    floor: float
    """Standard deviation of a reading at the light."""
    reward: float
    """Of a stop near the origin; of one elsewhere the negative."""
    limit: float
    """Largest distance from the origin."""


PROBLEMS = (
    Problem("LD(5)", light=5.0, slope=1 / math.sqrt(2), floor=1e-2, reward=10.0, limit=math.inf),
    Problem("LD(10)", light=10.0, slope=1.0, floor=1e-4, reward=100.0, limit=100.0),
)


class Start(Distribution):
    """The Gaussian distribution of the first position."""

    def __init__(self, generator):
        self.generator = generator

    def sample(self, n_samples=1):
        return self.generator.normal(START_MEAN, START_DEVIATION, n_samples)


class LightDark(DiscreteActionsEnvironment):
    """A `Problem` as the package wants it, with the versions for many particles that it calls where an environment has them.

    States and readings are floats. `generator` draws starts and readings: `np.random` for the planners' model, one's own for the world.
    """

    def __init__(self, problem, generator):
        spaces = SpaceInfo(action_space=SpaceType.DISCRETE, observation_space=SpaceType.CONTINUOUS)
        super().__init__(DISCOUNT, problem.name, spaces, reward_range=(-problem.reward, problem.reward))
        self.problem, self._generator = problem, generator

    def get_actions(self):
        return list(ACTIONS)

    def hash_action(self, action):
        return action

    def initial_state_dist(self):
        return Start(self._generator)

    def initial_observation_dist(self):
        raise NotImplementedError("there is no reading before the first move")

    def is_terminal(self, state):
        return math.isnan(state)

    def is_equal_observation(self, observation1, observation2):
        return observation1 == observation2

    def reward(self, state, action, next_state=None):
        if action != STOP or math.isnan(state):
            return 0.0
        return self.problem.reward if abs(state) < 1 else -self.problem.reward

    def reward_batch(self, states, action, next_states=None):
        if action != STOP:
            return np.zeros(len(states))
        return np.where(np.isnan(states), 0.0, np.where(np.abs(states) < 1, self.problem.reward, -self.problem.reward))

    def sample_next_state(self, state, action, n_samples=1):
        if action == STOP or math.isnan(state):
            following = ENDED
        else:
            following = max(-self.problem.limit, min(self.problem.limit, float(state) + action))
        return following if n_samples == 1 else np.full(n_samples, following)

    def sample_next_state_batch(self, states, action):
        if action == STOP:
            return np.full(len(states), ENDED)
        return np.clip(states + action, -self.problem.limit, self.problem.limit)

    def transition_log_probability(self, state, action, next_states):
        following = self.sample_next_state(state, action)
        return np.where(np.equal(next_states, following) | (np.isnan(next_states) & np.isnan(following)), 0.0, -np.inf)

    def deviation(self, position):
        """Standard deviation of a reading at a position, or at each of an array."""
        return abs(position - self.problem.light) * self.problem.slope + self.problem.floor

    def sample_observation(self, next_state, action, n_samples=1):
        if math.isnan(next_state):
            return NO_READING if n_samples == 1 else np.full(n_samples, NO_READING)
        return self._generator.normal(next_state, self.deviation(next_state), None if n_samples == 1 else n_samples)

    def observation_log_probability(self, next_state, action, observations):
        return np.array([self.observation_log_probability_single(next_state, action, o) for o in observations])

    def observation_log_probability_single(self, next_state, action, observation):
        if math.isnan(next_state):
            return 0.0
        deviation = self.deviation(next_state)
        return -0.5 * ((observation - next_state) / deviation) ** 2 - math.log(deviation * math.sqrt(2 * math.pi))

    def observation_log_probability_per_state(self, next_states, action, observation):
        deviations = self.deviation(next_states)
        logs = -0.5 * ((observation - next_states) / deviations) ** 2 - np.log(deviations * math.sqrt(2 * math.pi))
        return np.nan_to_num(logs, nan=0.0)


class HandRule:
    """Towards the light until the position is known, then to the origin, then stop."""

    def __init__(self, model):
        self.light, self.known = model.problem.light, False

    def decide(self, belief):
        mean = belief.normalized_weights @ belief.particles
        deviation = math.sqrt(belief.normalized_weights @ (belief.particles - mean) ** 2)
        self.known = self.known or deviation < RULE_DEVIATION
        if self.known and abs(mean) <= 0.5:
            return STOP
        goal = 0.0 if self.known else self.light
        return 1 if mean < goal else -1


class Search:
    """A planner of the package with a budget of simulations."""

    def __init__(self, name, simulations, model):
        settings = dict(SETTINGS[name])
        self.planner = PLANNERS[name](
            environment=model,
            discount_factor=DISCOUNT,
            depth=DEPTH,
            name=name,
            action_sampler=DiscreteActionSampler(ACTIONS),
            exploration_constant=settings.pop("exploration_share") * model.problem.reward,
            n_simulations=simulations,
            **ACTION_WIDENING,
            **settings,
        )

    def decide(self, belief):
        actions, _ = self.planner.action(belief)
        return actions[0]


def methods(budgets):
    """Name, budget and maker of a policy for a model, for every row of a problem."""
    rows = [("hand rule", None, HandRule)]
    for simulations in budgets:
        rows += [(name, simulations, partial(Search, name, simulations)) for name in PLANNERS]
    return rows


@dataclass
class Episode:
    """What came of one episode."""

    discounted: float
    outcome: str
    """`near` or `far`, where it was stopped, or `never`."""
    decisions: int
    wall_seconds: float
    cpu_seconds: float
    """Of the decisions alone, without the updates of the belief."""


def play(policy, belief, model, world):
    """One episode of a policy in the world, its belief kept with the model."""
    state = world.initial_state_dist().sample()[0]
    episode = Episode(discounted=0.0, outcome="never", decisions=0, wall_seconds=0.0, cpu_seconds=0.0)
    for step in range(STEPS):
        wall, cpu = time.perf_counter(), time.process_time()
        action = policy.decide(belief)
        episode.wall_seconds += time.perf_counter() - wall
        episode.cpu_seconds += time.process_time() - cpu
        episode.decisions += 1
        state, reading, reward = world.sample_next_step(state, action)
        episode.discounted += DISCOUNT**step * reward
        if world.is_terminal(state):
            episode.outcome = "near" if reward > 0 else "far"
            break
        belief = belief.update(action=action, observation=reading, pomdp=model)
    return episode


def evaluate(problem, make_policy, arguments):
    """The episodes of a policy, which is made anew for each."""
    model = LightDark(problem, np.random)
    warm_up(make_policy(model), model, arguments.particles)
    episodes = []
    for number in range(arguments.episodes):
        random.seed(f"{arguments.seed} {number}")
        np.random.seed([arguments.seed, number])
        world = LightDark(problem, np.random.default_rng([arguments.seed, number]))
        episodes.append(play(make_policy(model), get_initial_belief(model, arguments.particles), model, world))
    return episodes


def warm_up(policy, model, particles):
    """Compiles what is compiled at the first call, which is not to be timed."""
    belief = get_initial_belief(model, particles)
    policy.decide(belief.update(action=1, observation=model.problem.light, pomdp=model))


def summary(problem, method, simulations, episodes):
    """A row of the table."""
    returns = [episode.discounted for episode in episodes]
    decisions = sum(episode.decisions for episode in episodes)
    return {
        "problem": problem.name,
        "method": method,
        "simulations": simulations,
        "mean": float(np.mean(returns)),
        "standard_error": float(np.std(returns, ddof=1) / math.sqrt(len(returns))),
        "stopped": {outcome: sum(e.outcome == outcome for e in episodes) for outcome in ("near", "far", "never")},
        "decisions": decisions,
        "wall_milliseconds_per_decision": 1e3 * sum(e.wall_seconds for e in episodes) / decisions,
        "cpu_milliseconds_per_decision": 1e3 * sum(e.cpu_seconds for e in episodes) / decisions,
        "returns": returns,
    }


def automaton(problem, arguments):
    """A row of the table: an automaton of pilotage, on one thread."""
    with tempfile.TemporaryDirectory() as folder:
        policy = os.path.join(folder, "policy.json")
        common = ["--seed", str(arguments.seed), "--threads", "1", "--json"]
        size = ["--nodes", str(NODES), "--loss", "0", "--episodes", "100", "--out", policy]
        solved = told(arguments.pilotage, "solve", MODELS[problem.name], *size, *common)
        ran = told(arguments.pilotage, "simulate", MODELS[problem.name], "--policy", policy, "--episodes", str(EPISODES), *common)
    evaluation = ran["evaluation"]
    decisions = round(EPISODES * evaluation["steps"]["mean"])
    milliseconds = 1e3 * ran["seconds"]["evaluate"] / decisions
    return {
        "problem": problem.name,
        "method": f"pilotage {ran['pilotage']}, {ran['nodes']} nodes",
        "simulations": None,
        "episodes": EPISODES,
        "mean": evaluation["discounted"]["mean"],
        "standard_error": evaluation["discounted"]["stderr"],
        "stopped": None,
        "decisions": decisions,
        "wall_milliseconds_per_decision": milliseconds,
        "cpu_milliseconds_per_decision": milliseconds,
        "seconds_to_plan": solved["seconds"]["solve"],
    }


def told(*command):
    """What a program says as JSON."""
    return json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL).stdout)


def markdown(report):
    """The report as a table below lines on how it came about."""
    lines = [
        f"POMDPPlanners {report['pomdpplanners']}, Python {report['python']}, numpy {report['numpy']}, seed {report['seed']}, "
        f"{report['episodes']} episodes, {report['particles']} particles, one thread.",
        "",
        "| problem | method | simulations | discounted return | stopped near / far / never | CPU ms per decision |",
        "|---|---|--:|--:|--:|--:|",
    ]
    for row in report["results"]:
        stopped = " / ".join(str(count) for count in row["stopped"].values()) if row["stopped"] else ""
        lines.append(
            f"| {row['problem']} | {row['method']} | {row['simulations'] or ''} | {row['mean']:.2f} ± {row['standard_error']:.2f} "
            f"| {stopped} | {row['cpu_milliseconds_per_decision']:.3g} |"
        )
    return "\n".join(lines)


PAGE = """# Beside POMDPPlanners

Light and dark at distances 5 and 10, planned for before by `solve --nodes {nodes} --loss 0`, and searched at every step by PFT-DPW and POMCPOW
of the Python package, with the settings of the experiment of their authors; the hand rule looks at the light until it is sure enough. Time
for a decision of an automaton has its belief and the world in it ({episodes} episodes), that of a search has not. Made by

```sh
python3 scripts/compare-pomdpplanners.py --pilotage target/release/pilotage --episodes 300 --page docs/pomdpplanners.md
```

"""


def positive(text):
    """A whole number of at least 1."""
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError(f"{text} is below 1")
    return number


def read_arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--episodes", type=int, default=200, help="episodes of every method on every problem, at least 2 (default 200)")
    parser.add_argument("--particles", type=positive, default=1000, help="particles of the belief (default 1000)")
    parser.add_argument(
        "--simulations", type=positive, nargs="+", default=[100, 1000], metavar="N", help="budgets of the search (default 100 1000)"
    )
    parser.add_argument("--seed", type=int, default=1, help="0 or more (default 1)")
    parser.add_argument("--pilotage", metavar="PROGRAM", help="the program whose automata are run too")
    parser.add_argument("--out", metavar="FILE", help="where to write the JSON")
    parser.add_argument("--page", metavar="FILE", help="where to write the table as a page")
    arguments = parser.parse_args()
    if arguments.episodes < 2 or arguments.seed < 0:
        parser.error("needs at least 2 episodes, for the standard error, and a seed of 0 or more")
    return arguments


def main():
    arguments = read_arguments()
    logging.disable(logging.INFO)  # The package tells of every environment that is made.
    results = []
    for problem in PROBLEMS:
        if arguments.pilotage:
            results.append(automaton(problem, arguments))
        for method, simulations, make_policy in methods(arguments.simulations):
            began = time.perf_counter()
            row = summary(problem, method, simulations, evaluate(problem, make_policy, arguments))
            results.append(row)
            print(
                f"{problem.name}, {method}, {simulations or 'no'} simulations: {row['mean']:.2f} ± {row['standard_error']:.2f} "
                f"in {time.perf_counter() - began:.0f} s",
                file=sys.stderr,
                flush=True,
            )
    report = {
        "pomdpplanners": POMDPPlanners.__version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "seed": arguments.seed,
        "episodes": arguments.episodes,
        "particles": arguments.particles,
        "steps": STEPS,
        "discount": DISCOUNT,
        "depth": DEPTH,
        "action_widening": ACTION_WIDENING,
        "settings": SETTINGS,
        "problems": [asdict(p) | {"limit": None if math.isinf(p.limit) else p.limit} for p in PROBLEMS],
        "results": results,
    }
    print(markdown(report))
    if arguments.page:
        with open(arguments.page, "w", encoding="utf-8") as file:
            file.write(PAGE.format(nodes=NODES, episodes=EPISODES) + markdown(report) + "\n")
    if arguments.out:
        os.makedirs(os.path.dirname(arguments.out) or ".", exist_ok=True)
        with open(arguments.out, "w", encoding="utf-8") as file:
            json.dump(report, file, indent=1)
            file.write("\n")


if __name__ == "__main__":
    main()
