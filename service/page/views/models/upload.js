// @ts-check
// Upload: a file is tried first, without being stored. Its report is read, and then it is stored.

import { Problem, sendForm } from "../../api.js";
import { fill, h, percent, say } from "../../dom.js";
import { Form } from "./form.js";
import { reportView } from "./report.js";
import { bytes, faults, refusal } from "./show.js";

const SCENARIO = ["slope_deg", "mass_kg", "torque_nm", "horizon_s"];
const NAMED = ["name", "description"];
const OWN = new Set([...SCENARIO, ...NAMED, "filename", "dry_run"]);
const AT_ONCE = new Set(["admin-off", "unauthorized", "insufficient-scope", "too-many-attempts"]);

export class Upload {
  /** @param {any} schema  of the fields @param {(name: string) => void} stored  hears of each dataset that was stored */
  constructor(schema, stored) {
    this.stored = stored;
    /** @type {File | undefined} */
    this.file = undefined;
    /** @type {AbortController | undefined} */
    this.running = undefined;
    this.scenario = new Form("upload", schema, SCENARIO, () => this.#changed());
    this.advanced = new Form("upload", schema, Object.keys(schema.properties).filter((each) => !OWN.has(each)), () => this.#changed());
    this.named = new Form("upload", schema, NAMED);
    this.input = h("input", { type: "file", id: "upload-file", change: () => this.#chosen(this.input.files), click: () => { this.input.value = ""; } }); // the same file again is a choice, too
    this.told = h("p", { role: "status" }, "Nothing is stored before you say so.");
    this.progress = h("progress", { max: "1", "aria-label": "Upload" });
    this.cancel = h("button", { type: "button", click: () => this.running?.abort() }, "Cancel");
    this.way = h("div.row", { hidden: true }, this.progress, this.cancel);
    this.check = h("button", { type: "button", disabled: true, click: () => void this.#send(true) }, "Check again");
    this.store = h("button.main", { type: "button", click: () => void this.#send(false) }, "Store it");
    this.keep = h("div.stack", { hidden: true }, h("h3", {}, "Store it"), this.named.element, h("p.row", {}, this.store));
    this.report = h("div");
    this.element = this.#laid();
    this.leaving = (/** @type {BeforeUnloadEvent} */ event) => { if (this.running) event.preventDefault(); };
    addEventListener("beforeunload", this.leaving);
  }

  /** Nobody waits for it any more. */
  end() {
    this.running?.abort();
    removeEventListener("beforeunload", this.leaving);
  }

  #laid() {
    const zone = h("div.drop", {}, h("p", {}, h("label", { for: "upload-file" }, h("strong", {}, "Drop a file here, or choose one")), h("br"),
      "A zip or tar with runs.csv, one long CSV or Parquet, or one plain run."), this.input);
    const over = (/** @type {boolean} */ yes) => zone.classList.toggle("over", yes);
    return h("section.card.stack", {
      "aria-label": "Upload",
      dragover: (/** @type {DragEvent} */ event) => { event.preventDefault(); over(true); }, // beside the zone, a browser would open the file
      dragleave: () => over(false),
      drop: (/** @type {DragEvent} */ event) => { event.preventDefault(); over(false); this.#chosen(event.dataTransfer?.files); },
    }, h("h2", {}, "Upload runs"), zone, h("details", {}, h("summary", {}, "Scenario, for one plain run or a table without these columns"), this.scenario.element),
    h("details", {}, h("summary", {}, "Advanced: how the files are to be read"), this.advanced.element),
    h("div.row", {}, this.check, this.told), this.way, this.report, this.keep);
  }

  /** @param {FileList | null | undefined} files */
  #chosen(files) {
    if (!files?.length || this.running) return;
    if (files.length > 1) {
      this.told.textContent = "One file at a time: pack several runs into a zip, with a runs.csv that lists them.";
      return;
    }
    [this.file] = files;
    fill(this.report); // what was found in another file
    this.keep.hidden = true;
    this.check.disabled = false;
    void this.#send(true);
  }

  #changed() {
    this.keep.hidden = true; // what was found holds no longer
    if (this.file) this.told.textContent = "Check again: a field has changed.";
  }

  /** @param {boolean} dry */
  #form(dry) {
    const form = new FormData();
    const values = { ...this.scenario.values(), ...this.advanced.values(), ...(dry && this.keep.hidden ? {} : this.named.values()) };
    for (const [name, value] of Object.entries(values)) form.set(name, String(value));
    if (dry) form.set("dry_run", "true");
    form.set("file", /** @type {File} */ (this.file)); // last: fields are read before it
    return form;
  }

  /** @param {boolean} dry  only tried */
  async #send(dry) {
    const { file } = this;
    if (!file || this.running) return;
    const form = this.#form(dry);
    this.#busy(true);
    this.running = new AbortController();
    const { signal } = this.running;
    const what = `${file.name} (${bytes(file.size)})`;
    try {
      const answer = await sendForm("v1/admin/datasets", form, { signal, sent: (share) => this.#sent(what, share) });
      this.#answered(what, answer, dry);
    } catch (error) {
      if (error instanceof Problem) this.#refused(what, error);
      else if (signal.aborted) this.told.textContent = `${what}: cancelled. ${dry ? "" : "Look at the list whether it was stored."}`;
      else throw error;
    } finally {
      this.running = undefined;
      this.#busy(false);
    }
  }

  /** @param {boolean} yes */
  #busy(yes) {
    this.way.hidden = !yes;
    for (const each of [this.input, this.check, this.store]) each.disabled = yes;
    if (yes) {
      this.scenario.complain([]);
      this.advanced.complain([]);
      this.named.complain([]);
    }
  }

  /** @param {string} what @param {number} share */
  #sent(what, share) {
    if (share < 1) this.progress.value = share;
    else this.progress.removeAttribute("value"); // how long the service reads it is not known
    this.told.textContent = share < 1 ? `${what}: ${percent(share)} sent.` : `${what}: the service reads it.`;
  }

  /** @param {string} what @param {any} answer @param {boolean} dry */
  #answered(what, answer, dry) {
    const known = answer.already_known_as ?? [];
    this.told.textContent = dry ? `${what}: checked, nothing is stored.` : `${what}: ${answer.created ? "stored" : "was stored already"}.`;
    fill(this.report, reportView(answer.report, { stored: dry ? "" : answer.name }),
      dry && answer.stored && h("p.notice", {}, `The store has these very runs already${known.length ? `, as ${known.join(", ")}` : ""}.`));
    this.keep.hidden = !dry;
    say(this.report.querySelector("strong")?.textContent ?? this.told.textContent);
    if (!dry) this.stored(answer.name ?? answer.id);
  }

  /** @param {string} what @param {Problem} problem */
  #refused(what, problem) {
    const { report } = problem.document ?? {};
    this.keep.hidden = this.keep.hidden || Boolean(report);
    this.told.textContent = `${what}: not ${report ? "usable" : "taken"}.`;
    if (report) {
      fill(this.report, reportView(report));
      say(problem.message);
      return;
    }
    const named = this.named.complain(problem.fields);
    this.scenario.complain(problem.fields);
    const rest = this.advanced.complain(named);
    if (problem.type === "dataset-name-taken") this.named.complain([{ field: "name", message: problem.message }]);
    fill(this.report, AT_ONCE.has(problem.type) || !rest.length ? refusal(problem) : faults(problem));
  }
}
