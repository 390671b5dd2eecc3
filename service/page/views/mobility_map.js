// @ts-check
// The map on a canvas: a cell for each torque and slope, hatched outside the domain, and the steepest slope as a line.
// Read with the pointer or the arrow keys; Enter or a click takes the cell.

import { color } from "../chart.js";
import { h, shown } from "../dom.js";

const LEFT = 44, RIGHT = 10, TOP = 10, BOTTOM = 42; // px, for the axes
const SCALES = {
  mean_speed_m_s: ["#440154", "#3b528b", "#21918c", "#5ec962", "#fde725"], // viridis
  slip_ratio: ["#fcfdbf", "#fc8961", "#b73779", "#51127c", "#000004"], // magma, much slip is dark
};
const EVERY = [1, 2, 5, 10, 20, 50, 100, 200]; // how many cells from one number of an axis to the next
const OUTCOMES = ["climbs", "stalls", "slides"];
/** @type {Record<string, string>} */
const WORDS = { climbs: "climbs", stalls: "stalls", slides: "slides back" };

/** @typedef {"outcome" | "mean_speed_m_s" | "slip_ratio"} Layer */

/** The layers, and what they are called. @type {Record<Layer, string>} */
export const LAYERS = { outcome: "Outcome", mean_speed_m_s: "Mean speed", slip_ratio: "Slip" };

export class MobilityMap {
  /** @param {{read: (words: string) => void, take: (torque: number, slope: number) => void}} heard */
  constructor(heard) {
    this.heard = heard;
    /** @type {any} */
    this.answer = undefined;
    /** @type {Layer} */
    this.layer = "outcome";
    this.row = this.column = 0;
    this.canvas = h("canvas", { "aria-hidden": "true" });
    this.element = h("div.map", { tabindex: "0", role: "application", "aria-roledescription": "map", "aria-label": "Mobility map" }, this.canvas);
    this.element.addEventListener("keydown", (/** @type {KeyboardEvent} */ event) => this.#key(event));
    this.element.addEventListener("pointermove", (/** @type {PointerEvent} */ event) => this.#point(event));
    this.element.addEventListener("click", (/** @type {PointerEvent} */ event) => {
      if (this.#point(event)) this.#take();
    });
    this.sizes = new ResizeObserver(() => this.draw());
    this.sizes.observe(this.element);
    this.scheme = matchMedia("(prefers-color-scheme: dark)");
    this.recolor = () => this.draw();
    this.scheme.addEventListener("change", this.recolor);
  }

  /** @param {any} answer  the map as the service answers it */
  show(answer) {
    const before = this.answer;
    this.answer = answer;
    if (before) { // stay where the reader is
      this.row = nearest(answer.torque_nm, before.torque_nm[this.row]);
      this.column = nearest(answer.slope_deg, before.slope_deg[this.column]);
    } else {
      this.row = Math.floor(answer.torque_nm.length / 2);
      this.column = 0;
    }
    this.draw();
  }

  destroy() {
    this.sizes.disconnect();
    this.scheme.removeEventListener("change", this.recolor);
  }

  /** A cell in words. @param {number} row @param {number} column */
  words(row = this.row, column = this.column) {
    const { torque_nm, slope_deg, outcome, mean_speed_m_s, slip_ratio, inside_domain } = this.answer;
    const slip = slip_ratio[row][column];
    return `${shown(torque_nm[row], 1)} N m, ${shown(slope_deg[column], 1)}°: ${WORDS[outcome[row][column]]}, mean speed ` +
      `${shown(mean_speed_m_s[row][column], 3)} m/s, ${slip === null ? "wheels stand still" : `slip ${shown(slip, 2)}`}` +
      `${inside_domain[row][column] ? "" : "; outside what was validated"}`;
  }

  /** The largest speed of the map; speeds are drawn from 0 to it. */
  get most() {
    return Math.max(0.001, ...this.answer.mean_speed_m_s.flat());
  }

  draw() {
    const { width, height } = this.element.getBoundingClientRect();
    if (!this.answer || width === 0) return;
    const scale = devicePixelRatio || 1;
    Object.assign(this.canvas, { width: Math.round(width * scale), height: Math.round(height * scale) });
    const pen = /** @type {CanvasRenderingContext2D} */ (this.canvas.getContext("2d"));
    pen.scale(scale, scale);
    this.frame = { x: LEFT, y: TOP, width: width - LEFT - RIGHT, height: height - TOP - BOTTOM };
    this.#cells(pen);
    this.#axes(pen, width, height);
    this.#steepest(pen);
    this.#cursor(pen);
  }

  /** The rectangle of a cell. @param {number} row @param {number} column */
  #cell(row, column) {
    const { x, y, width, height } = /** @type {{x: number, y: number, width: number, height: number}} */ (this.frame);
    const wide = width / this.answer.torque_nm.length;
    const high = height / this.answer.slope_deg.length;
    return { x: x + row * wide, y: y + height - (column + 1) * high, wide, high };
  }

  /** @param {CanvasRenderingContext2D} pen */
  #cells(pen) {
    const stripes = hatching(pen);
    const most = this.most;
    const flat = Object.fromEntries([...OUTCOMES, "none"].map((name) => [name, color(`--${name}`)]));
    this.answer.outcome.forEach((/** @type {string[]} */ outcomes, /** @type {number} */ row) => outcomes.forEach((outcome, column) => {
      const { x, y, wide, high } = this.#cell(row, column);
      pen.fillStyle = this.#fill(row, column, outcome, most, flat);
      pen.fillRect(x, y, wide + 0.6, high + 0.6); // no seams
      if (!this.answer.inside_domain[row][column]) {
        pen.fillStyle = stripes;
        pen.fillRect(x, y, wide + 0.6, high + 0.6);
      }
    }));
  }

  /** @param {number} row @param {number} column @param {string} outcome @param {number} most @param {Record<string, string>} flat */
  #fill(row, column, outcome, most, flat) {
    if (this.layer === "outcome") return flat[outcome];
    const value = this.answer[this.layer][row][column];
    if (value === null) return flat.none;
    if (this.layer === "mean_speed_m_s") return value < 0 ? flat.slides : ramp(SCALES.mean_speed_m_s, value / most);
    return value > 1 ? flat.slides : ramp(SCALES.slip_ratio, value);
  }

  /** @param {CanvasRenderingContext2D} pen @param {number} width @param {number} height */
  #axes(pen, width, height) {
    const { torque_nm, slope_deg } = this.answer;
    pen.fillStyle = color("--muted");
    pen.font = `12px ${color("--font")}`;
    pen.textAlign = "center";
    const apart = (/** @type {number} */ count, /** @type {number} */ room, /** @type {number} */ each) => EVERY.find((every) => (count * each) / room <= every) ?? 1000;
    const every = apart(torque_nm.length, width - LEFT - RIGHT, 46);
    torque_nm.forEach((/** @type {number} */ value, /** @type {number} */ row) => {
      const { x, wide } = this.#cell(row, 0);
      if (row % every === 0) pen.fillText(tick(value), x + wide / 2, height - BOTTOM + 16);
    });
    pen.fillText("Wheel torque (N m)", LEFT + (width - LEFT - RIGHT) / 2, height - 6);
    pen.textAlign = "right";
    const step = apart(slope_deg.length, height - TOP - BOTTOM, 26);
    slope_deg.forEach((/** @type {number} */ value, /** @type {number} */ column) => {
      const { y, high } = this.#cell(0, column);
      if (column % step === 0) pen.fillText(tick(value), LEFT - 7, y + high / 2 + 4);
    });
    pen.save();
    pen.translate(11, TOP + (height - TOP - BOTTOM) / 2);
    pen.rotate(-Math.PI / 2);
    pen.textAlign = "center";
    pen.fillText("Slope (°)", 0, 0);
    pen.restore();
  }

  /** @param {CanvasRenderingContext2D} pen */
  #steepest(pen) {
    const { steepest_climb_slope_deg: steepest, slope_deg: slopes } = this.answer;
    for (const [style, thick] of /** @type {[string, number][]} */ ([["#fff", 6], ["#10161d", 3]])) {
      pen.strokeStyle = style;
      pen.lineWidth = thick;
      pen.lineJoin = "round";
      pen.beginPath();
      let down = false;
      steepest.forEach((/** @type {number | null} */ slope, /** @type {number} */ row) => {
        if (slope === null) {
          down = false;
          return;
        }
        const { x, wide } = this.#cell(row, 0);
        const at = this.#slopeToY(slope, slopes);
        if (!down) pen.moveTo(x, at);
        pen.lineTo(x + wide / 2, at);
        if (row === steepest.length - 1 || steepest[row + 1] === null) pen.lineTo(x + wide, at);
        down = true;
      });
      pen.stroke();
    }
  }

  /** @param {number} slope @param {number[]} slopes */
  #slopeToY(slope, slopes) {
    const { high } = this.#cell(0, 0);
    const place = slopes.length > 1 ? (slope - slopes[0]) / (slopes[1] - slopes[0]) : 0;
    return this.#cell(0, 0).y + high / 2 - place * high;
  }

  /** @param {CanvasRenderingContext2D} pen */
  #cursor(pen) {
    const { x, y, wide, high } = this.#cell(this.row, this.column);
    for (const [style, thick] of /** @type {[string, number][]} */ ([["#fff", 4], ["#10161d", 2]])) {
      pen.strokeStyle = style;
      pen.lineWidth = thick;
      pen.strokeRect(x, y, wide, high);
    }
  }

  /** @param {number} row @param {number} column */
  #move(row, column) {
    const last = this.answer.torque_nm.length - 1;
    this.row = Math.min(last, Math.max(0, row));
    this.column = Math.min(this.answer.slope_deg.length - 1, Math.max(0, column));
    this.draw();
    this.heard.read(this.words());
  }

  /** @param {KeyboardEvent} event */
  #key(event) {
    if (!this.answer) return;
    const { row, column } = this;
    /** @type {Record<string, () => void>} */
    const keys = {
      ArrowRight: () => this.#move(row + 1, column), ArrowLeft: () => this.#move(row - 1, column),
      ArrowUp: () => this.#move(row, column + 1), ArrowDown: () => this.#move(row, column - 1),
      PageUp: () => this.#move(row, column + 5), PageDown: () => this.#move(row, column - 5),
      Home: () => this.#move(0, column), End: () => this.#move(Infinity, column),
      Enter: () => this.#take(), " ": () => this.#take(),
    };
    if (!(event.key in keys) || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    keys[event.key]();
  }

  /** Whether it is over a cell, which is read then. @param {PointerEvent} event */
  #point(event) {
    if (!this.answer || !this.frame) return false;
    const box = this.element.getBoundingClientRect();
    const across = (event.clientX - box.left - this.frame.x) / this.frame.width;
    const up = 1 - (event.clientY - box.top - this.frame.y) / this.frame.height;
    if (across < 0 || across >= 1 || up < 0 || up >= 1) return false;
    const row = Math.floor(across * this.answer.torque_nm.length);
    const column = Math.floor(up * this.answer.slope_deg.length);
    if (row !== this.row || column !== this.column) this.#move(row, column);
    else this.heard.read(this.words());
    return true;
  }

  #take() {
    this.heard.take(this.answer.torque_nm[this.row], this.answer.slope_deg[this.column]);
  }

  /** What the colours mean. @returns {any[]} */
  legend() {
    const box = (/** @type {string} */ name, /** @type {string} */ words) => {
      const mark = h("span.box");
      mark.style.setProperty("--swatch", `var(--${name})`);
      return h("li", {}, mark, words);
    };
    const bar = (/** @type {string[]} */ colors, /** @type {string} */ from, /** @type {string} */ to) => {
      const mark = h("span.bar");
      mark.style.background = `linear-gradient(to right, ${colors.join()})`;
      return h("li", {}, from, mark, to);
    };
    const line = h("span.swatch.solid");
    line.style.setProperty("--swatch", "var(--ink)");
    /** @type {Record<Layer, any[]>} */
    const colors = {
      outcome: OUTCOMES.map((each) => box(each, WORDS[each])),
      mean_speed_m_s: [bar(SCALES.mean_speed_m_s, "0", `${shown(this.most, 2)} m/s`), box("slides", "backwards")],
      slip_ratio: [bar(SCALES.slip_ratio, "0", "1"), box("slides", "backwards"), box("none", "wheels stand still")],
    };
    return [...colors[this.layer], h("li", {}, line, "steepest slope"), h("li.muted", {}, "hatched: outside what was validated")];
  }
}

/** @param {number} value */
function tick(value) {
  return String(Number(value.toFixed(2))).replace("-", "−");
}

/** @param {number[]} values @param {number} wanted */
function nearest(values, wanted) {
  return values.reduce((best, value, at) => (Math.abs(value - wanted) < Math.abs(values[best] - wanted) ? at : best), 0);
}

/** @param {string[]} colors @param {number} share  0 to 1 */
function ramp(colors, share) {
  const place = Math.min(1, Math.max(0, share)) * (colors.length - 1);
  const first = Math.min(colors.length - 2, Math.floor(place));
  const parts = (/** @type {string} */ text) => [1, 3, 5].map((at) => parseInt(text.slice(at, at + 2), 16));
  const [from, to] = [parts(colors[first]), parts(colors[first + 1])];
  return `rgb(${from.map((part, at) => Math.round(part + (to[at] - part) * (place - first))).join(" ")})`;
}

/** @param {CanvasRenderingContext2D} pen */
function hatching(pen) {
  const tile = document.createElement("canvas");
  tile.width = tile.height = 8;
  const brush = /** @type {CanvasRenderingContext2D} */ (tile.getContext("2d"));
  brush.strokeStyle = "rgb(10 15 20 / 0.55)";
  brush.lineWidth = 1.5;
  brush.beginPath();
  for (const at of [-8, 0, 8]) {
    brush.moveTo(at, 8);
    brush.lineTo(at + 8, 0);
  }
  brush.stroke();
  return /** @type {CanvasPattern} */ (pen.createPattern(tile, "repeat"));
}
