// @ts-check
// One training job: where it stands as it runs, its log, what came out, and the button that stops it.

import { Problem, ask, askJson } from "../../api.js";
import { fill, h, say, shown } from "../../dom.js";
import { promote } from "./aliases.js";
import { confirm, whenAdmitted } from "./dialogs.js";
import { ENDED, follow } from "./events.js";
import { facts, fold, refusal, table, when } from "./show.js";

const MOST_LINES = 2000;
const VERDICTS = { first: "good", better: "good", not_better: "warn", not_comparable: "warn" };
const STATES = { queued: "It waits for a worker.", running: "It runs.", succeeded: "It is done.", failed: "It failed.", cancelled: "It was cancelled." };

export class JobView {
  /** @param {string} id @param {import("./show.js").Chosen} chosen @param {() => void} changed  its state is another one */
  constructor(id, chosen, changed) {
    this.id = id;
    this.chosen = chosen;
    this.changed = changed;
    this.gone = new AbortController();
    this.state = h("span.tag", {}, "…");
    this.live = h("span.small.muted");
    this.progress = h("progress", { max: "1", value: "0", "aria-label": "Progress of the training" });
    this.words = h("p.reading");
    this.told = h("div");
    this.result = h("div");
    this.about = h("div");
    this.lines = h("pre.log", { tabindex: "0", role: "log", "aria-label": "Log of the job" });
    this.cancel = h("button", { type: "button", hidden: true, click: () => whenAdmitted(this.told, () => this.#stop()) }, "Cancel the job…");
    this.element = h("section.card.stack", { "data-job": id, "aria-label": "Job" }, h("div.row", {}, h("h2", {}, `Job ${id.slice(0, 8)}`), this.state, this.live, this.cancel),
      this.progress, this.words, this.told, this.result, h("h3", {}, "Log"), this.lines, this.about);
    void this.#run();
  }

  /** Nobody watches it any more. */
  end() {
    this.gone.abort();
  }

  async #run() {
    const { signal } = this.gone;
    try {
      await this.#read();
      await follow(this.id, { signal, heard: (event) => this.#heard(event), told: (state) => {
        this.live.textContent = state === "live" ? "live" : "The connection was lost; it is taken up again.";
      } });
      this.live.textContent = "";
      await this.#read();
      await this.chosen.reload(); // it may have made a version
      this.changed();
    } catch (error) {
      if (signal.aborted) return;
      if (!(error instanceof Problem)) throw error;
      this.live.textContent = "";
      fill(this.told, refusal(error, () => { fill(this.told); void this.#run(); }));
    }
  }

  async #read() {
    const job = await askJson(`v1/admin/training-jobs/${encodeURIComponent(this.id)}`, { signal: this.gone.signal });
    this.#standing(job.state);
    if (job.progress && job.state === "running") this.#along(job.progress);
    fill(this.about, fold("What was asked", () => facts([["Asked", h("span", {}, when(job.created_at), ` by ${job.actor}`)], ["Began", when(job.started_at)], ["Ended", when(job.finished_at)],
      ["Workers that took it up", job.attempts], ["Request", h("pre", { tabindex: "0", role: "region", "aria-label": "Request" }, JSON.stringify(job.request, null, 1))]])));
    if (job.result) fill(this.result, this.#came(job.result));
    if (job.failure) fill(this.result, h("div.notice.bad", {}, h("p", {}, h("strong", {}, `${job.failure.type}. `), job.failure.message), h("p", {}, job.failure.remedy)));
  }

  /** @param {string} state */
  #standing(state) {
    const before = this.element.dataset.state;
    this.element.dataset.state = state;
    this.state.textContent = state;
    this.cancel.hidden = ENDED.has(state);
    if (ENDED.has(state)) {
      this.progress.hidden = true;
      this.words.textContent = STATES[/** @type {keyof typeof STATES} */ (state)];
    }
    if (before === state) return;
    say(`Job ${this.id.slice(0, 8)}: ${STATES[/** @type {keyof typeof STATES} */ (state)] ?? state}`);
    if (before !== undefined) this.changed();
  }

  /** @param {import("./events.js").JobEvent} event */
  #heard({ kind, data }) {
    if (kind === "state") this.#standing(data.state);
    else if (kind === "progress") this.#along(data);
    else if (kind === "log") this.#line(data);
  }

  /** @param {any} told */
  #along({ phase, fraction, epoch, epochs, eta_s, train_error_m, validation_error_m }) {
    this.progress.value = fraction;
    this.element.dataset.fraction = String(fraction);
    const parts = [`${Math.round(100 * fraction)} %: ${phase}`, epoch != null && `epoch ${epoch}${epochs ? ` of ${epochs}` : ""}`,
      train_error_m != null && `error ${shown(train_error_m, 4)} m`, validation_error_m != null && `on validation rows ${shown(validation_error_m, 4)} m`, eta_s != null && `about ${Math.ceil(eta_s)} s left`];
    this.words.textContent = parts.filter(Boolean).join(", ");
  }

  /** @param {any} told */
  #line({ time, message }) {
    const atEnd = this.lines.scrollTop + this.lines.clientHeight >= this.lines.scrollHeight - 8;
    this.lines.append(`${String(time).slice(11, 19)} ${message}\n`);
    while (this.lines.childNodes.length > MOST_LINES) this.lines.firstChild?.remove();
    if (atEnd) this.lines.scrollTop = this.lines.scrollHeight;
  }

  #stop() {
    confirm({
      title: `Cancel job ${this.id.slice(0, 8)}`, action: "Cancel the job", otherwise: "Keep it running", reason: "none",
      body: [h("p", {}, "It ends within seconds and publishes nothing. What it has computed is lost.")],
      act: async () => {
        await ask(`v1/admin/training-jobs/${encodeURIComponent(this.id)}/cancel`, { method: "POST" });
        return "The job is cancelled";
      },
    });
  }

  /** What a job made. @param {any} result */
  #came({ model, version, comparison, promoted, same_weights_as }) {
    const kind = VERDICTS[/** @type {keyof typeof VERDICTS} */ (comparison?.verdict)] ?? "good";
    const told = h("div");
    const here = { ...this.chosen, name: model, version };
    const tails = Object.entries(comparison?.p90 ?? {}).map(([name, each]) => [name.replace(/_m$/, "").replaceAll("_", " "), shown(each.candidate_m, 4), shown(each.against_m, 4), shown(each.ratio, 3)]);
    return h("div.stack", { "data-made": `${model}@${version}` }, h(`div.notice.${kind}`, {}, h("p", {}, h("strong", {}, `It made version ${version} of ${model}. `), comparison?.sentence ? `${comparison.sentence}.` : ""),
      promoted && h("p", {}, "Champion points to it now."), same_weights_as && h("p", {}, `It has the same weights as ${same_weights_as}.`)),
    tails.length > 0 && fold("Errors beside the champion's", () => table("90th percentiles", ["~Error, 90 % below", "New (m)", `${comparison.against} (m)`, "Times"], tails)),
    h("div.row", {}, h("a", { href: this.chosen.to({ model, version, show: "card" }) }, `Card of version ${version}`),
      comparison?.against && h("a", { href: this.chosen.to({ model, version, show: "compare", with: comparison.against }) }, "Compare both"),
      h("button", { type: "button", click: () => whenAdmitted(told, () => promote(here, version)) }, `Promote version ${version}…`)), told);
  }
}
