"""Runs a policy file over sensor readings: belief, node and action at every step, as CSV.

    python3 scripts/run_policy.py policy.json < readings.csv

Standard input has the readings of a step on a line, comma-separated, in the order of the sensor, each sensed after the action that was printed
before; a line `nothing` says that they are missing, a line `start` begins a new episode. For a policy graph a line has the name of the signal, and
there is no belief to print. Written from docs/policy-format.md, with nothing but Python's standard library.
"""

import csv
import json
import math
import re
import sys


def checksum(text):
    """That of the value of `policy` in the text of a file."""
    key, i = None, 0
    while key != "policy":
        key, i = json.JSONDecoder().raw_decode(text, re.compile(r"[ \t\r\n,{]*").match(text, i).end())
        begin = re.compile(r"[ \t\r\n:]*").match(text, i).end()
        _, i = json.JSONDecoder().raw_decode(text, begin)
    number = 14695981039346656037
    for byte in re.sub(r'("(?:[^"\\]|\\.)*")|[ \t\r\n]+', r"\1", text[begin:i]).encode():
        number = (number ^ byte) * 1099511628211 % 2**64
    return f"fnv1a64-{number:016x}"


def added(numbers):
    """One after the other; Python's `sum` rounds differently from version to version."""
    total = 0.0
    for x in numbers:
        total += x
    return total


def dot(a, b):
    return added(x * y for x, y in zip(a, b))


def bring(x, low, high):
    """Into [low, high), where None is no limit."""
    if high is not None:
        x = min(x, math.nextafter(high, -math.inf))
    return x if low is None else max(low, x)


class Map:
    """A drawing of cells: (column, row), counted from the south-west."""

    def __init__(self, cell, rows):
        self.cell, self.free, self.east, self.north = cell, [], set(), set()
        walled = rows[0][0] == "+"
        w = rows[0].index("+", 1) if walled else 1
        self.size = (len(rows[0]) // w, len(rows) // 2 if walled else len(rows))
        for row in range(self.size[1]):
            line = 2 * (self.size[1] - 1 - row) + 1 if walled else self.size[1] - 1 - row
            for column in range(self.size[0]):
                first = column * w + walled
                if "#" not in rows[line][first : first + max(w - 1, 1)]:
                    self.free.append((column, row))
                if walled and rows[line][first + w - 1] == "|":
                    self.east.add((column, row))
                if walled and rows[line - 1][first] == "-":
                    self.north.add((column, row))

    def index(self, x, count):
        i = min(max(math.floor(x / self.cell), -1), count)
        while i < count and (i + 1) * self.cell <= x:
            i += 1
        while i >= 0 and x < i * self.cell:
            i -= 1
        return i

    def at(self, point):
        return tuple(self.index(x, count) for x, count in zip(point, self.size))

    def into(self, point, here):
        return [bring(x, i * self.cell, (i + 1) * self.cell) for x, i in zip(point, here)]

    def confine(self, point):
        if self.at(point) in self.free or not self.free:
            return point
        near = [self.into(point, here) for here in self.free]
        apart = [[x - y for x, y in zip(p, point)] for p in near]
        squares = [dot(d, d) for d in apart]
        return near[squares.index(min(squares))]

    def stop(self, f, t):
        f = [bring(x, 0.0, count * self.cell) for x, count in zip(f, self.size)]
        d, here, target = [y - x for x, y in zip(f, t)], self.at(f), self.at(t)
        if here not in self.free:
            return f
        while here != target:
            share = [math.inf, math.inf]
            for k in (0, 1):
                if here[k] != target[k]:
                    edge = (here[k] + (target[k] > here[k])) * self.cell
                    share[k] = (edge - f[k]) / d[k]
            k = 0 if share[0] <= share[1] else 1
            up = target[k] > here[k]
            there = list(here)
            there[k] += 1 if up else -1
            there = tuple(there)
            if there not in self.free or (here if up else there) in (self.east, self.north)[k]:
                end = [x + min(max(share[k], 0.0), 1.0) * v for x, v in zip(f, d)]
                end[k] = math.inf if up else -math.inf
                return self.into(end, here)
            here = there
        return t


class Policy:
    def __init__(self, policy):
        self.policy, self.filter = policy, policy["filter"]
        self.memory = policy.get("memory") or {}
        self.walls = self.filter.get("walls")
        self.map = Map(**self.walls["map"]) if self.walls and self.walls.get("map") else None
        self.start()

    def start(self):
        start = self.policy["start"]
        self.level, self.mode, self.mean = start["level"], start["mode"], start["mean"]

    def walled(self, x, on_map):
        """All components in their bounds, or the first two as the map has them."""
        first = on_map(x[:2]) if self.map else []
        return first + [bring(v, *ends) for v, ends in zip(x, self.walls["bounds"])][len(first) :]

    def phase(self):
        """A, Bu and H of the level's step of the episode."""
        phases = [self.filter, *self.filter.get("later", [])]
        return [p for p in phases if p.get("from", 0) <= self.time()][-1]

    def time(self):
        return self.filter["levels"][self.level].get("time", 0)

    def switch(self, when, action, time):
        for s in self.memory.get("switches", []):
            first, end = s.get("steps") or (0, None)
            if not (first <= time and (end is None or time < end)):
                continue
            inside = True
            for side in s.get("region", []):
                x, (low, high) = self.mean[side["state"]], side["within"]
                inside = inside and (low is None or low <= x) and (high is None or x < high)
            acts = s.get("actions") is None or action in s["actions"]
            if inside and acts and s["when"] == when and s.get("mode") in (None, self.mode):
                return s["becomes"]
        return None

    def cluster(self, recall):
        def scaled(x):
            return [min(max((v - low) / (high - low), 0.0), 1.0) for v, (low, high) in zip(x, recall["bounds"])]

        here, distances = scaled(self.mean), []
        for centre in recall["centres"]:
            d = [z - m for z, m in zip(scaled(centre), here)]
            distances.append(dot(d, d) / len(d))
        return distances.index(min(distances))

    def update(self, action, reading):
        time, phase = self.time(), self.phase()
        becomes = self.switch("before", action, time)
        step = self.filter["levels"][self.level]["steps"][self.filter["classes"][action]]
        p = [shift + dot(row, self.mean) for row, shift in zip(phase["A"], phase["Bu"][action])]
        if self.walls:
            p = self.walled(p, lambda to: self.map.stop(self.mean, to))
        m = p
        for r, row in enumerate(phase["H"] if reading else []):
            v = reading[r] - dot(row, p)
            m = [x + k[r] * v for x, k in zip(m, step["gain"])]
        m = [min(max(x, -1e60), 1e60) for x in m]
        self.mean = self.walled(m, lambda to: self.map.confine(to)) if self.walls else m
        self.level = step["next" if reading else "blind"]
        if "recall" in self.memory:
            recall = self.memory["recall"]
            self.mode = recall["next"][self.mode][action][self.cluster(recall)]
            return
        becomes = self.switch("after", action, time) if becomes is None else becomes
        self.mode = self.mode if becomes is None else becomes

    def node(self):
        nodes, level = self.policy["nodes"], self.level
        own = [i for i, node in enumerate(nodes) if node["mode"] == self.mode] or list(range(len(nodes)))
        gaps = [max(nodes[i]["levels"][0] - level, level - nodes[i]["levels"][1], 0) for i in own]
        place, q = self.mean, [1.0 / scale for scale in self.policy["scale"]]
        if self.policy.get("coordinates"):
            place = [dot(c["vector"], self.mean) for c in self.policy["coordinates"]]
        ranks = []
        for i in (i for i, gap in zip(own, gaps) if gap == min(gaps)):
            at, volume = nodes[i]["place"], 0.0
            if self.policy["matching"] == "nearest":
                d = [x * s - y * s for x, y, s in zip(at["point"], place, q)]
            else:
                low, high = at["segment"]["lower"], at["segment"]["upper"]
                d = [max(a * s - y * s, y * s - b * s, 0.0) for a, b, y, s in zip(low, high, place, q)]
                volume = math.prod(b - a for a, b in zip(low, high))
            ranks.append((dot(d, d), volume, i))
        return min(ranks)[2]


def main(path):
    with open(path, encoding="utf-8") as file:
        text = file.read()
    content = json.loads(text)
    if content.get("format") != 2:
        sys.exit(f"{path}: this is format {content.get('format')}, and this program reads format 2")
    if content["checksum"] != checksum(text):
        sys.exit(f"{path}: damaged: its checksum is {content['checksum']}, that of its policy {checksum(text)}")
    policy = content["policy"]
    if "signals" in policy:
        return run_graph(policy)
    runner, out = Policy(policy), csv.writer(sys.stdout, lineterminator="\n")
    out.writerow(["step", "level", "mode", *policy["states"], "node", "action"])
    for step, line in enumerate(lines()):
        if line == "start":
            runner.start()
        else:
            runner.update(action, readings(line, step, len(policy["filter"]["H"])))
        node = runner.node()
        action = policy["nodes"][node]["action"]
        out.writerow([step, runner.level, runner.mode, *runner.mean, node, policy["actions"][action]])
        sys.stdout.flush()


def run_graph(policy):
    out = csv.writer(sys.stdout, lineterminator="\n")
    out.writerow(["step", "node", "action"])
    signals = [*policy["signals"], "nothing"]
    for step, line in enumerate(lines()):
        if line == "start":
            node = 0
        elif line not in signals:
            sys.exit(f"line {step}: `{line}` where {', '.join(signals)} or start belongs")
        else:
            # A signal may itself be called `nothing`: the missing reading is the last.
            signal = len(signals) - 1 if line == "nothing" else signals.index(line)
            node = (policy["nodes"][node].get("next") or [node] * len(signals))[signal]
        out.writerow([step, node, policy["actions"][policy["nodes"][node]["action"]]])
        sys.stdout.flush()


def readings(line, number, count):
    if line == "nothing":
        return None
    try:
        reading = [float(x) for x in line.split(",")]
    except ValueError:
        reading = []
    if len(reading) != count or not all(map(math.isfinite, reading)):
        sys.exit(f"line {number}: `{line}` where {count} numbers belong, `nothing`, or `start`")
    return reading


def lines():
    """A start, and then what is read."""
    yield "start"
    for line in sys.stdin:
        yield line.strip()


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])
