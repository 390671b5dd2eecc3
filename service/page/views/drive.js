// @ts-check
// Drive: a rover over a track under controls. Where it is when, what happens on the way, and whether it should drive.

import { noAnswer } from "../again.js";
import { Newest, Problem, askJson } from "../api.js";
import { Chart } from "../chart.js";
import { NumberControl, faultWords, versionControl } from "../controls.js";
import { fill, h, later, say } from "../dom.js";
import { fieldsOf, formsOf, knowledgeOf } from "../fields.js";
import { elsewherePosted } from "../links.js";
import { write } from "../state.js";
import { ControlsEditor, OptionalNumber } from "./drive_controls.js";
import { groundOf } from "./drive_ground.js";
import { ProfileLoader } from "./drive_load.js";
import { Motion } from "./drive_motion.js";
import { EXAMPLES, addressed, asked, exampleOf, questionFrom, scenarioOf, shareable } from "./drive_question.js";
import { Stage } from "./drive_stage.js";
import { TrackEditor } from "./drive_track.js";
import { answered, facts, judged, happened } from "./drive_words.js";

const POINTS = 600;
const FINEST_S = 0.05;
const COARSE = 150; // points of a drive that arrived: fewer are asked for anew
const KEEP_MS = 400;
const PARTS = [["band", "wheel_speed"], ["wheel_speed"]]; // a version without band refuses the first

/** @typedef {import("./drive_question.js").Question} Question */
/** @typedef {{answer: any, body: any, prior: any}} Found */

/** @param {HTMLElement} element @param {import("../state.js").State} state */
export async function mount(element, state) {
  const [fields, forms] = await Promise.all([fieldsOf("drive"), formsOf("prediction")]); // drives have the forms of predictions
  const view = new Drive(element, fields, forms, state);
  await view.update(state);
  return view;
}

class Drive {
  /** @param {HTMLElement} element @param {Record<string, import("../fields.js").Field>} fields @param {string[]} forms @param {import("../state.js").State} state */
  constructor(element, fields, forms, state) {
    this.forms = forms;
    const heard = { input: () => this.#changed(), commit: () => this.#committed() };
    this.numbers = { mass_kg: new NumberControl(fields.mass_kg, "Mass", heard), horizon_s: new NumberControl(fields.horizon_s, "Time at most", heard) };
    this.optional = {
      until_distance_m: new OptionalNumber(fields.until_distance_m, "Where it ends", "m", "Empty: when the time is over", heard),
      start_speed_m_s: new OptionalNumber(fields.start_speed_m_s, "Start speed", "m/s", "Empty: parked and let go", heard),
    };
    this.version = versionControl(state.query.get("model") ?? "", () => void this.#versionChosen());
    const put = (/** @type {Partial<Question>} */ part) => { this.question = { .../** @type {Question} */ (this.question), ...part }; };
    this.track = new TrackEditor({ input: (track) => { put({ track }); this.#changed(); }, commit: (track) => { put({ track }); this.#committed(); } });
    this.controls = new ControlsEditor({ input: (controls) => { put({ controls }); this.#changed(); }, commit: (controls) => { put({ controls }); this.#committed(); } });
    this.loader = new ProfileLoader((track) => { put({ track }); this.#set(); this.#committed(); });
    this.stage = new Stage((moment, playing) => this.#moved(moment, playing));
    /** @type {Question | undefined} */
    this.question = undefined;
    /** @type {string | undefined} the version whose ranges the sliders show */
    this.known = undefined;
    this.parts = PARTS[0];
    this.verdict = h("div");
    this.facts = h("dl.facts.wide");
    this.domain = h("div");
    this.events = h("div");
    this.links = h("div");
    this.note = h("p.notice.warn", { role: "status", hidden: true });
    this.charts = h("div.pairs");
    this.#lay(element);
    this.plots = this.#plots();
    this.newest = new Newest((question, signal) => this.#drive(question, signal), (found, question) => this.#show(found, question), (problem) => this.#refused(problem));
    this.keep = later(KEEP_MS, () => this.#write(true));
    this.telling = later(KEEP_MS, () => say(this.verdict.textContent)); // not of each drive while a knot is dragged
  }

  #plots() {
    const x = { key: "time_s", label: "Time", unit: "s" };
    const plot = (/** @type {number} */ row, /** @type {any} */ what) => new Chart(this.charts.children[row], { x, sync: "drive", height: 200, ...what });
    return [
      plot(0, { title: "Position along the track", y: { key: "x_m", label: "Along", unit: "m" }, band: { lower: "x_lower_m", upper: "x_upper_m", label: "Band", color: "--band" },
        lines: [{ key: "prior_x_m", label: "Prior alone", color: "--prior", dash: [6, 5] }, { key: "x_m", label: "Drive", color: "--line" }] }),
      plot(1, { title: "Speed", y: { key: "speed_m_s", label: "Along", unit: "m/s" }, lines: [{ key: "speed_m_s", label: "Drive", color: "--line" }] }),
      plot(2, { title: "Slip ratio", y: { key: "slip_ratio", label: "Slip", unit: "", decimals: 2 }, lines: [{ key: "slip_ratio", label: "Drive", color: "--second" }] }),
      plot(3, { title: "Slope under the rover", y: { key: "slope_deg", label: "Slope", unit: "°", decimals: 1 }, lines: [{ key: "slope_deg", label: "Drive", color: "--prior" }] }),
    ];
  }

  /** @param {HTMLElement} element */
  #lay(element) {
    this.charts.append(...Array.from({ length: 4 }, () => h("div.card")));
    const example = h("select", { id: "drive-example", change: () => {
      this.question = exampleOf(this.#whole(), example.value);
      this.#set();
      this.#committed();
      example.value = "";
    } }, h("option", { value: "" }, "Choose …"), ...Object.entries(EXAMPLES).map(([name, { words }]) => h("option", { value: name }, words)));
    element.append(
      h("div.head", {}, h("h1", {}, "A drive"), h("p", {}, "Draw a track, tell the motors what to do. Where does the rover go, and should it drive?")),
      h("div.columns.driving", {},
        h("form.card", { "aria-label": "Drive", submit: (/** @type {Event} */ event) => event.preventDefault() },
          h("div.control", {}, h("label", { for: "drive-example" }, "Example"), example),
          ...Object.values(this.numbers).map((each) => each.element), ...Object.values(this.optional).map((each) => each.element),
          this.controls.element, h("hr"), this.version.element),
        h("div.stack", {}, this.note, h("div.card.stage", {}, this.stage.element),
          h("div.card.stack", {}, this.verdict, this.facts, this.events, this.domain),
          h("div.card", {}, this.track.element, this.loader.element), this.charts,
          h("div.card", {}, h("h2", {}, "The same question elsewhere"), this.links))));
  }

  /** @param {import("../state.js").State} state */
  async update({ query }) {
    const { question, complaint } = questionFrom(query, this.question);
    this.question = question;
    this.loader.quiet(); // what it said was of a track that is not shown any more
    this.#note(complaint);
    this.#set();
    await this.#domain();
    this.#ask();
  }

  unmount() {
    this.keep.cancel();
    this.telling.cancel();
    this.newest.end();
    for (const each of [...this.plots, this.track, this.controls, this.stage]) each.destroy();
  }

  /** Show the question in all controls. */
  #set() {
    const question = /** @type {Question} */ (this.question);
    for (const name of /** @type {const} */ (["mass_kg", "horizon_s"])) this.numbers[name].set(question[name]);
    for (const name of /** @type {const} */ (["until_distance_m", "start_speed_m_s"])) this.optional[name].set(question[name]);
    this.version.set(question.model);
    this.track.set(question.track);
    this.controls.set(question.controls, question.horizon_s);
  }

  /** The question as the controls have it. @returns {Question} */
  #whole() {
    return { .../** @type {Question} */ (this.question), mass_kg: this.numbers.mass_kg.value, horizon_s: this.numbers.horizon_s.value,
      until_distance_m: this.optional.until_distance_m.value, start_speed_m_s: this.optional.start_speed_m_s.value, model: this.version.value };
  }

  async #domain() {
    const reference = this.version.value;
    if (this.known === reference) return;
    const known = await knowledgeOf(reference);
    if (reference !== this.version.value) return;
    this.known = reference;
    this.parts = PARTS[known && !known.band ? 1 : 0];
    for (const control of Object.values(this.numbers)) control.range(known?.ranges[control.field.name]);
  }

  async #versionChosen() {
    this.#committed();
    await this.#domain();
    this.#ask();
  }

  #changed() {
    this.keep.call();
    this.#ask();
  }

  #committed() {
    this.keep.cancel();
    this.#write(false);
    this.#ask();
  }

  /** @param {boolean} replace */
  #write(replace) {
    const question = this.#whole();
    write("drive", addressed(question), { replace });
    this.#note(shareable(question) ? "" : "This track is too long for the address. Whoever gets the address needs the file, too; or keep fewer knots.");
  }

  /** @param {string} words */
  #note(words) {
    this.note.textContent = words;
    this.note.hidden = words === "";
  }

  #ask() {
    this.question = this.#whole();
    if (this.controls.horizon !== this.question.horizon_s) this.controls.set(this.question.controls, this.question.horizon_s);
    this.newest.ask(this.question);
  }

  /** @param {Question} question @param {AbortSignal} signal @returns {Promise<Found>} */
  async #drive(question, signal) {
    const told = asked(question);
    const sampled = (/** @type {number} */ length) => Math.min(60, Math.max(FINEST_S, Number((length / POINTS).toPrecision(2))));
    let body = { ...told, dt_s: sampled(question.horizon_s), include: this.parts };
    let answer = await this.#post(body, signal);
    const { duration_s } = answer.summary;
    if (body.dt_s > FINEST_S && duration_s / body.dt_s < COARSE) {
      body = { ...body, dt_s: sampled(duration_s) };
      answer = await this.#post(body, signal);
    }
    body.include = this.parts;
    const scenario = scenarioOf(question);
    const quiet = (/** @type {unknown} */ error) => { if (!(error instanceof Problem)) throw error; };
    const prior = scenario && await askJson("v1/predictions", { query: { ...scenario, horizon_s: duration_s, dt_s: body.dt_s, include: "prior" }, signal }).catch(quiet);
    return { answer, body, prior: prior ?? null };
  }

  /** @param {any} body @param {AbortSignal} signal @returns {Promise<any>} */
  async #post(body, signal) {
    try {
      return await askJson("v1/drives", { body: { ...body, include: this.parts }, signal, deadline_s: 60 });
    } catch (error) {
      const without = PARTS[PARTS.indexOf(this.parts) + 1];
      if (!(error instanceof Problem && error.fields.some(({ field }) => field === "include")) || without === undefined) throw error;
      this.parts = without;
      return this.#post(body, signal);
    }
  }

  /** @param {Found} found @param {Question} question */
  #show({ answer, body, prior }, question) {
    const ground = groundOf(question.track);
    if (!ground) return; // the service would have refused it
    this.#complain([]);
    this.#stale(false);
    const { trajectory, band } = answer;
    const priorAt = prior && trajectory.time_s.length === prior.trajectory.time_s.length ? prior.prior.x_m : undefined;
    if (band && this.plots[0].what.band) this.plots[0].what.band.label = `${Math.round(band.level * 100)} % band`;
    for (const plot of this.plots) plot.show({ ...trajectory, prior_x_m: priorAt, x_lower_m: band?.x_lower_m, x_upper_m: band?.x_upper_m }, answer.events.map(({ event, time_s }) => ({ at: time_s, key: event })));
    fill(this.verdict, judged(answer));
    fill(this.facts, ...facts(answer));
    fill(this.events, happened(answer, (time_s) => this.stage.seek(time_s)));
    fill(this.domain, answered(answer));
    fill(this.links, elsewherePosted("v1/drives", body, this.forms));
    this.stage.show(new Motion(answer, prior, ground), answer);
    this.charts.dataset.shown = new URLSearchParams(/** @type {any} */ (addressed(question))).toString();
    this.telling.call();
  }

  /** @param {import("./drive_motion.js").Moment | null} moment @param {boolean} playing */
  #moved(moment, playing) {
    for (const plot of this.plots) plot.stand(moment && moment.time);
    this.controls.at(moment && moment.time);
    if (!moment || !this.question) return;
    const { kind, x, y } = this.question.track;
    if (kind === "slopes") this.track.rover([moment.x + 0.5 * Math.hypot(moment.front[0] - moment.rear[0], moment.front[1] - moment.rear[1]), moment.slope]);
    else this.track.follow((moment.rear[0] + moment.front[0]) / 2);
    if (!playing) this.charts.dataset.time = String(moment.time);
  }

  /** @param {Problem} problem */
  #refused(problem) {
    this.#complain(problem.faults);
    fill(this.verdict, noAnswer(problem, () => void this.#again()));
    for (const each of [this.facts, this.events, this.domain, this.links]) fill(each);
    this.#stale(true);
    say(problem.message);
  }

  /** The service may be there again. */
  async #again() {
    this.known = undefined;
    void this.version.refill();
    await this.#domain();
    this.#ask();
  }

  /** The drive before is not shown beside what is told now. @param {boolean} yes */
  #stale(yes) {
    for (const each of [this.charts, this.stage.element]) each.classList.toggle("stale", yes);
  }

  /** Say what is wrong where it is. @param {Problem["fields"]} faults */
  #complain(faults) {
    const of = (/** @type {string} */ name) => faults.filter(({ field }) => field === name || field.startsWith(`${name}.`));
    for (const [name, control] of Object.entries({ ...this.numbers, ...this.optional })) {
      const [fault] = of(name);
      if (fault || control.element.classList.contains("wrong")) control.complain(faultWords(fault));
    }
    this.track.complain(of("track").map(({ message }) => message).join("; "));
    this.controls.complain(of("controls").map(({ message }) => message).join("; "));
    this.version.complain(of("model")[0]?.message ?? "");
  }
}
