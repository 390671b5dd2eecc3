// @ts-check
// Slope: one scenario by sliders. Where the rover goes, how sure that is, and whether it should drive.

import { noAnswer } from "../again.js";
import { Newest, Problem, askJson } from "../api.js";
import { Chart } from "../chart.js";
import { NumberControl, faultWords, versionControl } from "../controls.js";
import { fill, h, later, say } from "../dom.js";
import { fieldsOf, formsOf, knowledgeOf } from "../fields.js";
import { elsewhere } from "../links.js";
import { checked, leftOut, numberOf, unreadable } from "../query.js";
import { addressOf, write } from "../state.js";
import { answered, facts, judged, nearest } from "./slope_words.js";

const NAMES = /** @type {const} */ ({ slope_deg: "Slope", mass_kg: "Mass", torque_nm: "Wheel torque", horizon_s: "Time" });
const ASKED = { numbers: Object.keys(NAMES), words: ["model"] };
const POINTS = 200;
const COARSEST_S = 60; // as the service allows; a time that is too long is not to be told as a wrong step
const REST_MS = 250; // after the last change, before what may wait is asked
const KEEP_MS = 400;
const DOMAIN_MS = 1000; // so long the first question waits for the ranges of the version
const PARTS = ["prior,band,speed", "prior,speed"]; // a version without band refuses the first

/** @typedef {Record<string, number | string>} Question */

/** @param {HTMLElement} element @param {import("../state.js").State} state */
export async function mount(element, state) {
  const view = new Slope(element, await fieldsOf("prediction"), state.query.get("model") ?? "");
  view.forms = await formsOf("prediction");
  await view.open(state);
  return view;
}

class Slope {
  /** @param {HTMLElement} element @param {Record<string, import("../fields.js").Field>} fields @param {string} model */
  constructor(element, fields, model) {
    const heard = { input: () => this.#changed(), commit: () => this.#committed() };
    this.controls = Object.fromEntries(Object.entries(NAMES).map(([name, label]) => [name, new NumberControl(fields[name], label, heard)]));
    this.version = versionControl(model, () => void this.#versionChosen());
    /** @type {string | undefined} the version whose domain the sliders show */
    this.known = undefined;
    this.parts = PARTS[0];
    this.drives = true;
    /** @type {string[]} */
    this.forms = [];
    /** @type {any} */
    this.answer = undefined;
    /** @type {Question | undefined} what was asked for it by the sliders, and by all of the address */
    this.asked = this.question = undefined;
    this.note = h("div");
    this.verdict = h("div");
    this.facts = h("dl.facts");
    this.domain = h("div");
    this.runs = h("div.scroll", { tabindex: "0", role: "region", "aria-label": "Nearest runs" });
    this.near = h("details", {}, h("summary", {}, "Nearest simulated runs, and how well they were predicted unseen"), this.runs);
    this.links = h("div");
    this.charts = h("div.stack");
    this.#lay(element);
    this.position = new Chart(this.charts.children[0], { title: "Position along the slope",
      x: { key: "time_s", label: "Time", unit: "s" }, y: { key: "x_m", label: "Uphill", unit: "m" },
      lines: [{ key: "prior_x_m", label: "Prior alone", color: "--prior", dash: [6, 5] }, { key: "x_m", label: "Prediction", color: "--line" }],
      band: { lower: "x_lower_m", upper: "x_upper_m", label: "Band", color: "--band" }, sync: "slope" });
    this.speed = new Chart(this.charts.children[1], { title: "Speed along the slope", height: 180,
      x: { key: "time_s", label: "Time", unit: "s" }, y: { key: "speed_m_s", label: "Uphill", unit: "m/s" },
      lines: [{ key: "speed_m_s", label: "Prediction", color: "--line" }], sync: "slope" });
    this.newest = new Newest((asked, signal) => this.#predict(asked, signal), (answer, asked) => this.#show(answer, asked),
      (problem) => this.#refused(problem));
    this.judging = new AbortController();
    this.rest = later(REST_MS, () => void this.#judge());
    this.keep = later(KEEP_MS, () => write("slope", this.#asked(), { replace: true }));
  }

  /** @param {HTMLElement} element */
  #lay(element) {
    this.charts.append(h("div.card"), h("div.card"));
    element.append(
      h("div.head", {}, h("h1", {}, "One slope"), h("p", {}, "From rest, straight up or down. Where does the rover go, and should it drive?")),
      h("div.columns", {},
        h("form.card", { "aria-label": "Scenario", submit: (/** @type {Event} */ event) => event.preventDefault() },
          ...Object.values(this.controls).map((each) => each.element), this.version.element,
          h("p.small.muted", {}, "The coloured part of a slider is where the version has seen runs.")),
        h("div.stack", {}, h("div.card.stack", {}, this.note, this.verdict, this.facts, this.domain, this.near), this.charts,
          h("div.card", {}, h("h2", {}, "The same question elsewhere"), this.links))));
  }

  /** @param {import("../state.js").State} state */
  async open(state) {
    const faults = this.#take(state.query);
    await Promise.race([this.#domain(), new Promise((resolve) => setTimeout(resolve, DOMAIN_MS))]);
    this.#askUnless(faults);
  }

  /** @param {import("../state.js").State} state */
  async update(state) {
    const faults = this.#take(state.query);
    await this.#domain();
    this.#askUnless(faults);
  }

  /** What cannot be read is told, and nothing is asked. @param {import("../query.js").Fault[]} faults */
  #askUnless(faults) {
    if (!faults.length) {
      this.#ask();
      return;
    }
    this.#quiet();
    this.newest.drop();
    this.#clear(unreadable(faults));
    this.#complain(faults);
    say("This address cannot be read");
  }

  unmount() {
    this.rest.cancel();
    this.keep.cancel();
    this.newest.end();
    this.judging.abort();
    this.position.destroy();
    this.speed.destroy();
  }

  /** @param {URLSearchParams} query @returns {import("../query.js").Fault[]} what of it cannot be read */
  #take(query) {
    const { faults, unknown } = checked(query, ASKED);
    for (const [name, control] of Object.entries(this.controls)) control.set(numberOf(query.get(name)) ?? control.field.start);
    this.version.set(query.get("model") ?? "");
    fill(this.note, leftOut(unknown));
    return faults;
  }

  async #domain() {
    const reference = this.version.value;
    if (this.known === reference) return;
    const known = await knowledgeOf(reference);
    if (reference !== this.version.value) return;
    this.known = reference;
    this.parts = PARTS[known && !known.band ? 1 : 0];
    this.drives = known?.drives ?? true;
    for (const [name, control] of Object.entries(this.controls)) control.range(known?.ranges[name]);
  }

  async #versionChosen() {
    this.#committed();
    await this.#domain();
    this.#ask();
  }

  #changed() {
    this.keep.call();
    fill(this.note);
    this.#ask();
  }

  #committed() {
    this.keep.cancel();
    fill(this.note);
    write("slope", this.#asked());
  }

  #asked() {
    /** @type {Question} */
    const asked = Object.fromEntries(Object.entries(this.controls).map(([name, { value }]) => [name, value]));
    if (this.version.value) asked.model = this.version.value;
    return asked;
  }

  /** What may wait of the last answer is not wanted any more. */
  #quiet() {
    this.rest.cancel();
    this.judging.abort();
  }

  #ask() {
    this.#quiet();
    this.newest.ask(this.#asked());
  }

  /** @param {Question} asked @param {AbortSignal} signal @returns {Promise<{answer: any, question: Question}>} */
  async #predict(asked, signal) {
    const horizon = Number(asked.horizon_s);
    const include = this.parts; // may be others when the answer comes
    const question = { ...asked, dt_s: Number(Math.min(COARSEST_S, Math.max(0.0001, horizon / POINTS)).toPrecision(4)), include };
    try {
      return { answer: await askJson("v1/predictions", { query: question, signal }), question };
    } catch (error) {
      const without = PARTS[PARTS.indexOf(include) + 1];
      const refused = error instanceof Problem && error.fields.some(({ field }) => field === "include");
      if (!refused || without === undefined) throw error;
      this.parts = without;
      return this.#predict(asked, signal);
    }
  }

  /** @param {{answer: any, question: Question}} found @param {Question} asked */
  #show({ answer, question }, asked) {
    const { trajectory, prior, band } = answer;
    Object.assign(this, { answer, question, asked });
    this.#complain([]);
    this.charts.classList.remove("stale");
    if (band && this.position.what.band) this.position.what.band.label = `${Math.round(band.level * 100)} % band`;
    this.position.show({ ...trajectory, prior_x_m: prior?.x_m, x_lower_m: band?.x_lower_m, x_upper_m: band?.x_upper_m });
    this.speed.show(trajectory);
    fill(this.facts, ...facts(answer));
    fill(this.domain, answered(answer));
    this.charts.dataset.shown = new URLSearchParams(/** @type {any} */ (asked)).toString();
    fill(this.verdict, judged(answer, null, null));
    delete this.verdict.dataset.judged;
    this.rest.call();
  }

  /** What takes longer and can wait: how steep it may be at this torque, and how probable each outcome is. */
  async #judge() {
    const { asked, answer } = this;
    if (!asked || !answer) return;
    if (this.question) fill(this.links, elsewhere("v1/predictions", this.question, this.forms), this.#watch(asked));
    this.#nearest();
    const key = new URLSearchParams(/** @type {any} */ (asked)).toString();
    this.judging = new AbortController();
    const { signal } = this.judging;
    const { slope_deg, mass_kg, torque_nm, horizon_s, model } = asked;
    const map = { mass_kg, torque_min_nm: torque_nm, horizon_s, model, slope_min_deg: Math.min(0, Number(slope_deg)) };
    const drive = { mass_kg, track: { distance_m: [0], slope_deg: [slope_deg] }, controls: torque_nm, horizon_s,
      dt_s: Math.min(60, Number(horizon_s)), ...(model ? { model } : {}) };
    const quiet = (/** @type {unknown} */ error) => { if (!(error instanceof Problem) && !signal.aborted) throw error; };
    const [steepest, chances] = await Promise.all([
      askJson("v1/mobility", { query: map, signal }).catch(quiet),
      this.drives ? askJson("v1/drives", { body: drive, signal }).catch(quiet) : null,
    ]);
    if (signal.aborted) return; // another question was asked meanwhile
    fill(this.verdict, judged(answer, steepest, chances));
    this.verdict.dataset.judged = key;
    say(this.verdict.textContent);
  }

  /** The same slope as a drive, which can be watched. @param {Question} asked */
  #watch({ slope_deg, mass_kg, torque_nm, horizon_s, model }) {
    const drive = { mass_kg, slopes: `0:${slope_deg}`, torques: `0:${torque_nm}`, horizon_s, ...(model ? { model } : {}) };
    return this.drives && h("p.watch", {}, h("a", { href: addressOf("drive", drive) }, "Watch the rover drive it"));
  }

  #nearest() {
    const runs = this.answer?.domain.nearest_runs ?? [];
    this.near.hidden = runs.length === 0;
    fill(this.runs, nearest(runs));
  }

  /** @param {Problem} problem */
  #refused(problem) {
    this.#quiet();
    this.#clear(noAnswer(problem, () => void this.#again()));
    this.#complain(problem.faults);
    say(problem.message);
  }

  /** The service may be there again. */
  async #again() {
    this.known = undefined;
    void this.version.refill();
    await this.#domain();
    this.#ask();
  }

  /** Nothing of the answer before stays beside what is told now. @param {HTMLElement} words */
  #clear(words) {
    this.answer = this.asked = undefined;
    fill(this.verdict, words);
    delete this.verdict.dataset.judged;
    for (const each of [this.facts, this.domain, this.links]) fill(each);
    this.near.hidden = true;
    this.charts.classList.add("stale");
  }

  /** Say what is wrong where it is. @param {Problem["fields"]} faults */
  #complain(faults) {
    for (const control of Object.values(this.controls)) {
      const fault = faults.find(({ field }) => field === control.field.name);
      if (fault || control.element.classList.contains("wrong")) control.complain(faultWords(fault));
    }
    const model = faults.find(({ field }) => field === "model");
    this.version.complain(model?.message ?? "");
  }
}
