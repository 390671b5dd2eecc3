// @ts-check
// The rover on its track from the side, at one time: heights and widths have the same scale, and the camera goes with it.

import { color } from "../chart.js";
import { h, shown } from "../dom.js";
import { VIPER } from "./drive_motion.js";
import { drawGhost, drawRover } from "./drive_rover.js";

const NIGHT = { sky: ["#05080f", "#101a2a"], far: "#141d2b", near: "#1b2534", earth: ["#6b6f76", "#2b2f36"], line: "#c9ced6", beyond: "#8b929d", ink: "#eef3f9", muted: "#b6c2d0",
  band: "rgb(108 178 255 / 0.75)", prior: "#f0b35c", outside: "#f2c46e", event: "#ff9aa3", good: "#6fd8a3", rut: "#4a4e55" };
export const LEGEND = /** @type {const} */ ({ band: "#6cb2ff", prior: NIGHT.prior, outside: NIGHT.outside });
const SAMPLES = 150;
const FLASH_S = 1.4;
const STARS = 90;
const TONE = /** @type {Record<string, string>} */ ({ sticks: NIGHT.event, slides: NIGHT.event, goes_on: NIGHT.good, passes: NIGHT.good, arrives: NIGHT.good });

export class Scene {
  constructor() {
    this.canvas = h("canvas", { role: "img", "aria-label": "Side view of the rover" });
    this.element = h("div.scene", {}, this.canvas);
    this.pen = /** @type {CanvasRenderingContext2D} */ (this.canvas.getContext("2d"));
    /** @type {import("./drive_motion.js").Motion | undefined} */
    this.motion = undefined;
    /** @type {{event: string, words: string, time_s: number, x_m: number}[]} */
    this.events = [];
    /** @type {{from_m: number, to_m: number}[]} */
    this.outside = [];
    /** @type {number | null} */
    this.until = null;
    this.calm = matchMedia("(prefers-reduced-motion: reduce)");
    this.time = 0;
    [this.width, this.height, this.scale] = [0, 0, 100];
    this.sizes = new ResizeObserver(() => this.#size());
    this.sizes.observe(this.element);
  }

  destroy() {
    this.sizes.disconnect();
  }

  /** @param {import("./drive_motion.js").Motion} motion @param {{events: any[], outside: any[], until: number | null}} more */
  show(motion, { events, outside, until }) {
    Object.assign(this, { motion, events, outside, until });
  }

  #size() {
    const { clientWidth: width, clientHeight: height } = this.element;
    if (width < 40 || height < 40) return;
    const grain = Math.min(2, devicePixelRatio || 1);
    Object.assign(this.canvas, { width: Math.round(width * grain), height: Math.round(height * grain) });
    Object.assign(this, { width, height, grain, scale: Math.min(105, height / 3.9, Math.max(56, width / 6.5)) });
    this.font = color("--font");
    this.draw(this.time, false);
  }

  /** @param {number} time @param {boolean} playing */
  draw(time, playing) {
    this.time = time;
    if (!this.motion || !this.width) return undefined;
    const moment = this.motion.at(time);
    const { pen, scale, width, height } = this;
    pen.setTransform(this.grain ?? 1, 0, 0, this.grain ?? 1, 0, 0);
    const middle = [(moment.rear[0] + moment.front[0]) / 2, (moment.rear[1] + moment.front[1]) / 2];
    this.left = width * 0.46 - middle[0] * scale;
    this.top = height * 0.68 + middle[1] * scale;
    this.#sky(middle);
    this.#ground(moment);
    this.#flag();
    if (moment.prior) this.#ghost(moment.prior);
    this.#standing(moment, () => drawRover(pen, { turned: moment.turned, brake: moment.brake, driven: moment.torque > 0 && !moment.brake }));
    this.#events(time, playing);
    if (!playing) this.#tell(moment);
    return moment;
  }

  /** Across and down on the picture. @param {[number, number]} place  m @returns {[number, number]} */
  #at([across, up]) {
    return [/** @type {number} */ (this.left) + across * this.scale, /** @type {number} */ (this.top) - up * this.scale];
  }

  /** With the pen as `drawRover` wants it. @param {import("./drive_motion.js").Pose} pose @param {() => void} draw */
  #standing({ rear, pitch }, draw) {
    const { pen, scale } = this;
    pen.save();
    pen.translate(...this.#at(rear));
    pen.scale(scale, -scale);
    pen.rotate(pitch);
    draw();
    pen.restore();
  }

  /** @param {number[]} middle */
  #sky([across]) {
    const { pen, width, height } = this;
    const dark = pen.createLinearGradient(0, 0, 0, height);
    NIGHT.sky.forEach((each, end) => dark.addColorStop(end, each));
    pen.fillStyle = dark;
    pen.fillRect(0, 0, width, height);
    for (let star = 0; star < STARS; star++) {
      pen.fillStyle = `rgb(255 255 255 / ${(0.25 + 0.6 * chance(star, 1)).toFixed(2)})`;
      const size = 0.6 + 1.1 * chance(star, 2);
      pen.fillRect(wrapped(chance(star, 3) * width - across * 2, width), chance(star, 4) * height * 0.75, size, size);
    }
    pen.fillStyle = "#5b8fc7";
    pen.beginPath();
    pen.arc(width - 56, 44, 11, 0, 2 * Math.PI);
    pen.fill();
    pen.fillStyle = "rgb(5 8 15 / 0.6)";
    pen.beginPath();
    pen.arc(width - 51, 41, 10, 0, 2 * Math.PI);
    pen.fill();
    for (const [layer, [tint, speed, high]] of /** @type {[string, number, number][]} */ ([[NIGHT.far, 6, 0.46], [NIGHT.near, 16, 0.56]]).entries()) {
      pen.fillStyle = tint;
      pen.beginPath();
      pen.moveTo(0, height);
      for (let x = 0; x <= width + 12; x += 12) {
        const at = (x + across * speed) / 150;
        pen.lineTo(x, height * high - 16 * Math.sin(at * 1.1 + layer * 2) - 9 * Math.sin(at * 2.7 + layer) - 4 * Math.sin(at * 6.1));
      }
      pen.lineTo(width, height);
      pen.fill();
    }
  }

  /** @param {import("./drive_motion.js").Moment} moment */
  #ground(moment) {
    const { pen, height, outside } = this;
    const { ground } = /** @type {import("./drive_motion.js").Motion} */ (this.motion);
    const reach = 0.85 * (this.width / this.scale) + 1;
    const [low, high] = [moment.x - reach, moment.x + reach + 1];
    const line = (/** @type {number} */ from, /** @type {number} */ to, depth = 0) => {
      const count = Math.max(2, Math.ceil((SAMPLES * (to - from)) / (high - low)));
      for (let row = 0; row <= count; row++) {
        const [x, y] = this.#at(ground.at(from + ((to - from) * row) / count));
        pen.lineTo(x, y + depth);
      }
    };
    const tint = pen.createLinearGradient(0, height * 0.45, 0, height);
    NIGHT.earth.forEach((each, end) => tint.addColorStop(end, each));
    pen.beginPath();
    line(low, high);
    pen.lineTo(this.width + 400, height + 400);
    pen.lineTo(-400, height + 400);
    pen.fillStyle = tint;
    pen.fill();
    this.#rocks(low, high);
    const stroked = (/** @type {string} */ shade, /** @type {number} */ wide, /** @type {number} */ from, /** @type {number} */ to, depth = 0) => {
      if (to <= low || from >= high) return;
      pen.beginPath();
      line(Math.max(low, from), Math.min(high, to), depth);
      pen.strokeStyle = shade;
      pen.lineWidth = wide;
      pen.stroke();
    };
    stroked(NIGHT.line, 1.5, low, Math.min(high, ground.end));
    pen.setLineDash([6, 5]);
    stroked(NIGHT.beyond, 1.5, Math.max(low, ground.end), high); // the last slope goes on
    pen.setLineDash([]);
    stroked(NIGHT.rut, 5, Math.min(0, moment.x), Math.max(0, moment.x) + VIPER.wheelbase, 1.5);
    for (const { from_m: from, to_m: to } of outside) stroked(NIGHT.outside, 3, from, Math.max(to, from + 0.05), 6);
    if (moment.band) stroked(NIGHT.band, 7, moment.band[0], Math.max(moment.band[1], moment.band[0] + 0.01), 12);
    this.#posts(low, high);
  }

  /** @param {number} low @param {number} high */
  #rocks(low, high) {
    const { pen, scale } = this;
    const { ground } = /** @type {import("./drive_motion.js").Motion} */ (this.motion);
    for (let cell = Math.floor(low / 0.22); cell * 0.22 < high; cell++) {
      const [x, y] = this.#at(ground.at(cell * 0.22));
      const size = 1 + 4 * chance(cell, 5) ** 3;
      pen.fillStyle = chance(cell, 6) > 0.5 ? "rgb(255 255 255 / 0.10)" : "rgb(0 0 0 / 0.22)";
      pen.beginPath();
      pen.ellipse(x, y + 6 + chance(cell, 7) * scale * 0.9, size * 1.6, size, 0, 0, 2 * Math.PI);
      pen.fill();
    }
  }

  /** A mark for each metre of the rear wheel's way. @param {number} low @param {number} high */
  #posts(low, high) {
    const { pen } = this;
    const { ground } = /** @type {import("./drive_motion.js").Motion} */ (this.motion);
    pen.fillStyle = NIGHT.ink;
    pen.strokeStyle = NIGHT.ink;
    pen.lineWidth = 1;
    pen.font = `11px ${this.font}`;
    pen.textAlign = "center";
    for (let metre = Math.ceil(low); metre <= high; metre++) {
      const [x, y] = this.#at(ground.at(metre));
      const whole = metre % 5 === 0;
      pen.globalAlpha = whole ? 1 : 0.55;
      pen.beginPath();
      pen.moveTo(x, y + 20);
      pen.lineTo(x, y + (whole ? 28 : 24));
      pen.stroke();
      if (whole || this.scale > 70) pen.fillText(`${metre} m`.replace("-", "−"), x, y + 40);
    }
    pen.globalAlpha = 1;
  }

  #flag() {
    if (this.until === null) return;
    const { pen } = this;
    const [x, y] = this.#at(/** @type {import("./drive_motion.js").Motion} */ (this.motion).ground.at(this.until));
    if (x < -30 || x > this.width + 30) return;
    pen.strokeStyle = NIGHT.ink;
    pen.lineWidth = 2;
    pen.beginPath();
    pen.moveTo(x, y);
    pen.lineTo(x, y - 74);
    pen.stroke();
    pen.fillStyle = NIGHT.good;
    pen.beginPath();
    pen.moveTo(x, y - 74);
    pen.lineTo(x + 24, y - 65);
    pen.lineTo(x, y - 56);
    pen.fill();
  }

  /** @param {import("./drive_motion.js").Pose} pose */
  #ghost(pose) {
    const { pen, width } = this;
    const [x, y] = this.#at(pose.rear);
    this.#standing(pose, () => drawGhost(pen, NIGHT.prior, 1.6 / this.scale));
    const far = x > width - 10 || x < -1.4 * this.scale;
    pen.fillStyle = NIGHT.prior;
    pen.font = `12px ${this.font}`;
    if (far) {
      const ahead = x > 0;
      pen.textAlign = ahead ? "right" : "left";
      pen.fillText(ahead ? `prior at ${shown(pose.x, 1)} m →` : `← prior at ${shown(pose.x, 1)} m`, ahead ? width - 10 : 10, this.height * 0.4);
    } else {
      pen.textAlign = "center";
      pen.fillText("prior", x, Math.max(14, y - 2.25 * this.scale));
    }
  }

  /** @param {number} time @param {boolean} playing */
  #events(time, playing) {
    const { pen } = this;
    const { ground } = /** @type {import("./drive_motion.js").Motion} */ (this.motion);
    for (const [row, { event, words, time_s, x_m }] of this.events.entries()) {
      if (time_s > time + 1e-9) continue;
      const [x, y] = this.#at(ground.at(x_m));
      const since = time - time_s;
      pen.fillStyle = pen.strokeStyle = TONE[event] ?? NIGHT.ink;
      pen.lineWidth = 2;
      pen.beginPath();
      pen.arc(x, y + 16, 4.5, 0, 2 * Math.PI);
      pen.fill();
      pen.font = `600 12px ${this.font}`;
      pen.textAlign = "center";
      pen.fillText(words, x, y + 56 + 15 * (row % 2));
      if (since > FLASH_S || !playing || this.calm.matches) continue;
      pen.globalAlpha = 1 - since / FLASH_S;
      pen.beginPath();
      pen.arc(x, y + 16, 6 + 30 * since, 0, 2 * Math.PI);
      pen.stroke();
      pen.globalAlpha = 1;
    }
  }

  /** For who does not see it, and for the tests. @param {import("./drive_motion.js").Moment} moment */
  #tell(moment) {
    const words = [`Side view at ${shown(moment.time, 1)} s: rover at ${shown(moment.x, 2)} m`, `slope ${shown(moment.slope, 1)} degrees`, `speed ${shown(moment.speed, 2)} metres per second`];
    if (moment.prior) words.push(`prior at ${shown(moment.prior.x, 2)} m`);
    this.canvas.setAttribute("aria-label", words.join(", "));
    Object.assign(this.canvas.dataset, { time: moment.time, x: moment.x, across: moment.rear[0], up: moment.rear[1], pitch: moment.pitch, prior: moment.prior?.x ?? "" });
  }
}

/** A number from 0 to 1 that is the same each time. @param {number} one @param {number} other */
function chance(one, other) {
  const value = Math.sin(one * 127.1 + other * 311.7) * 43758.5453;
  return value - Math.floor(value);
}

/** @param {number} value @param {number} width */
function wrapped(value, width) {
  return ((value % width) + width) % width;
}
