"use strict";

// Plays the recorded episodes. Each `.episode` holds its recording as JSON; what is drawn follows from the number of a frame alone.

const PACE = 900; // ms from one frame to the next
const NAMESPACE = "http://www.w3.org/2000/svg";

function shape(tag, attributes, text) {
  const element = document.createElementNS(NAMESPACE, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  if (text !== undefined) element.textContent = text;
  return element;
}

const short = (x) => String(Math.round(x * 100) / 100).replace("-", "\u2212");
const percent = (weight) => `${Math.round(weight * 100)}%`;

/** Names of places, each once for places of that name that touch. */
function placeNames(places) {
  const touch = (a, b) => a[0].every((low, i) => low <= b[1][i] + 1e-9 && b[0][i] <= a[1][i] + 1e-9);
  const groups = [];
  for (const [low, high, name] of places) {
    const joined = groups.filter((group) => group.name === name && group.boxes.some((box) => touch(box, [low, high])));
    const group = { name, boxes: [[low, high], ...joined.flatMap((other) => other.boxes)] };
    groups.splice(0, groups.length, ...groups.filter((other) => !joined.includes(other)), group);
  }
  return groups.map(({ name, boxes }) => {
    const n = boxes[0][0].length;
    const low = Array.from({ length: n }, (_, i) => Math.min(...boxes.map((box) => box[0][i])));
    const high = Array.from({ length: n }, (_, i) => Math.max(...boxes.map((box) => box[1][i])));
    return { name, low, high };
  });
}

/** One variable: a track with a bell for each hypothesis above it. */
function drawTrack(recording, index, width) {
  const [low, high] = recording.bounds[0];
  const margin = 18;
  const track = 168;
  const tall = 118;
  const x = (value) => margin + ((value - low) / (high - low || 1)) * (width - 2 * margin);
  const height = track + 44;
  const frame = recording.frames[index];
  const parts = [];
  for (const [lower, upper] of recording.places) {
    parts.push(shape("rect", { class: "place", x: x(lower[0]), y: track - 12, width: Math.max(x(upper[0]) - x(lower[0]), 1), height: 24 }));
  }
  parts.push(shape("line", { class: "axis", x1: margin, x2: width - margin, y1: track, y2: track }));
  for (let tick = Math.ceil(low); tick <= high; tick += Math.max(1, Math.round((high - low) / 8))) {
    parts.push(shape("line", { class: "axis", x1: x(tick), x2: x(tick), y1: track, y2: track + 5 }));
    parts.push(shape("text", { class: "soft", x: x(tick), y: track + 28, "text-anchor": "middle" }, short(tick)));
  }
  parts.push(shape("text", { class: "soft", x: width - margin, y: track + 42, "text-anchor": "end" }, recording.states[0]));
  for (const [[at]] of recording.walls) {
    parts.push(shape("line", { class: "wall", x1: x(at), x2: x(at), y1: track - 24, y2: track + 10 }));
  }

  // A belief without variance is drawn as narrow as can be seen.
  const least = (high - low) / 120;
  const sd = (hypothesis) => Math.max(Math.sqrt(hypothesis.covariance[0]), least);
  const peaks = recording.frames.flatMap((each) => each.hypotheses.map((hypothesis) => hypothesis.weight / sd(hypothesis)));
  const highest = Math.max(...peaks);
  frame.hypotheses.forEach((hypothesis, k) => {
    const [mean] = hypothesis.mean;
    const peak = (tall * hypothesis.weight) / sd(hypothesis) / highest;
    let path = "";
    for (let step = -40; step <= 40; step += 1) {
      const z = step / 10;
      path += `${path ? "L" : "M"}${x(mean + z * sd(hypothesis))} ${track - peak * Math.exp(-z * z / 2)}`;
    }
    parts.push(shape("path", { class: k === frame.valid ? "belief" : "belief other", d: `${path}Z` }));
    const words = [hypothesis.mode, frame.hypotheses.length > 1 ? percent(hypothesis.weight) : ""].filter(Boolean).join(" ");
    if (words) parts.push(shape("text", { x: Math.min(Math.max(x(mean), margin + 24), width - margin - 24), y: track - peak - 8, "text-anchor": "middle" }, words));
  });
  for (const place of placeNames(recording.places)) {
    const middle = (x(place.low[0]) + x(place.high[0])) / 2;
    const room = place.name.length * 3.6;
    parts.push(shape("text", { x: Math.min(Math.max(middle, room + 4), width - room - 4), y: 16, "text-anchor": "middle" }, place.name));
    parts.push(shape("line", { class: "place", x1: middle, x2: middle, y1: 22, y2: track - 12 }));
  }
  parts.push(shape("circle", { class: "true", cx: x(frame.state[0]), cy: track, r: 8 }));
  return { parts, height };
}

/** Axes of the ellipse of two standard deviations: half lengths, and the angle of the first in degrees. */
function ellipse([a, b, , d]) {
  const middle = (a + d) / 2;
  const apart = Math.hypot((a - d) / 2, b);
  return {
    rx: 2 * Math.sqrt(Math.max(middle + apart, 0)),
    ry: 2 * Math.sqrt(Math.max(middle - apart, 0)),
    angle: (Math.atan2(2 * b, a - d) / 2) * (180 / Math.PI),
  };
}

/** Two variables: a map, the second one upwards. */
function drawPlane(recording, index, width) {
  const [[west, east], [south, north]] = recording.bounds;
  const margin = 10;
  const scale = Math.min((width - 2 * margin) / (east - west || 1), 440 / (north - south || 1));
  const left = (width - scale * (east - west)) / 2;
  const height = scale * (north - south) + 2 * margin;
  const x = (value) => left + (value - west) * scale;
  const y = (value) => margin + (north - value) * scale;
  const box = (name, [lower, upper]) => shape("rect", {
    class: name, x: x(lower[0]), y: y(upper[1]), width: (upper[0] - lower[0]) * scale, height: (upper[1] - lower[1]) * scale,
  });
  const frame = recording.frames[index];
  const parts = [];
  for (const place of recording.places) parts.push(box("place", place));
  for (const blocked of recording.blocked) parts.push(box("blocked", blocked));
  for (const [from, to] of recording.walls) {
    parts.push(shape("line", { class: "wall", x1: x(from[0]), y1: y(from[1]), x2: x(to[0]), y2: y(to[1]) }));
  }
  const path = recording.frames.slice(0, index + 1).map((each) => `${x(each.state[0])} ${y(each.state[1])}`);
  if (path.length > 1) parts.push(shape("path", { class: "path", d: `M${path.join("L")}` }));
  frame.hypotheses.forEach((hypothesis, k) => {
    const { rx, ry, angle } = ellipse(hypothesis.covariance);
    const [cx, cy] = [x(hypothesis.mean[0]), y(hypothesis.mean[1])];
    parts.push(shape("ellipse", {
      class: k === frame.valid ? "belief" : "belief other",
      cx, cy, rx: Math.max(rx * scale, 3), ry: Math.max(ry * scale, 3), transform: `rotate(${-angle} ${cx} ${cy})`,
    }));
  });
  for (const place of placeNames(recording.places)) {
    parts.push(shape("text", { x: (x(place.low[0]) + x(place.high[0])) / 2, y: (y(place.low[1]) + y(place.high[1])) / 2 + 4, "text-anchor": "middle" }, place.name));
  }
  parts.push(shape("circle", { class: "true", cx: x(frame.state[0]), cy: y(frame.state[1]), r: 8 }));
  for (const hypothesis of frame.hypotheses) {
    const [cx, cy] = [x(hypothesis.mean[0]), y(hypothesis.mean[1])];
    parts.push(shape("circle", { class: "mean", cx, cy, r: 4 }));
    const words = [hypothesis.mode, percent(hypothesis.weight)].filter(Boolean).join(" ");
    parts.push(shape("text", { x: cx, y: cy - 10, "text-anchor": "middle" }, words));
  }
  return { parts, height };
}

/** What a frame shows, for those who cannot see it. */
function inWords(recording, index) {
  const frame = recording.frames[index];
  const point = (values) => values.map((value, i) => `${recording.states[i]} ${short(value)}`).join(", ");
  const beliefs = frame.hypotheses.map((hypothesis) => `${percent(hypothesis.weight)} at ${point(hypothesis.mean)}${hypothesis.mode && `, ${hypothesis.mode}`}`);
  return `Step ${index}: truly at ${point(frame.state)}${frame.mode && `, ${frame.mode}`}; believed ${beliefs.join("; ")}.`;
}

class Player {
  constructor(root) {
    this.root = root;
    this.recording = JSON.parse(root.querySelector("script").textContent);
    this.last = this.recording.frames.length - 1;
    this.index = 0;
    this.timer = null;
    this.slider = root.querySelector("input");
    this.buttons = Object.fromEntries(Array.from(root.querySelectorAll("button"), (button) => [button.dataset.do, button]));
    this.svg = shape("svg", { role: "img" });
    root.querySelector(".stage").append(this.svg);
    this.buttons.play.addEventListener("click", () => (this.timer === null ? this.play() : this.pause()));
    this.buttons.back.addEventListener("click", () => this.stepTo(this.index - 1));
    this.buttons.forward.addEventListener("click", () => this.stepTo(this.index + 1));
    this.slider.addEventListener("input", () => this.stepTo(Number(this.slider.value)));
    new ResizeObserver(() => this.draw()).observe(root.querySelector(".stage"));
    this.pause();
    this.show(0);
  }

  play() {
    if (this.index === this.last) this.show(0);
    this.timer = setInterval(() => {
      this.show(this.index + 1);
      if (this.index === this.last) this.pause();
    }, PACE);
    this.buttons.play.textContent = "Pause";
    this.root.dataset.playing = "true";
    // A screen reader would otherwise read out every frame.
    this.root.querySelector(".now").setAttribute("aria-live", "off");
  }

  pause() {
    clearInterval(this.timer);
    this.timer = null;
    this.buttons.play.textContent = this.index === this.last ? "Play again" : "Play";
    this.root.dataset.playing = "false";
    this.root.querySelector(".now").setAttribute("aria-live", "polite");
  }

  stepTo(index) {
    this.show(index);
    this.pause();
  }

  show(index) {
    this.index = Math.min(Math.max(index, 0), this.last);
    this.root.dataset.frame = this.index;
    this.slider.value = this.index;
    this.slider.setAttribute("aria-valuetext", `step ${this.index} of ${this.last}`);
    this.buttons.back.disabled = this.index === 0;
    this.buttons.forward.disabled = this.index === this.last;
    const frame = this.recording.frames[this.index];
    const paid = this.recording.frames.slice(0, this.index + 1).reduce((sum, each) => sum + each.reward, 0);
    const words = {
      step: `${this.index} of ${this.last}`,
      action: frame.action || "none: the end",
      reward: short(frame.reward),
      sum: short(paid),
      mode: frame.mode,
      believed: frame.hypotheses[frame.valid]?.mode ?? "",
    };
    for (const place of this.root.querySelectorAll("[data-show]")) place.textContent = words[place.dataset.show];
    const nodes = this.root.querySelector(".nodes");
    nodes.querySelector("[aria-current]")?.removeAttribute("aria-current");
    const current = nodes.children[frame.node];
    if (current) {
      current.setAttribute("aria-current", "step");
      // `scrollIntoView` would scroll the page as well.
      nodes.scrollTop = current.offsetTop - (nodes.clientHeight - current.offsetHeight) / 2;
    }
    this.draw();
  }

  draw() {
    const width = this.root.querySelector(".stage").clientWidth;
    if (width === 0) return;
    const drawn = (this.recording.bounds.length > 1 ? drawPlane : drawTrack)(this.recording, this.index, width);
    this.svg.setAttribute("viewBox", `0 0 ${width} ${drawn.height}`);
    this.svg.setAttribute("height", drawn.height);
    this.svg.setAttribute("aria-label", inWords(this.recording, this.index));
    this.svg.replaceChildren(...drawn.parts);
  }
}

const players = Array.from(document.querySelectorAll(".episode"), (root) => new Player(root));
if (players.length > 0 && !matchMedia("(prefers-reduced-motion: reduce)").matches) players[0].play();
