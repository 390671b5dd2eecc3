// @ts-check
// Models and training: versions and their cards, two of them compared, aliases, uploads and jobs.

import { Problem } from "../api.js";
import { fill, h } from "../dom.js";
import { models } from "../fields.js";
import { checked, leftOut, short, unreadable } from "../query.js";
import { addressOf, read } from "../state.js";
import { mount as aliases } from "./models/aliases.js";
import { mount as card } from "./models/card.js";
import { mount as compare } from "./models/compare.js";
import { mount as data } from "./models/datasets.js";
import { closeAll } from "./models/dialogs.js";
import { mount as jobs } from "./models/jobs.js";
import { refusal } from "./models/show.js";

/** @type {Record<string, {words: string, mount: (room: HTMLElement) => import("./models/show.js").Part | Promise<import("./models/show.js").Part>}>} */
const PARTS = {
  card: { words: "Version", mount: card },
  compare: { words: "Compare", mount: compare },
  aliases: { words: "Aliases", mount: aliases },
  data: { words: "Data", mount: data },
  jobs: { words: "Training", mount: jobs },
};
const ASKED = { numbers: ["slope_deg", "mass_kg", "torque_nm", "horizon_s"], words: ["model", "version", "show", "with", "job", "dataset"] };
const FIRST = "card";
const RECENT = 12; // versions of a model in the list

/** @param {HTMLElement} element @param {import("../state.js").State} state */
export async function mount(element, state) {
  const view = new Models(element);
  await view.update(state);
  return view;
}

class Models {
  /** @param {HTMLElement} element */
  constructor(element) {
    /** @type {import("../fields.js").ModelEntry[] | undefined} */
    this.all = undefined;
    /** @type {Map<string, {room: HTMLElement, part: Promise<import("./models/show.js").Part>}>} each stays as it was left */
    this.parts = new Map();
    this.gone = false;
    this.list = h("nav.card.stack", { "aria-label": "Models and versions" });
    this.tabs = h("ul.parts");
    this.room = h("div");
    this.note = h("div");
    element.append(h("div.head", {}, h("h1", {}, "Models and training"), h("p", {}, "Which version predicts, how good is it, and how is a better one made?")),
      h("div.columns.models", {}, this.list, h("div.stack", {}, h("nav", { "aria-label": "Parts of this view" }, this.tabs), this.note, this.room)));
  }

  /** @param {import("../state.js").State} state */
  async update(state) {
    try {
      this.all ??= await models();
    } catch (error) {
      if (!(error instanceof Problem)) throw error;
      fill(this.room, h("div.card", {}, refusal(error, () => { fill(this.room); void this.update(read()); })));
      return;
    }
    if (this.gone) return;
    const chosen = this.#chosen(state, this.all);
    const asked = state.query.get("show") ?? FIRST;
    const name = Object.hasOwn(PARTS, asked) ? asked : FIRST;
    const { faults, unknown } = this.#checked(state, chosen);
    this.#fillList(chosen);
    refill(this.tabs, ...Object.entries(PARTS).map(([key, { words }]) => h("li", {}, this.#tab(chosen, key, words, key === name))));
    fill(this.note, leftOut(unknown));
    if (faults.length) fill(this.room, h("div.card", {}, unreadable(faults)));
    else await this.#show(name, chosen);
  }

  /** What of the address cannot be read. @param {import("../state.js").State} state @param {import("./models/show.js").Chosen} chosen */
  #checked({ query }, { models: all, name }) {
    const { faults, unknown } = checked(query, ASKED);
    const told = (/** @type {string} */ field, /** @type {boolean} */ holds, /** @type {string} */ message) => {
      if (query.get(field) && !holds && !faults.some((each) => each.field === field)) faults.push({ field, message });
    };
    const [show, version] = ["show", "version"].map((field) => query.get(field) ?? "");
    const model = all.find((each) => each.name === name);
    told("show", Object.hasOwn(PARTS, show), `show is “${short(show)}”, allowed is ${Object.keys(PARTS).join(", ")}`);
    told("version", /^[0-9]{1,9}$/.test(version) || Object.hasOwn(model?.aliases ?? {}, version), `version is “${short(version)}”, which is neither a number nor an alias of ${short(name)}`);
    return { faults, unknown };
  }

  unmount() {
    this.gone = true;
    closeAll();
    for (const { part } of this.parts.values()) void part.then((each) => each.unmount?.());
  }

  /** @param {string} name @param {import("./models/show.js").Chosen} chosen */
  async #show(name, chosen) {
    if (!chosen.name && (name === "card" || name === "compare" || name === "aliases")) {
      fill(this.room, h("p.card", {}, "The store has no model yet. ", h("a", { href: chosen.to({ show: "data" }) }, "Upload runs"), ", then train on them."));
      return;
    }
    let there = this.parts.get(name);
    if (!there) {
      const room = h("div.stack", { "data-part": name });
      there = { room, part: Promise.resolve(PARTS[name].mount(room)) };
      this.parts.set(name, there);
    }
    if (there.room.parentElement !== this.room || this.room.children.length > 1) fill(this.room, there.room);
    try {
      const part = await there.part;
      if (this.gone) part.unmount?.();
      else await part.update(chosen);
    } catch (error) {
      if (!(error instanceof Problem)) throw error;
      this.parts.delete(name); // it was not made
      if (!this.gone) fill(this.room, h("div.card", {}, refusal(error, () => void this.#show(name, chosen))));
    }
  }

  /** @param {import("../state.js").State} state @param {import("../fields.js").ModelEntry[]} all @returns {import("./models/show.js").Chosen} */
  #chosen({ query }, all) {
    const first = all.find(({ aliases: there }) => "champion" in there) ?? all[0];
    const name = query.get("model") ?? first?.name ?? "";
    const model = all.find((each) => each.name === name);
    const asked = query.get("version") ?? "";
    const named = new Map(Object.entries(model?.aliases ?? {})).get(asked || "champion");
    const version = /^[0-9]+$/.test(asked) ? Number(asked) : named ?? model?.versions.at(-1) ?? 1;
    const to = (/** @type {Record<string, string | number>} */ changes) => {
      const told = read().view === "models" ? read().query : query;
      const next = new URLSearchParams([...told].filter(([key]) => [...ASKED.numbers, ...ASKED.words].includes(key))); // a link does not lead to what cannot be read again
      if (name) next.set("model", name);
      if (asked) next.set("version", String(version));
      for (const [key, value] of Object.entries(changes)) {
        if (value === "") next.delete(key);
        else next.set(key, String(value));
      }
      return addressOf("models", next);
    };
    return { models: all, name, version, query, to, reload: () => this.#reload() };
  }

  /** @param {import("./models/show.js").Chosen} chosen @param {string} part @param {string} words @param {boolean} current */
  #tab(chosen, part, words, current) {
    const link = h("a", { href: chosen.to({ show: part }), "aria-current": current ? "page" : null, "data-part": part,
      click: () => { link.href = chosen.to({ show: part }); } }, words); // a slider may have moved since
    return link;
  }

  /** What is there has changed. */
  async #reload() {
    this.all = await models();
    if (!this.gone) await this.update(read());
  }

  /** @param {import("./models/show.js").Chosen} chosen */
  #fillList(chosen) {
    const models_ = chosen.models.map((model) => {
      const numbers = [...model.versions, ...model.archived, ...model.deleted].sort((one, other) => other - one);
      const entry = (/** @type {number} */ version) => this.#entry(chosen, model, version);
      const older = numbers.slice(RECENT);
      return h("section", {}, h("h2", {}, model.name), h("ul.versions", {}, ...numbers.slice(0, RECENT).map(entry)),
        older.length > 0 && h("details", {}, h("summary", {}, `${older.length} older`), h("ul.versions", {}, ...older.map(entry))));
    });
    refill(this.list, ...(models_.length ? models_ : [h("p.muted", {}, "There is no model yet.")]));
  }

  /** @param {import("./models/show.js").Chosen} chosen @param {import("../fields.js").ModelEntry} model @param {number} version */
  #entry(chosen, model, version) {
    const aliases = Object.entries(model.aliases).filter(([, at]) => at === version).map(([alias]) => h("span.tag.good", {}, alias));
    const out = model.archived.includes(version) ? "archived" : model.deleted.includes(version) ? "deleted" : "";
    const current = model.name === chosen.name && version === chosen.version;
    const show = ["compare", "card"].find((each) => each === chosen.query.get("show")) ?? FIRST;
    return h("li", {}, h("a", { href: chosen.to({ model: model.name, version, show, with: "", job: "" }), "aria-current": current ? "true" : null, "data-part": `${model.name}@${version}` }, `Version ${version}`,
      h("span.row.tight", {}, ...aliases, out && h("span.tag", {}, out))));
  }
}

/** In place of what was there; the keyboard stays where it was. @param {HTMLElement} room @param {...any} children */
function refill(room, ...children) {
  const { activeElement } = document;
  const part = activeElement instanceof HTMLElement && room.contains(activeElement) ? activeElement.dataset.part : undefined;
  fill(room, ...children);
  if (part !== undefined) [...room.querySelectorAll("a")].find((each) => each.dataset.part === part)?.focus();
}
