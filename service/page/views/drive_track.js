// @ts-check
// The editor of a track: knots that are dragged, moved by arrow keys, added, removed, or typed in a table.

import { fill, h, later, say, shown } from "../dom.js";
import { between, converted, thinned } from "./drive_ground.js";
import { Scale, svg } from "./drive_svg.js";

/** @typedef {import("./drive_ground.js").Track} Track */

const HEIGHT = 230;
const MOST_KNOTS = 60; // that can be dragged; longer ones come from files
const FEWER = 30;
const NEAR_M = 0.05; // between two knots, by pointer and keys
const STEEPEST = 45;
const REST_MS = 350;
const KINDS = {
  elevations: { words: "Elevation", x: "Horizontal", y: "Elevation", unit: "m", least: 2, digits: 3, step: 0.05, span: 1, missing: 0.4 },
  slopes: { words: "Slope", x: "Distance along the track", y: "Slope", unit: "°", least: 1, digits: 2, step: 0.5, span: 10, missing: 4 },
};

export class TrackEditor {
  /** @param {{input: (track: Track) => void, commit: (track: Track) => void}} heard  while it changes; when it rests */
  constructor(heard) {
    this.heard = heard;
    /** @type {Track} */
    this.track = { kind: "slopes", x: [0], y: [0] };
    this.chosen = 0;
    /** @type {Scale | undefined} */
    this.scale = undefined;
    this.dragged = false;
    this.picture = svg("svg", { width: "100%", height: HEIGHT, class: "track", role: "group", "aria-label": "Track", dblclick: (/** @type {MouseEvent} */ event) => this.#addAt(event) });
    this.marker = svg("g", { visibility: "hidden", "aria-hidden": "true", "pointer-events": "none" },
      svg("circle", { r: 6, fill: "var(--surface)", stroke: "var(--second)", "stroke-width": 3 }));
    this.layers = { axes: svg("g", { "aria-hidden": "true" }), earth: svg("polygon", { class: "earth" }), surface: svg("polyline", { class: "surface" }), knots: svg("g") };
    this.picture.append(...Object.values(this.layers), this.marker);
    /** @type {[number, number] | null} */
    this.place = null;
    this.room = h("div.track-room", {}, this.picture);
    this.kinds = Object.entries(KINDS).map(([kind, { words }]) =>
      h("button", { type: "button", "data-kind": kind, click: () => this.#turn(/** @type {any} */ (kind)) }, words));
    this.add = h("button", { type: "button", click: () => this.#addAfter(this.chosen) }, "Add a knot");
    this.remove = h("button", { type: "button", click: () => this.#remove(this.chosen) }, "Remove it");
    this.fewer = h("button", { type: "button", click: () => this.#thin() }, `Keep the ${FEWER} that matter`);
    this.reading = h("p.reading", {}, "");
    this.fault = h("p.fault", { role: "alert", hidden: true });
    this.rows = h("div.scroll.knots", { tabindex: "0", role: "region", "aria-label": "Knots of the track" });
    this.table = h("details", { toggle: () => this.#fillTable() }, h("summary", {}, "Knots as a table"), this.rows);
    this.element = h("div.stack.tight", {},
      h("div.row", {}, h("h2", {}, "Track"), h("span.choice", { role: "group", "aria-label": "What is drawn" }, ...this.kinds), this.add, this.remove, this.fewer),
      this.room, this.reading, this.fault, this.table);
    this.rest = later(REST_MS, () => this.heard.commit(this.track));
    this.sizes = new ResizeObserver(() => this.draw());
    this.sizes.observe(this.room);
  }

  destroy() {
    this.sizes.disconnect();
    this.rest.cancel();
  }

  get #words() {
    return KINDS[this.track.kind];
  }

  get #editable() {
    return this.track.x.length <= MOST_KNOTS;
  }

  /** @param {Track} track */
  set(track) {
    this.track = track;
    this.chosen = Math.min(this.chosen, track.x.length - 1);
    this.draw();
    this.#fillTable();
  }

  /** Say what is wrong with it; nothing: all is well. @param {string} words */
  complain(words) {
    this.fault.textContent = words;
    this.fault.hidden = words === "";
    this.picture.classList.toggle("wrong", words !== "");
  }

  /** Where the rover is, in values of the plot; null: nowhere. @param {[number, number] | null} place */
  rover(place) {
    this.place = place;
    if (!this.scale) return;
    this.marker.setAttribute("visibility", place ? "visible" : "hidden");
    if (place) this.marker.setAttribute("transform", `translate(${this.scale.across(place[0]).toFixed(1)} ${this.scale.up(place[1]).toFixed(1)})`);
  }

  /** The rover is over this place of a track of elevations. @param {number} across */
  follow(across) {
    this.rover([across, between(this.track.x, this.track.y, across)]);
  }

  draw() {
    const width = this.room.clientWidth;
    if (width < 60) return;
    const { x, y, kind } = this.track;
    const words = this.#words;
    if (!this.dragged || !this.scale) this.scale = new Scale(width, HEIGHT, ...ranges(this.track));
    const { scale, layers } = this;
    const line = kind === "slopes" ? [[scale.x[0], ...x, scale.x[1]], [y[0], ...y, y[y.length - 1]]] : [x, y];
    const points = scale.line(line[0], line[1]);
    const { bottom, top, left, right } = scale.box;
    const base = kind === "slopes" ? scale.up(0) : bottom;
    const start = scale.across(0);
    this.picture.setAttribute("viewBox", `0 0 ${width} ${HEIGHT}`);
    fill(layers.axes, scale.axes(`${words.x} (m)`, `${words.y} (${words.unit})`),
      svg("line", { x1: start, x2: start, y1: top, y2: bottom, stroke: "var(--muted)", "stroke-dasharray": "2 4" }),
      svg("text", { x: start + 4, y: bottom - 5, fill: "var(--muted)", "font-size": 11.5 }, "start"),
      kind === "slopes" && svg("line", { x1: left, x2: right, y1: base, y2: base, stroke: "var(--muted)" }));
    layers.earth.setAttribute("points", `${scale.across(line[0][0]).toFixed(1)},${base} ${points} ${scale.across(line[0].at(-1) ?? 0).toFixed(1)},${base}`);
    layers.surface.setAttribute("points", points);
    this.#place();
    if (this.place) this.rover(this.place);
    this.#mark();
  }

  /** Each knot where it is: the same elements as long as there are as many, for they have the focus and are dragged. */
  #place() {
    const { x, y } = this.track;
    const scale = /** @type {Scale} */ (this.scale);
    const { knots } = this.layers;
    const many = this.#editable ? x.length : 0;
    if (knots.childElementCount !== many) {
      const focused = knots.contains(document.activeElement);
      fill(knots, ...Array.from({ length: many }, (_, knot) => this.#knot(knot)));
      if (focused) this.#focus();
    }
    for (const [knot, each] of [...knots.children].entries()) {
      each.setAttribute("transform", `translate(${scale.across(x[knot]).toFixed(1)} ${scale.up(y[knot]).toFixed(1)})`);
      each.setAttribute("aria-valuenow", String(y[knot]));
      each.setAttribute("aria-valuetext", this.#said(knot));
      each.setAttribute("aria-label", `Knot ${knot + 1} of ${x.length}, ${this.#words.y.toLowerCase()}`);
    }
  }

  /** @param {number} knot */
  #knot(knot) {
    return svg("g", { class: "knot", role: "slider", "aria-orientation": "vertical", "data-knot": knot,
      pointerdown: (/** @type {PointerEvent} */ event) => this.#drag(event, knot), keydown: (/** @type {KeyboardEvent} */ event) => this.#key(event, knot),
      focus: () => { if (this.chosen !== knot) this.#choose(knot); } },
    svg("circle", { r: 16, fill: "transparent" }), svg("circle", { r: 6.5, class: "dot" }));
  }

  /** @param {number} knot */
  #said(knot) {
    const { x, y } = this.track;
    const { unit, digits, y: name } = this.#words;
    return `at ${shown(x[knot], digits)} m: ${name.toLowerCase()} ${shown(y[knot], digits)} ${unit}`;
  }

  #mark() {
    const { x } = this.track;
    const many = !this.#editable;
    for (const button of this.kinds) button.setAttribute("aria-pressed", String(button.dataset.kind === this.track.kind));
    for (const each of this.picture.querySelectorAll(".knot")) {
      const mine = Number(each.dataset.knot) === this.chosen;
      each.classList.toggle("chosen", mine);
      each.setAttribute("tabindex", mine ? "0" : "-1");
    }
    this.add.disabled = many || x.length === MOST_KNOTS;
    this.remove.disabled = many || x.length <= this.#words.least;
    this.fewer.hidden = !many;
    this.table.hidden = many;
    const { unit, digits, y: name } = this.#words;
    this.reading.textContent = many ? `${x.length.toLocaleString("en")} knots: too many to drag. ${name} from ${shown(Math.min(...this.track.y), digits)} to ${shown(Math.max(...this.track.y), digits)} ${unit}.`
      : `Knot ${this.chosen + 1} of ${x.length}, ${this.#said(this.chosen)}. Drag, or arrow keys (Shift: fine; Page Up and Down: the next knot). Double-click or Insert adds, Delete removes.`;
  }

  /** @param {number} knot */
  #choose(knot) {
    this.chosen = Math.min(this.track.x.length - 1, Math.max(0, knot));
    this.#mark();
  }

  #focus() {
    /** @type {any} */ (this.picture.querySelector(`[data-knot="${this.chosen}"]`))?.focus({ preventScroll: true });
  }

  /** @param {PointerEvent} event @param {number} knot */
  #drag(event, knot) {
    if (event.button !== 0) return;
    event.preventDefault();
    this.#choose(knot);
    this.#focus();
    const { left, top } = this.picture.getBoundingClientRect();
    const scale = /** @type {Scale} */ (this.scale);
    const [x, y] = scale.back(event.clientX - left, event.clientY - top);
    const off = [this.track.x[knot] - x, this.track.y[knot] - y];
    const stop = new AbortController();
    let moved = false;
    const move = (/** @type {PointerEvent} */ now) => {
      if (now.pointerId !== event.pointerId) return;
      this.dragged = moved = true;
      const [across, up] = scale.back(now.clientX - left, now.clientY - top);
      this.#move(knot, across + off[0], up + off[1]);
    };
    const end = (/** @type {PointerEvent} */ now) => {
      if (now.pointerId !== event.pointerId) return;
      stop.abort();
      this.dragged = false;
      if (!moved) return;
      this.draw();
      this.rest.cancel();
      this.heard.commit(this.track);
    };
    addEventListener("pointermove", move, { signal: stop.signal });
    for (const each of /** @type {const} */ (["pointerup", "pointercancel"])) addEventListener(each, end, { signal: stop.signal });
  }

  /** @param {number} knot @param {number} across @param {number} up */
  #move(knot, across, up) {
    const { kind } = this.track;
    const x = [...this.track.x];
    const y = [...this.track.y];
    const low = knot > 0 ? x[knot - 1] + NEAR_M : -Infinity;
    const high = knot < x.length - 1 ? x[knot + 1] - NEAR_M : Infinity;
    x[knot] = round(Math.max(low, Math.min(high, across)), 2);
    y[knot] = round(kind === "slopes" ? Math.max(-STEEPEST, Math.min(STEEPEST, up)) : up, kind === "slopes" ? 1 : 3);
    this.track = { kind, x, y };
    this.draw();
    this.#fillTable();
    this.heard.input(this.track);
  }

  /** @param {KeyboardEvent} event @param {number} knot */
  #key(event, knot) {
    const { step } = this.#words;
    const share = event.shiftKey ? 0.2 : 1;
    /** @type {Record<string, [number, number]>} */
    const moves = { ArrowUp: [0, step], ArrowDown: [0, -step], ArrowRight: [0.1, 0], ArrowLeft: [-0.1, 0] };
    /** @type {Record<string, number>} */
    const goes = { PageDown: knot + 1, PageUp: knot - 1, Home: 0, End: this.track.x.length - 1 };
    if (event.key in moves) {
      const [across, up] = moves[event.key];
      this.#move(knot, this.track.x[knot] + across * share, this.track.y[knot] + up * share);
      this.rest.call();
    } else if (event.key in goes) {
      this.#choose(goes[event.key]);
      this.#focus();
    } else if (event.key === "Delete" || event.key === "Backspace") this.#remove(knot);
    else if (event.key === "Insert") this.#addAfter(knot);
    else return;
    event.preventDefault();
  }

  /** @param {MouseEvent} event */
  #addAt(event) {
    if (!this.#editable || !this.scale) return;
    const { left, top } = this.picture.getBoundingClientRect();
    const [x, y] = this.scale.back(event.clientX - left, event.clientY - top);
    if (this.track.x.some((each) => Math.abs(each - x) < NEAR_M)) return;
    const at = this.track.x.filter((each) => each < x).length;
    this.#insert(at, round(x, 2), round(y, this.track.kind === "slopes" ? 1 : 3));
  }

  /** @param {number} knot */
  #addAfter(knot) {
    const { x, y } = this.track;
    if (x.length >= MOST_KNOTS) return;
    const last = knot === x.length - 1;
    const next = last ? x[knot] + 2 : (x[knot] + x[knot + 1]) / 2;
    if (next - x[knot] < NEAR_M) {
      say("There is no room between these knots.");
      return;
    }
    this.#insert(knot + 1, round(next, 3), last ? y[knot] : round((y[knot] + y[knot + 1]) / 2, 3));
  }

  /** @param {number} at @param {number} x @param {number} y */
  #insert(at, x, y) {
    this.#changed({ kind: this.track.kind, x: this.track.x.toSpliced(at, 0, x), y: this.track.y.toSpliced(at, 0, y) }, at);
    say(`Knot ${at + 1} added, ${this.#said(at)}`);
  }

  /** @param {number} knot */
  #remove(knot) {
    const { kind, x, y } = this.track;
    if (x.length <= this.#words.least || !this.#editable) return;
    this.#changed({ kind, x: x.toSpliced(knot, 1), y: y.toSpliced(knot, 1) }, Math.max(0, knot - 1));
    say(`Knot ${knot + 1} removed`);
  }

  /** @param {keyof typeof KINDS} kind */
  #turn(kind) {
    if (kind === this.track.kind) return;
    this.#changed(converted(this.track), 0);
    const words = kind === "slopes" ? "These slopes are the same track." : "These elevations are almost the same track: the slope between two of them is now a mean.";
    this.reading.textContent = `${words} ${this.reading.textContent}`;
    say(words);
  }

  #thin() {
    const { track, deviation } = thinned(this.track, FEWER);
    this.#changed(track, 0);
    this.reading.textContent = `${FEWER} knots kept. What was left out is at most ${shown(deviation, 3)} ${this.#words.unit} off. ${this.reading.textContent}`;
  }

  /** @param {Track} track @param {number} chosen */
  #changed(track, chosen) {
    this.rest.cancel();
    this.track = track;
    this.chosen = chosen;
    this.draw();
    this.#fillTable();
    this.heard.commit(track);
  }

  #fillTable() {
    if (!this.table.open || !this.#editable || this.rows.contains(document.activeElement)) return;
    const { x, y, kind } = this.track;
    const { y: name, unit, least } = this.#words;
    const [across, up] = kind === "slopes" ? ["distance_m", "slope_deg"] : ["horizontal_m", "elevation_m"];
    const cell = (/** @type {"x" | "y"} */ axis, /** @type {number} */ knot, /** @type {string} */ field) => h("td", {}, h("input", { type: "number", step: "any", value: this.track[axis][knot],
      "aria-label": `${field} of knot ${knot + 1}`, "data-cell": `${axis}${knot}`, input: (/** @type {any} */ event) => this.#typed(axis, knot, event.target.value),
      change: (/** @type {any} */ event) => { event.target.value = this.track[axis][knot]; this.heard.commit(this.track); } })); // what is no number becomes again what was asked
    fill(this.rows, h("table", {}, h("thead", {}, h("tr", {}, ...["Knot", across, up].map((each) => h("th", { scope: "col" }, each)), h("th", { scope: "col" }, h("span.unseen", {}, "Remove")))),
      h("tbody", {}, ...x.map((_, knot) => h("tr", {}, h("th", { scope: "row" }, knot + 1), cell("x", knot, across), cell("y", knot, up),
        h("td", {}, h("button", { type: "button", disabled: x.length <= least, "aria-label": `Remove knot ${knot + 1}`, click: (/** @type {any} */ event) => {
          event.target.blur();
          this.#remove(knot);
          /** @type {any} */ (this.rows.querySelector("button"))?.focus();
        } }, "×")))))),
    h("p.small.muted", {}, `${name} in ${unit === "°" ? "degrees" : "metres"}; it changes linearly between the knots.`));
  }

  /** @param {"x" | "y"} axis @param {number} knot @param {string} text */
  #typed(axis, knot, text) {
    if (text.trim() === "" || !Number.isFinite(Number(text))) return;
    this.track = { ...this.track, [axis]: this.track[axis].with(knot, Number(text)) };
    this.draw();
    this.heard.input(this.track);
  }
}

/** @param {number} value @param {number} digits */
function round(value, digits) {
  return Number(value.toFixed(digits));
}

/** What the plot shows of a track: all of it, with some air. @param {Track} track @returns {[[number, number], [number, number]]} */
function ranges({ kind, x, y }) {
  const { span, missing } = KINDS[kind];
  let [low, high] = [Math.min(...y), Math.max(...y)];
  if (kind === "slopes") [low, high] = [Math.min(0, low), Math.max(0, high)];
  const air = Math.max(0.12 * (high - low), (span - (high - low)) / 2, 0.05);
  const [first, last] = [Math.min(0, x[0]), Math.max(x[x.length - 1], kind === "slopes" ? 1 : 0)];
  const beyond = Math.max(0.04 * (last - first), x.length === 1 ? missing : 0);
  return [[first - beyond / 2, last + beyond], [low - (kind === "slopes" && low === 0 ? 0 : air), high + air]];
}
