// @ts-check
// Training: start a job, the list of jobs, and one of them as it runs.

import { Problem, askJson } from "../../api.js";
import { fill, h, say } from "../../dom.js";
import { schemaOf } from "../../fields.js";
import { datasets } from "./datasets.js";
import { Form } from "./form.js";
import { JobView } from "./job.js";
import { counted, faults, refusal, table, when } from "./show.js";

/** @typedef {import("./show.js").Chosen} Chosen */

const USUAL = ["architecture", "promote", "description"];
const ADVANCED = ["prior", "seed", "margin", "budget.max_epochs", "budget.max_minutes", "split.test_fraction", "split.test_slopes_deg"];
const PAGE = 20;

/** @param {HTMLElement} room @returns {import("./show.js").Part} */
export function mount(room) {
  return new Jobs(room);
}

class Jobs {
  /** @param {HTMLElement} room */
  constructor(room) {
    this.room = room;
    this.gone = new AbortController();
    /** @type {Chosen | undefined} */
    this.chosen = undefined;
    /** @type {Start | undefined} */
    this.start = undefined;
    /** @type {JobView | undefined} */
    this.view = undefined;
    this.following = h("div");
    this.list = h("section.card.stack", { "aria-label": "Jobs", hidden: true });
    this.most = PAGE;
  }

  unmount() {
    this.gone.abort();
    this.view?.end();
  }

  /** @param {Chosen} chosen */
  async update(chosen) {
    this.chosen = chosen;
    const { signal } = this.gone;
    try {
      const [all, schema] = await Promise.all([datasets(signal), schemaOf("training")]);
      this.names = new Map(all.map((each) => [each.id, each.name]));
      this.start ??= new Start(schema, (job) => this.#started(job));
      this.start.offer(chosen, all);
      if (!this.start.element.isConnected) fill(this.room, this.following, this.start.element, this.list);
      this.#follow(chosen.query.get("job") ?? "");
      await this.#fillList();
    } catch (error) {
      if (signal.aborted) return;
      if (!(error instanceof Problem)) throw error;
      this.start = undefined;
      fill(this.room, h("div.card", {}, refusal(error, () => void this.update(chosen))));
    }
  }

  /** @param {any} job */
  #started(job) {
    say("The job is in the queue");
    if (this.chosen) location.hash = this.chosen.to({ show: "jobs", job: job.id, dataset: "" });
  }

  /** @param {string} id */
  #follow(id) {
    if (this.view?.id === id) {
      if (this.chosen) this.view.chosen = this.chosen;
      return;
    }
    this.view?.end();
    this.view = undefined;
    if (!id || !this.chosen) {
      fill(this.following);
      return;
    }
    this.view = new JobView(id, this.chosen, () => { this.#fillList().catch(() => {}); });
    fill(this.following, this.view.element);
  }

  async #fillList() {
    const { jobs, next } = await askJson("v1/admin/training-jobs", { query: { limit: this.most }, signal: this.gone.signal });
    const rows = jobs.map((/** @type {any} */ job) => [h("a", { href: this.chosen?.to({ show: "jobs", job: job.id }), "aria-current": job.id === this.view?.id ? "true" : null }, job.id.slice(0, 8)),
      job.state, job.request.model, job.request.datasets.map((/** @type {string} */ id) => this.names?.get(id) ?? id.slice(0, 12)).join(", "), job.actor, when(job.created_at), outcome(job)]);
    fill(this.list, h("div.row", {}, h("h2", {}, "Jobs"), h("button", { type: "button", click: () => this.#again() }, "Refresh")),
      jobs.length ? table("All jobs", ["~Job", "~State", "~Model", "~Datasets", "~Who", "~When", "~What came out"], rows) : h("p", {}, "There are none yet."),
      next && h("button", { type: "button", click: () => { this.most = Math.min(500, this.most + PAGE); this.#again(); } }, "Show more"));
    this.list.hidden = false;
    this.list.dataset.shown = String(jobs.length);
  }

  #again() {
    this.#fillList().catch((error) => {
      if (!(error instanceof Problem)) throw error;
      fill(this.list, refusal(error, () => this.#again()));
    });
  }
}

/** @param {any} job */
function outcome({ state, result, failure, progress }) {
  if (result) return `version ${result.version}${result.promoted ? ", champion now" : ""}`;
  if (failure) return failure.message;
  return state === "running" && progress ? `${Math.round(100 * progress.fraction)} %, ${progress.phase}` : "";
}

/** The form that starts a job. */
class Start {
  /** @param {any} schema @param {(job: any) => void} started */
  constructor(schema, started) {
    this.started = started;
    this.usual = new Form("job", schema, USUAL);
    this.advanced = new Form("job", schema, ADVANCED);
    this.model = h("input", { id: "job-model", type: "text", list: "job-models", autocomplete: "off", spellcheck: "false", required: true, "aria-describedby": "job-model-hint" });
    this.models = h("datalist", { id: "job-models" });
    this.hint = h("span.hint", { id: "job-model-hint" }, "It gets a new version; a new name makes a new model.");
    this.sets = h("fieldset.sets", {}, h("legend", {}, "Datasets"));
    this.told = h("div");
    this.button = h("button.main", { type: "submit" }, "Start training");
    /** @type {{body: string, key: string} | undefined} the request that may have got through */
    this.tried = undefined;
    this.element = h("section.card", { "aria-label": "Start a training" }, h("form.stack", { submit: (/** @type {Event} */ event) => { event.preventDefault(); void this.#send(); } },
      h("h2", {}, "Train a new version"), h("div.fields", {}, h("div.field", {}, h("label", { for: "job-model" }, "Model"), this.model, this.models, this.hint)),
      this.sets, this.usual.element, h("details", {}, h("summary", {}, "Advanced"), this.advanced.element), h("p.row", {}, this.button), this.told));
  }

  /** Models and datasets that there are. @param {Chosen} chosen @param {import("./datasets.js").Dataset[]} all */
  offer(chosen, all) {
    const was = new Set(this.#datasets());
    const wanted = chosen.query.get("dataset");
    fill(this.models, ...chosen.models.map(({ name }) => h("option", { value: name })));
    if (!this.model.value) this.model.value = chosen.name;
    fill(this.sets, h("legend", {}, "Datasets"), ...(all.length ? all.map((each) => {
      const box = h("input", { type: "checkbox", id: `set-${each.id}`, value: each.id, disabled: Boolean(each.unreadable) });
      box.checked = was.has(each.id) || (wanted !== null && (each.names?.includes(wanted) || each.id === wanted));
      return h("span.row.tight", {}, box, h("label", { for: `set-${each.id}` }, `${each.name || each.id.slice(0, 12)} (${counted(each.summary?.runs ?? 0, "run")})`));
    }) : [h("p", {}, "There are none yet: ", h("a", { href: chosen.to({ show: "data" }) }, "upload runs"), " first.")]));
  }

  /** @returns {string[]} */
  #datasets() {
    return [...this.sets.querySelectorAll("input:checked")].map((each) => /** @type {HTMLInputElement} */ (each).value);
  }

  #body() {
    /** @type {Record<string, any>} */
    const body = { model: this.model.value.trim(), datasets: this.#datasets() };
    for (const [path, value] of Object.entries({ ...this.usual.values(), ...this.advanced.values() })) {
      const [whole, part] = path.split(".");
      if (part) body[whole] = { ...body[whole], [part]: value };
      else body[path] = value;
    }
    return body;
  }

  async #send() {
    const body = this.#body();
    const text = JSON.stringify(body);
    if (this.tried?.body !== text) this.tried = { body: text, key: random() }; // the same key where the answer was lost: the job is started once
    this.button.disabled = true;
    try {
      const job = await askJson("v1/admin/training-jobs", { body, headers: { "Idempotency-Key": this.tried.key } });
      this.tried = undefined;
      this.#complain([]);
      fill(this.told);
      this.started(job);
    } catch (error) {
      if (!(error instanceof Problem)) throw error;
      this.#complain(error.fields);
      fill(this.told, error.fields.length ? faults(error) : refusal(error));
    } finally {
      this.button.disabled = false;
    }
  }

  /** @param {Problem["fields"]} told */
  #complain(told) {
    const model = told.find(({ field }) => field === "model");
    this.model.parentElement.classList.toggle("wrong", Boolean(model));
    this.hint.textContent = model?.message ?? "It gets a new version; a new name makes a new model.";
    return this.usual.complain(this.advanced.complain(told).filter(({ field }) => field !== "model"));
  }
}

/** 128 random bits; `randomUUID` is there over https only. */
function random() {
  return [...crypto.getRandomValues(new Uint8Array(16))].map((each) => each.toString(16).padStart(2, "0")).join("");
}

