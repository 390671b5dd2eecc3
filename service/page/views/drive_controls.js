// @ts-check
// What the motors are told over time, as a table beside a plot of its steps; and numbers that may be left out.

import { fill, h, say } from "../dom.js";
import { Scale, svg } from "./drive_svg.js";

/** @typedef {import("./drive_question.js").Controls} Controls */

const HEIGHT = 120;
const MOST_ROWS = 60; // shown; more come from addresses only

export class ControlsEditor {
  /** @param {{input: (controls: Controls) => void, commit: (controls: Controls) => void}} heard */
  constructor(heard) {
    this.heard = heard;
    /** @type {Controls} */
    this.controls = { time_s: [0], torque_nm: [60], brake: [false] };
    this.horizon = 20;
    this.picture = svg("svg", { width: "100%", height: HEIGHT, role: "img", "aria-label": "Torque over time" });
    this.room = h("div.track-room", {}, this.picture);
    this.rows = h("div.scroll", { tabindex: "0", role: "region", "aria-label": "Torque and brake over time, table" });
    this.add = h("button", { type: "button", click: () => this.#add() }, "Add a change");
    this.fault = h("p.fault", { role: "alert", hidden: true });
    this.element = h("div.stack.tight", {}, h("h2", {}, "Torque and brake over time"), this.room, this.rows, h("div.row", {}, this.add), this.fault);
    this.sizes = new ResizeObserver(() => this.draw());
    this.sizes.observe(this.room);
  }

  destroy() {
    this.sizes.disconnect();
  }

  /** @param {Controls} controls @param {number} horizon_s */
  set(controls, horizon_s) {
    this.controls = controls;
    this.horizon = horizon_s;
    this.draw();
    this.#fill();
  }

  /** Say what is wrong; nothing: all is well. @param {string} words */
  complain(words) {
    this.fault.textContent = words;
    this.fault.hidden = words === "";
  }

  draw() {
    const width = this.room.clientWidth;
    if (width < 60) return;
    const { time_s, torque_nm, brake } = this.controls;
    const told = torque_nm.map((torque, row) => (brake[row] ? 0 : torque));
    const end = Math.max(this.horizon, time_s[time_s.length - 1], 0.001);
    const scale = new Scale(width, HEIGHT, [0, end], [0, 1.12 * Math.max(10, ...told)]);
    const until = (/** @type {number} */ row) => (row + 1 < time_s.length ? time_s[row + 1] : end);
    const steps = told.flatMap((torque, row) => [[time_s[row], torque], [until(row), torque]]);
    const points = scale.line(steps.map(([time]) => time), steps.map(([, torque]) => torque));
    const { bottom, top } = scale.box;
    const locked = time_s.flatMap((time, row) => {
      if (!brake[row]) return [];
      const left = scale.across(time);
      const wide = Math.max(2, scale.across(until(row)) - left);
      return [svg("rect", { x: left, y: top, width: wide, height: bottom - top, class: "locked" }), wide > 36 && svg("text", { x: left + wide / 2, y: top + 14, "text-anchor": "middle", fill: "var(--bad)", "font-size": 11.5 }, "brake")];
    });
    this.picture.setAttribute("viewBox", `0 0 ${width} ${HEIGHT}`);
    this.now = svg("line", { y1: top, y2: bottom, x1: 0, x2: 0, stroke: "var(--second)", "stroke-width": 1.5, visibility: "hidden" });
    this.scale = scale;
    fill(this.picture, scale.axes("Time (s)", "Stall torque of each wheel (N m)"), ...locked,
      svg("polygon", { points: `${scale.across(0)},${bottom} ${points} ${scale.across(end)},${bottom}`, class: "earth" }), svg("polyline", { points, class: "surface" }), this.now);
    const words = time_s.slice(0, 12).map((time, row) => `from ${time} s ${brake[row] ? "brake" : torque_nm[row] === 0 ? "motors off" : `${torque_nm[row]} N m`}`);
    this.picture.setAttribute("aria-label", `Torque over time: ${words.join(", ")}${time_s.length > 12 ? ", and more" : ""}`);
  }

  /** Where the time is. @param {number | null} time_s */
  at(time_s) {
    if (!this.now || !this.scale) return;
    this.now.setAttribute("visibility", time_s === null ? "hidden" : "visible");
    if (time_s !== null) this.now.setAttribute("transform", `translate(${this.scale.across(time_s).toFixed(1)} 0)`);
  }

  #fill() {
    if (this.rows.contains(document.activeElement) && this.rows.querySelectorAll("tbody tr").length === this.controls.time_s.length) return;
    const { time_s, torque_nm, brake } = this.controls;
    this.add.hidden = time_s.length > MOST_ROWS;
    if (time_s.length > MOST_ROWS) {
      fill(this.rows, h("p.muted", {}, `${time_s.length} changes: too many to edit here.`));
      return;
    }
    const number = (/** @type {"time_s" | "torque_nm"} */ name, /** @type {number} */ row) => h("input", { type: "number", step: "any", min: 0, value: this.controls[name][row], "data-cell": `${name}${row}`,
      "aria-label": `${name === "time_s" ? "From, s" : "Torque, N m"}, change ${row + 1}`, disabled: name === "torque_nm" ? brake[row] : row === 0,
      input: (/** @type {any} */ event) => this.#typed(name, row, event.target.value), change: (/** @type {any} */ event) => this.#rested(name, row, event.target) });
    fill(this.rows, h("table", {}, h("thead", {}, h("tr", {}, ...["From (s)", "Torque (N m)", "Brake"].map((each) => h("th", { scope: "col" }, each)), h("th", { scope: "col" }, h("span.unseen", {}, "Remove")))),
      h("tbody", {}, ...time_s.map((_, row) => h("tr", {}, h("td", {}, number("time_s", row)), h("td", {}, number("torque_nm", row)),
        h("td", {}, h("input", { type: "checkbox", checked: brake[row], "aria-label": `Brake, change ${row + 1}`, change: (/** @type {any} */ event) => this.#lock(row, event.target.checked) })),
        h("td", {}, h("button", { type: "button", disabled: time_s.length === 1 || row === 0, "aria-label": `Remove change ${row + 1}`, click: () => this.#remove(row) }, "×")))))));
  }

  /** @param {"time_s" | "torque_nm"} name @param {number} row @param {string} text */
  #typed(name, row, text) {
    if (text.trim() === "" || !Number.isFinite(Number(text))) return;
    this.controls = { ...this.controls, [name]: this.controls[name].with(row, Number(text)) };
    this.draw();
    this.heard.input(this.controls);
  }

  /** A field was left: what is no number becomes again what was asked. @param {"time_s" | "torque_nm"} name @param {number} row @param {any} field */
  #rested(name, row, field) {
    field.value = this.controls[name][row];
    this.heard.commit(this.controls);
  }

  /** @param {number} row @param {boolean} locked */
  #lock(row, locked) {
    this.#changed({ ...this.controls, brake: this.controls.brake.with(row, locked) });
    /** @type {any} */ (this.rows.querySelectorAll('input[type="checkbox"]')[row])?.focus();
  }

  #add() {
    const { time_s, torque_nm, brake } = this.controls;
    const last = time_s[time_s.length - 1];
    const next = last + Math.max(1, Math.round((this.horizon - last) / 2));
    this.#changed({ time_s: [...time_s, next], torque_nm: [...torque_nm, torque_nm[torque_nm.length - 1]], brake: [...brake, false] });
    /** @type {any} */ (this.rows.querySelector("tbody tr:last-child input"))?.focus();
    say(`Change ${time_s.length + 1} added, from ${next} s`);
  }

  /** @param {number} row */
  #remove(row) {
    const { time_s, torque_nm, brake } = this.controls;
    this.#changed({ time_s: time_s.toSpliced(row, 1), torque_nm: torque_nm.toSpliced(row, 1), brake: brake.toSpliced(row, 1) });
    this.add.focus();
    say(`Change ${row + 1} removed`);
  }

  /** @param {Controls} controls */
  #changed(controls) {
    /** @type {HTMLElement | null} */ (document.activeElement)?.blur(); // its row is made anew
    this.set(controls, this.horizon);
    this.heard.commit(controls);
  }
}

/** A number that need not be given. */
export class OptionalNumber {
  /**
   * @param {import("../fields.js").Field} field @param {string} label @param {string} unit @param {string} without  what an empty field means
   * @param {{input: () => void, commit: () => void}} heard
   */
  constructor(field, label, unit, without, heard) {
    this.field = field;
    const id = `field-${field.name}`;
    this.without = without;
    /** @type {number | null} */
    this.last = null;
    this.number = h("input", { type: "number", id, step: "any", inputmode: "decimal", "aria-describedby": `${id}-hint`, input: heard.input, change: heard.commit });
    this.hint = h("span.hint", { id: `${id}-hint` }, without);
    this.element = h("div.control", { "data-field": field.name },
      h("label", { for: id, title: field.meaning }, label), h("span.entry", {}, this.number, h("span.unit", {}, unit)), this.hint);
  }

  /** @returns {number | null} */
  get value() {
    const text = this.number.value.trim();
    if (this.number.validity.badInput) return this.last; // half a number, as "-"
    this.last = text !== "" && Number.isFinite(Number(text)) ? Number(text) : null;
    return this.last;
  }

  /** @param {number | null} value */
  set(value) {
    if (value !== this.value || this.number.validity.badInput) this.number.value = value === null ? "" : String(value);
  }

  /** Say what is wrong with it; nothing: all is well. @param {string} words */
  complain(words) {
    this.element.classList.toggle("wrong", words !== "");
    if (words) this.number.setAttribute("aria-invalid", "true");
    else this.number.removeAttribute("aria-invalid");
    this.hint.textContent = words || this.without;
  }
}
