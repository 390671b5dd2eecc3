// @ts-check
// Mobility: for one mass, which slopes each torque climbs, and how steep with confidence.

import { noAnswer } from "../again.js";
import { Newest, askJson } from "../api.js";
import { NumberControl, faultWords, versionControl } from "../controls.js";
import { datum, fill, h, later, percent, say, shown } from "../dom.js";
import { fieldsOf, formsOf, knowledgeOf } from "../fields.js";
import { elsewhere } from "../links.js";
import { checked, leftOut, numberOf, short, unreadable } from "../query.js";
import { go, write } from "../state.js";
import { LAYERS, MobilityMap } from "./mobility_map.js";

const NAMES = /** @type {const} */ ({ mass_kg: "Mass", horizon_s: "Time", confidence: "Confidence" });
const RANGES = /** @type {const} */ (["torque_min_nm", "torque_max_nm", "slope_min_deg", "slope_max_deg"]);
const ASKED = { numbers: [...Object.keys(NAMES), ...RANGES], words: ["model", "layer"] };
const STEPS = [0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000];
const FINEST = { torque: 1, slope: 0.5 };
const MOST = { torque: 28, slope: 41 }; // cells of the whole map
const FEWER = { torque: 9, slope: 14 }; // while a slider moves
const REST_MS = 250;

/** @param {HTMLElement} element @param {import("../state.js").State} state */
export async function mount(element, state) {
  const [fields, forms] = await Promise.all([fieldsOf("mobility"), formsOf("mobility")]);
  const view = new Mobility(element, fields, forms, state.query.get("model") ?? "");
  await view.update(state);
  return view;
}

class Mobility {
  /** @param {HTMLElement} element @param {Record<string, import("../fields.js").Field>} fields @param {string[]} forms @param {string} model */
  constructor(element, fields, forms, model) {
    this.fields = fields;
    this.forms = forms;
    const heard = { input: () => this.#changed(), commit: () => this.#committed() };
    this.controls = Object.fromEntries(Object.entries(NAMES).map(([name, label]) => [name, new NumberControl(fields[name], label, heard)]));
    this.version = versionControl(model, () => void this.#versionChosen());
    /** @type {string | undefined} */
    this.known = undefined;
    /** @type {Record<string, number>} where nobody chose another range: that of the runs */
    this.usual = {};
    this.ranges = Object.fromEntries(RANGES.map((name) => [name, h("input", { type: "number", step: "any", id: `field-${name}`,
      min: fields[name].minimum, max: fields[name].maximum, change: () => { this.#committed(); } })]));
    this.reading = h("p.reading", { role: "status" }, "Point at the map, or use the arrow keys. A click or Enter opens the slope.");
    this.map = new MobilityMap({ read: (words) => { this.reading.textContent = words; }, take: (torque, slope) => this.#take(torque, slope) });
    this.note = h("div");
    this.answerRoom = h("div", {}, h("p.notice", {}, "The map is being made."));
    this.legend = h("ul.legend", { "aria-label": "What the colours mean" });
    this.steepest = h("div.steepest", { tabindex: "0", role: "region", "aria-label": "Steepest slope of each torque" });
    this.cells = h("div.scroll", { tabindex: "0", role: "region", "aria-label": "All cells" });
    this.links = h("div");
    this.layers = Object.entries(LAYERS).map(([layer, words]) => h("button", { type: "button", "data-layer": layer, click: () => this.#layer(layer) }, words));
    /** @type {Newest<{asked: Record<string, any>, cells: {torque: number, slope: number}}, any>} */
    this.newest = new Newest(({ asked }, signal) => askJson("v1/mobility", { query: asked, signal, deadline_s: 60 }),
      (answer, { asked, cells }) => this.#show(answer, asked, cells), (problem) => this.#refused(problem));
    this.rest = later(REST_MS, () => this.#ask(MOST));
    this.#lay(element);
  }

  /** @param {HTMLElement} element */
  #lay(element) {
    this.details = h("details", { toggle: () => this.#fillCells() }, h("summary", {}, "All cells as a table"), this.cells);
    this.shown = h("div.stack", {}, h("div.row", {}, h("span.choice", { role: "group", "aria-label": "Shown" }, ...this.layers), this.legend),
      h("div.map-and-table", {}, h("div", {}, this.map.element, this.reading), this.steepest), this.details);
    const pair = (/** @type {string} */ words, /** @type {string} */ low, /** @type {string} */ high) => h("fieldset.pair", {}, h("legend", {}, words),
      h("label", {}, "from", this.ranges[low]), h("label", {}, "to", this.ranges[high]));
    this.complaint = h("p.fault");
    element.append(
      h("div.head", {}, h("h1", {}, "Mobility map"), h("p", {}, "Which slopes does each wheel torque climb, and how steep may it be?")),
      h("div.columns", {},
        h("form.card", { "aria-label": "Map", submit: (/** @type {Event} */ event) => event.preventDefault() },
          ...Object.values(this.controls).map((each) => each.element), this.version.element,
          this.other = h("details", {}, h("summary", {}, "Other ranges"), pair("Wheel torque (N m)", "torque_min_nm", "torque_max_nm"),
            pair("Slope (°)", "slope_min_deg", "slope_max_deg"), this.complaint)),
        h("div.stack", {}, h("div.card.stack", {}, this.note, this.answerRoom, this.shown),
        h("div.card", {}, h("h2", {}, "The same question elsewhere"), this.links))));
  }

  /** @param {import("../state.js").State} state */
  async update({ query }) {
    const { faults, unknown } = checked(query, ASKED);
    for (const [name, control] of Object.entries(this.controls)) control.set(numberOf(query.get(name)) ?? control.field.start);
    this.version.set(query.get("model") ?? "");
    const layer = query.get("layer") ?? "outcome";
    this.map.layer = /** @type {any} */ (Object.hasOwn(LAYERS, layer) ? layer : "outcome");
    if (layer && layer !== this.map.layer) faults.push({ field: "layer", message: `layer is “${short(layer)}”, allowed is ${Object.keys(LAYERS).join(", ")}` });
    for (const name of RANGES) this.ranges[name].value = numberOf(query.get(name)) ?? "";
    fill(this.note, leftOut(unknown));
    await this.#domain();
    this.#mark();
    this.rest.cancel();
    if (!faults.length) this.#ask(FEWER); // soon something, then all
    else {
      this.newest.drop();
      this.#clear(unreadable(faults));
      this.#complain(faults);
      say("This address cannot be read");
    }
  }

  unmount() {
    this.rest.cancel();
    this.newest.end();
    this.map.destroy();
  }

  async #domain() {
    const reference = this.version.value;
    if (this.known === reference) return;
    const ranges = (await knowledgeOf(reference))?.ranges ?? {};
    if (reference !== this.version.value) return;
    this.known = reference;
    for (const name of /** @type {const} */ (["mass_kg", "horizon_s"])) this.controls[name].range(ranges[name]);
    const [least, most] = ranges.torque_nm ?? [0, 130];
    this.usual = { torque_min_nm: least, torque_max_nm: most, slope_min_deg: 0, slope_max_deg: Math.max(5, ranges.slope_deg?.[1] ?? 32) + 3 };
    for (const name of RANGES) this.ranges[name].placeholder = shown(this.usual[name], 0);
  }

  async #versionChosen() {
    this.#write();
    await this.#domain();
    this.#ask(MOST);
  }

  #changed() {
    this.rest.cancel();
    fill(this.note);
    this.#ask(FEWER);
  }

  #committed() {
    this.#write();
    this.rest.cancel();
    this.#ask(MOST);
  }

  /** What is in the address: what was chosen, no more. */
  #chosen() {
    /** @type {Record<string, string | number>} */
    const chosen = Object.fromEntries(Object.entries(this.controls).map(([name, { value }]) => [name, value]));
    for (const name of RANGES) if (this.ranges[name].value !== "") chosen[name] = this.ranges[name].value;
    if (this.version.value) chosen.model = this.version.value;
    return chosen;
  }

  #write() {
    fill(this.note);
    write("mobility", { ...this.#chosen(), ...(this.map.layer === "outcome" ? {} : { layer: this.map.layer }) });
  }

  /** @param {{torque: number, slope: number}} cells  at most so many @returns {Record<string, any>} */
  #question(cells) {
    const chosen = this.#chosen();
    const [torque, slope] = /** @type {const} */ (["torque", "slope"]).map((axis) => {
      const unit = axis === "torque" ? "nm" : "deg";
      const names = [`${axis}_min_${unit}`, `${axis}_max_${unit}`];
      const given = names.map((name) => (name in chosen ? Number(chosen[name]) : undefined));
      const [low, high] = names.map((name, end) => given[end] ?? this.usual[name]);
      const step = STEPS.find((each) => each >= FINEST[axis] && (high - low) / each < cells[axis]) ?? 1000;
      const field = this.fields[names[0]];
      const ends = [given[0] ?? Math.max(field.minimum, Math.floor(low / step) * step), given[1] ?? Math.min(field.maximum, Math.ceil(high / step) * step)];
      return { [names[0]]: ends[0], [names[1]]: ends[1], [`${axis}_steps`]: Math.max(2, Math.round((ends[1] - ends[0]) / step) + 1) };
    });
    return { ...chosen, ...torque, ...slope };
  }

  /** @param {{torque: number, slope: number}} cells  at most so many */
  #ask(cells) {
    this.map.element.classList.toggle("waiting", cells === MOST && this.map.answer !== undefined);
    this.newest.ask({ asked: this.#question(cells), cells });
  }

  /** @param {any} answer @param {Record<string, any>} asked @param {{torque: number, slope: number}} cells */
  #show(answer, asked, cells) {
    this.answer = answer;
    this.#complain([]);
    this.shown.classList.remove("stale");
    this.map.element.classList.remove("waiting");
    this.map.show(answer);
    fill(this.legend, ...this.map.legend());
    fill(this.answerRoom, cells === MOST ? this.#sentence(answer) : h("p.notice", { "data-rough": "" }, h("strong", {}, "A rough map. "), "It is being refined."));
    this.#fillSteepest(answer);
    this.#fillCells();
    fill(this.links, elsewhere("v1/mobility", this.#question(MOST), this.forms)); // of the whole map, also while a rough one is shown
    this.map.element.dataset.cells = cells === MOST ? "all" : "few";
    if (cells !== MOST) this.rest.call();
    else say(this.answerRoom.textContent);
    this.map.element.dataset.shown = new URLSearchParams(asked).toString();
    this.map.element.setAttribute("aria-label", `Mobility map for ${shown(answer.mass_kg, 0)} kg: ${answer.torque_nm.length} torques, ${answer.slope_deg.length} slopes`);
  }

  /** @param {any} answer */
  #sentence(answer) {
    const { steepest_climb_slope_deg: steepest, steepest_inside_domain: inside, torque_nm, confidence } = answer;
    const best = steepest.reduce((/** @type {number} */ found, /** @type {number | null} */ slope, /** @type {number} */ row) =>
      (slope !== null && inside[row] && (found < 0 || slope > steepest[found]) ? row : found), -1);
    const sure = confidence === null ? "by the central estimate (this version has no band)" : `with ${percent(confidence)} confidence`;
    const model = `${answer.model.name}, version ${answer.model.version}`;
    if (best < 0) return h("p.notice.warn", {}, h("strong", {}, "No slope "), `of this map is climbed ${sure}, as far as ${model} was validated.`);
    return h("p.notice.good", {}, h("strong", {}, `${shown(steepest[best], 1)}° `), `is the steepest slope that a rover of ${shown(answer.mass_kg, 0)} kg climbs ${sure}, ` +
      `at ${shown(torque_nm[best], 0)} N m (${model}).`);
  }

  /** @param {any} answer */
  #fillSteepest({ torque_nm, steepest_climb_slope_deg: steepest, steepest_inside_domain: inside, confidence }) {
    const head = confidence === null ? "Steepest slope (°)" : `Steepest slope, ${percent(confidence)} sure (°)`;
    const rows = torque_nm.map((/** @type {number} */ torque, /** @type {number} */ row) => {
      const slope = steepest[row];
      const value = slope === null ? "none" : datum("steepest_climb_slope_deg", slope, 1);
      return h("tr", {}, h("th", { scope: "row" }, shown(torque, Number.isInteger(torque) ? 0 : 1)),
        h("td", {}, value, slope !== null && !inside[row] ? " *" : ""));
    });
    fill(this.steepest, h("table", {}, h("thead", {}, h("tr", {}, h("th", { scope: "col" }, "Torque (N m)"), h("th", { scope: "col" }, head))), h("tbody", {}, ...rows)),
      inside.includes(false) && h("p.small.muted", {}, "* outside what was validated"));
  }

  #fillCells() {
    if (!this.details.open || !this.answer) return;
    const { torque_nm, slope_deg } = this.answer;
    const text = (/** @type {any} */ value) => (typeof value === "number" ? shown(value, 2) : value ?? "–");
    fill(this.cells, h("table", {}, h("caption", {}, `${LAYERS[this.map.layer]} by torque (rows, N m) and slope (columns, °)`),
      h("thead", {}, h("tr", {}, h("th", { scope: "col" }, "Torque"), ...slope_deg.map((/** @type {number} */ slope) => h("th", { scope: "col" }, shown(slope, 0))))),
      h("tbody", {}, ...torque_nm.map((/** @type {number} */ torque, /** @type {number} */ row) => h("tr", {}, h("th", { scope: "row" }, shown(torque, 0)),
        ...this.answer[this.map.layer][row].map((/** @type {any} */ value) => h("td", {}, text(value))))))));
  }

  /** @param {string} layer */
  #layer(layer) {
    this.map.layer = /** @type {any} */ (layer);
    this.#mark();
    this.map.draw();
    if (this.answer) fill(this.legend, ...this.map.legend());
    this.#fillCells();
    this.#write();
  }

  #mark() {
    for (const button of this.layers) button.setAttribute("aria-pressed", String(button.dataset.layer === this.map.layer));
  }

  /** @param {number} torque @param {number} slope */
  #take(torque, slope) {
    const { mass_kg, horizon_s, model } = this.#chosen();
    this.#write();
    go("slope", { slope_deg: slope, mass_kg, torque_nm: torque, horizon_s, ...(model ? { model } : {}) });
  }

  /** @param {import("../api.js").Problem} problem */
  #refused(problem) {
    this.#clear(noAnswer(problem, () => void this.#again()));
    this.#complain(problem.faults);
    say(problem.message);
  }

  /** The service may be there again. */
  async #again() {
    this.known = undefined;
    void this.version.refill();
    await this.#domain();
    this.#ask(MOST);
  }

  /** Nothing of the map before stays beside what is told now. @param {HTMLElement} words */
  #clear(words) {
    this.rest.cancel();
    this.map.element.classList.remove("waiting");
    fill(this.answerRoom, words);
    fill(this.links);
    this.shown.classList.add("stale");
  }

  /** @param {import("../api.js").Problem["fields"]} faults */
  #complain(faults) {
    for (const control of Object.values(this.controls)) {
      const fault = faults.find(({ field }) => field === control.field.name);
      if (fault || control.element.classList.contains("wrong")) control.complain(faultWords(fault));
    }
    this.version.complain(faults.find(({ field }) => field === "model")?.message ?? "");
    const ranges = faults.filter(({ field }) => RANGES.some((each) => each === field));
    for (const name of RANGES) {
      if (ranges.some(({ field }) => field === name)) this.ranges[name].setAttribute("aria-invalid", "true");
      else this.ranges[name].removeAttribute("aria-invalid");
    }
    this.complaint.textContent = ranges.map(({ message }) => message).join("; ");
    if (ranges.length) this.other.open = true;
  }
}
