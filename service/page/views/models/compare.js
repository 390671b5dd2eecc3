// @ts-check
// Two versions side by side: errors on the runs that neither has seen, what each knows, and both curves on one slope.

import { Newest, Problem, askJson } from "../../api.js";
import { Chart } from "../../chart.js";
import { NumberControl, faultWords } from "../../controls.js";
import { datum, fill, h, later, shown } from "../../dom.js";
import { fieldsOf, references } from "../../fields.js";
import { numberOf } from "../../query.js";
import { parse, write } from "../../state.js";
import { leftOut, metres } from "./evidence.js";
import { refusal, table, when } from "./show.js";

/**
 * @typedef {import("./show.js").Chosen} Chosen
 * @typedef {{name: string, version: number}} Version
 */

const NAMES = /** @type {const} */ ({ slope_deg: "Slope", mass_kg: "Mass", torque_nm: "Wheel torque", horizon_s: "Time" });
const POINTS = 200;
const KEEP_MS = 400;

/** @param {HTMLElement} room @returns {Promise<import("./show.js").Part>} */
export async function mount(room) {
  const fields = await fieldsOf("prediction");
  return new Comparison(room, fields);
}

/** `viper-lunar@5` @param {Version} which */
function referenceOf({ name, version }) {
  return `${name}@${version}`;
}

class Comparison {
  /** @param {HTMLElement} room @param {Record<string, import("../../fields.js").Field>} fields */
  constructor(room, fields) {
    this.room = room;
    /** @type {Chosen | undefined} */
    this.chosen = undefined;
    /** @type {Chart | undefined} */
    this.chart = undefined;
    this.pair = "";
    const heard = { input: () => { this.keep.call(); this.#ask(); }, commit: () => this.#write({}) };
    this.controls = Object.fromEntries(Object.entries(NAMES).map(([name, label]) => [name, new NumberControl(fields[name], label, heard)]));
    this.other = h("select", { id: "compare-with", change: () => {
      this.#write({});
      if (this.chosen) void this.update(this.chosen);
    } });
    this.facing = h("div.stack");
    this.ends = h("div");
    this.curve = h("div");
    this.keep = later(KEEP_MS, () => this.#write({ replace: true }));
    this.reading = new AbortController();
    /** @type {Newest<Record<string, any>, any[]>} */
    this.newest = new Newest((asked, signal) => Promise.all(asked.models.map((/** @type {string} */ model) =>
      askJson("v1/predictions", { query: { ...asked.question, model }, signal }))), (answers, asked) => this.#draw(answers, asked), (problem) => {
      fill(this.ends, refusal(problem, () => this.#ask()));
      this.curve.classList.add("stale");
      for (const control of Object.values(this.controls)) {
        const fault = problem.fields.find(({ field }) => field === control.field.name);
        control.complain(faultWords(fault));
      }
    });
    fill(room, h("section.card.stack", { "aria-label": "Which versions" }, h("div.row", {}, this.title = h("h2"), h("label", { for: "compare-with" }, "with"), this.other)),
      this.facing, h("section.card.stack", { "aria-label": "Both on one slope" }, h("div.columns", {},
        h("form", { "aria-label": "Slope to compare on", submit: (/** @type {Event} */ event) => event.preventDefault() }, ...Object.values(this.controls).map((each) => each.element)),
        h("div.stack", {}, this.ends, this.curve))));
  }

  unmount() {
    this.keep.cancel();
    this.newest.end();
    this.reading.abort();
    this.chart?.destroy();
  }

  /** @param {Chosen} chosen */
  async update(chosen) {
    this.chosen = chosen;
    const mine = { name: chosen.name, version: chosen.version };
    this.title.textContent = `${mine.name}, version ${mine.version}`;
    const there = references(chosen.models).filter(({ reference }) => /@[0-9]+$/.test(reference) && reference !== referenceOf(mine));
    fill(this.other, ...there.map(({ reference, words }) => h("option", { value: reference }, words)));
    const wanted = numbered(chosen.query.get("with") ?? usual(chosen), chosen);
    if (wanted && !there.some(({ reference }) => reference === wanted)) this.other.append(h("option", { value: wanted }, wanted));
    this.other.value = wanted;
    for (const [name, control] of Object.entries(this.controls)) {
      control.set(numberOf(chosen.query.get(name)) ?? control.field.start);
    }
    if (!wanted) {
      fill(this.facing, h("p.card", {}, "There is no other version to compare it with."));
      return;
    }
    const pair = `${referenceOf(mine)} ${wanted}`;
    this.#ask();
    if (pair !== this.pair) await this.#read(mine, wanted, pair);
  }

  /** @param {Version} mine @param {string} wanted @param {string} pair */
  async #read(mine, wanted, pair) {
    this.reading.abort();
    this.reading = new AbortController();
    const { signal } = this.reading;
    this.pair = pair;
    const [name, version] = wanted.split("@");
    try {
      const read = (/** @type {string} */ of, /** @type {number | string} */ at) => askJson(`v1/models/${encodeURIComponent(of)}/versions/${encodeURIComponent(at)}`, { signal });
      const [ours, theirs] = await Promise.all([read(mine.name, mine.version), read(name, version)]);
      const errors = h("section.card.stack", {}, h("h2", {}, "Errors on runs that neither has seen"), h("p.muted", {}, "They are being compared."));
      fill(this.facing, sideBySide(ours, theirs), errors);
      for (const [field, control] of Object.entries(this.controls)) {
        const range = ours.domain?.[field];
        if (Array.isArray(range)) control.range(/** @type {[number, number]} */ (range));
      }
      const compared = await askJson(`v1/models/${encodeURIComponent(mine.name)}/versions/${mine.version}/comparison`, { query: { against: wanted, slopes_deg: "0", format: "json" }, signal });
      errors.lastChild?.replaceWith(...byRegime(compared));
      this.room.dataset.shown = pair;
    } catch (error) {
      if (signal.aborted) return;
      this.pair = "";
      if (!(error instanceof Problem)) throw error;
      fill(this.facing, h("div.card", {}, refusal(error, () => { if (this.chosen) void this.update(this.chosen); })));
    }
  }

  #question() {
    return Object.fromEntries(Object.entries(this.controls).map(([name, { value }]) => [name, value]));
  }

  /** Put it into the address. @param {{replace?: boolean}} how */
  #write(how) {
    this.keep.cancel();
    if (!this.chosen) return;
    const { query } = parse(this.chosen.to({ show: "compare", with: this.other.value, ...this.#question() }));
    write("models", query, how);
    this.chosen = { ...this.chosen, query };
  }

  #ask() {
    if (!this.chosen || !this.other.value) return;
    const question = this.#question();
    const dt_s = Number(Math.min(60, Math.max(0.0001, Number(question.horizon_s) / POINTS)).toPrecision(4)); // a time that is too long is not to be told as a wrong step
    this.newest.ask({ question: { ...question, dt_s }, models: [referenceOf(this.chosen), this.other.value] });
  }

  /** @param {any[]} answers @param {Record<string, any>} asked */
  #draw(answers, asked) {
    const [ours, theirs] = answers;
    this.curve.classList.remove("stale");
    const [mine, other] = asked.models;
    if (this.chart?.what.lines[0].label !== mine || this.chart?.what.lines[1].label !== other) {
      this.chart?.destroy();
      this.chart = new Chart(this.curve, { title: "Position along the slope", x: { key: "time_s", label: "Time", unit: "s" }, y: { key: "x_m", label: "Uphill", unit: "m" },
        lines: [{ key: "ours", label: mine, color: "--line" }, { key: "theirs", label: other, color: "--second", dash: [6, 5] }] });
    }
    this.chart.show({ time_s: ours.trajectory.time_s, ours: ours.trajectory.x_m, theirs: theirs.trajectory.x_m });
    const apart = Math.abs(ours.summary.final_x_m - theirs.summary.final_x_m);
    const outside = answers.flatMap((answer, at) => (answer.domain.inside ? [] : [asked.models[at]]));
    fill(this.ends, h("p.notice", {}, h("strong", {}, datum("apart_m", apart, 3, "m"), " apart at the end. "),
      ...answers.flatMap((answer, at) => [`${asked.models[at]} ${answer.summary.outcome}, `, datum(`final_x_m_${at}`, answer.summary.final_x_m, 3, "m"), at ? "." : "; "])),
    outside.length > 0 && h("p.notice.warn", {}, `Outside what was validated: ${outside.join(" and ")}.`));
    this.curve.dataset.shown = new URLSearchParams(asked.question).toString();
  }
}

/** `viper-lunar@5` for `viper-lunar@champion`. @param {string} reference @param {Chosen} chosen */
function numbered(reference, { models }) {
  const [name, at = "champion"] = reference.split("@");
  const version = models.find((each) => each.name === name)?.aliases[at];
  return version === undefined ? reference : `${name}@${version}`;
}

/** What a version is compared with where nobody chose: the champion, else the newest other one. @param {Chosen} chosen */
function usual({ models, name, version }) {
  const model = models.find((each) => each.name === name);
  const champion = model?.aliases.champion;
  const others = (model?.versions ?? []).filter((each) => each !== version);
  const at = champion !== undefined && champion !== version ? champion : others.at(-1);
  if (at !== undefined) return `${name}@${at}`;
  const elsewhere = models.find((each) => each.name !== name && each.versions.length);
  return elsewhere ? `${elsewhere.name}@${elsewhere.versions.at(-1)}` : "";
}

/** @param {any} ours @param {any} theirs */
function sideBySide(ours, theirs) {
  const heads = [referenceOf(ours), referenceOf(theirs)];
  const both = [ours, theirs];
  const range = (/** @type {any} */ manifest, /** @type {string} */ name) => {
    const found = manifest.domain?.[name];
    return Array.isArray(found) ? `${shown(found[0], 1)} to ${shown(found[1], 1)}` : "–";
  };
  const rows = [
    ["Description", ...both.map((each) => each.description)], ["Published", ...both.map((each) => when(each.created_at))],
    ["Learned part", ...both.map((each) => each.checkpoint.architecture?.name?.replaceAll("_", " "))], ["Band", ...both.map((each) => (each.band ? "yes" : "no"))],
    ["Slope (°)", ...both.map((each) => range(each, "slope_deg"))], ["Mass (kg)", ...both.map((each) => range(each, "mass_kg"))],
    ["Wheel torque (N m)", ...both.map((each) => range(each, "torque_nm"))], ["Time (s)", ...both.map((each) => range(each, "horizon_s"))],
    ["Runs to train on", ...both.map((each) => each.lineage?.split?.train?.length ?? "–")], ["Runs predicted unseen", ...both.map((each) => leftOut(each).runs.length)],
  ];
  return h("section.card.stack", {}, h("h2", {}, "What they are"), table("What they are", ["~What", ...heads.map((each) => `~${each}`)], rows));
}

/** Errors as the service sorts them, and its verdict. @param {any} compared */
function byRegime({ candidate, against, sentence, common_runs, regimes }) {
  const cell = (/** @type {number} */ value, /** @type {boolean} */ wins) => (wins ? h("strong.good", {}, metres(value)) : metres(value));
  const rows = regimes.map((/** @type {any} */ { regime, runs, candidate_final: mine, against_final: other }) => [regime, runs,
    cell(mine.median_m, mine.median_m < other.median_m), cell(other.median_m, other.median_m < mine.median_m), metres(mine.p90_m), metres(other.p90_m)]);
  const heads = [candidate, against];
  return [h("p", {}, sentence), ...(rows.length ? [h("p", {}, `At the end of ${common_runs} runs, in metres. The smaller median is green.`),
    table("Errors of both", ["~What the rover did", "Runs", `Median, ${heads[0]}`, `Median, ${heads[1]}`, `90 % below, ${heads[0]}`, `90 % below, ${heads[1]}`], rows)] : [])];
}
