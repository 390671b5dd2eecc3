// @ts-check
// Plays a drive: play and pause, a place in time, a speed. Frames are asked for only while it plays.

import { h, shown } from "../dom.js";

const SPEEDS = [1, 2, 5];
const CALM_MS = 500; // between two pictures where less motion is wished

export class Player {
  /** @param {(time_s: number, playing: boolean) => void} draw */
  constructor(draw) {
    this.draw = draw;
    this.time = 0;
    this.duration = 0;
    this.speed = 1;
    this.frame = 0;
    this.last = 0;
    this.drawn = 0;
    this.frames = 0;
    this.calm = matchMedia("(prefers-reduced-motion: reduce)");
    this.button = h("button.main.play", { type: "button", disabled: true, click: () => this.toggle() }, "Play");
    this.scrubber = h("input", { type: "range", min: 0, max: 0, step: "any", value: 0, "aria-label": "Time of the drive", input: () => this.seek(Number(this.scrubber.value)) });
    this.readout = h("span.readout", { "aria-hidden": "true" }, "0.0 s");
    this.speeds = SPEEDS.map((speed) => h("button", { type: "button", "data-speed": speed, "aria-pressed": String(speed === 1), click: () => this.#fast(speed) }, `${speed}×`));
    this.element = h("div.player", {}, this.button, this.scrubber, this.readout, h("span.choice", { role: "group", "aria-label": "Speed of playing" }, ...this.speeds));
  }

  get playing() {
    return this.frame !== 0;
  }

  /** A drive of this length; the time stays where it is, if it is still there. @param {number} duration_s */
  load(duration_s) {
    this.duration = duration_s;
    this.button.disabled = false;
    this.scrubber.max = String(duration_s);
    this.seek(Math.min(this.time, duration_s));
  }

  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }

  play() {
    if (this.playing || this.duration <= 0) return;
    if (this.time >= this.duration) this.time = 0;
    this.last = this.drawn = 0;
    this.frames = 0;
    this.#name();
    this.#next();
    this.button.textContent = "Pause";
  }

  pause() {
    cancelAnimationFrame(this.frame);
    this.frame = 0;
    this.button.textContent = this.time >= this.duration && this.duration > 0 ? "Play again" : "Play";
    this.draw(this.time, false);
    this.#tell();
  }

  /** @param {number} time_s */
  seek(time_s) {
    this.time = Math.min(this.duration, Math.max(0, time_s));
    this.last = 0;
    if (this.playing) return;
    this.button.textContent = this.time >= this.duration && this.duration > 0 ? "Play again" : "Play";
    this.draw(this.time, false);
    this.#tell();
  }

  destroy() {
    cancelAnimationFrame(this.frame);
    this.frame = 0;
    this.draw = () => {};
  }

  #next() {
    this.frame = requestAnimationFrame((now) => this.#step(now));
  }

  /** @param {number} now  ms */
  #step(now) {
    const passed = this.last ? Math.min(1, (now - this.last) / 1000) : 0; // a page that was hidden goes on where it was
    this.last = now;
    this.time = Math.min(this.duration, this.time + passed * this.speed);
    if (this.time >= this.duration) {
      this.pause();
      return;
    }
    if (!this.calm.matches || now - this.drawn >= CALM_MS) {
      this.drawn = now;
      this.frames += 1;
      this.draw(this.time, true);
      this.#tell();
    }
    this.#next();
  }

  #tell() {
    this.scrubber.value = String(this.time);
    this.readout.textContent = `${shown(this.time, 1)} of ${shown(this.duration, 1)} s`;
    if (!this.playing) this.#name();
  }

  #name() {
    this.scrubber.setAttribute("aria-valuetext", `${shown(this.time, 1)} of ${shown(this.duration, 1)} seconds`);
  }

  /** @param {number} speed */
  #fast(speed) {
    this.speed = speed;
    for (const button of this.speeds) button.setAttribute("aria-pressed", String(Number(button.dataset.speed) === speed));
  }
}
