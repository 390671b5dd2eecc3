// @ts-check
// Loads an elevation profile: a file that is chosen or dropped, or pasted text.

import { h, say } from "../dom.js";
import { profileOf, textOf } from "./drive_profile.js";

export class ProfileLoader {
  /** @param {(track: import("./drive_ground.js").Track) => void} loaded */
  constructor(loaded) {
    this.loaded = loaded;
    this.file = h("input", { type: "file", id: "drive-file", accept: ".csv,.txt,.tsv,text/csv,text/plain", "aria-describedby": "drive-file-said", change: () => {
      const [file] = this.file.files;
      if (file) void this.#take(textOf(file), file.name);
      this.file.value = ""; // the same file can be chosen again
    } });
    this.text = h("textarea", { id: "drive-text", rows: 5, spellcheck: "false", placeholder: "0, 0\n2, 0.15\n4, 0.7" });
    this.said = h("p.fault", { id: "drive-file-said", role: "alert", hidden: true });
    this.notes = h("p.small.muted", { role: "status" });
    const drop = h("details.loader", {
      dragover: (/** @type {DragEvent} */ event) => event.preventDefault(),
      drop: (/** @type {DragEvent} */ event) => {
        event.preventDefault();
        const file = event.dataTransfer?.files[0];
        if (file) void this.#take(textOf(file), file.name);
      },
    }, h("summary", {}, "Load an elevation profile"),
    h("p.small", {}, "Two columns, distance and elevation in metres, with or without a heading. The file is read in this browser; at most 2 MB and 10,000 places. The rover starts at distance 0."),
    h("div.row", {}, h("label", { for: "drive-file" }, "CSV file"), this.file),
    h("label", { for: "drive-text" }, "Or paste it"), this.text,
    h("div.row", {}, h("button", { type: "button", click: () => void this.#take(Promise.resolve(this.text.value), "The text") }, "Use this text")));
    this.element = h("div", {}, drop, this.said, this.notes);
  }

  /** Say nothing any more of what was loaded, or could not be. */
  quiet() {
    this.said.hidden = true;
    this.said.textContent = this.notes.textContent = "";
  }

  /** @param {Promise<string>} coming @param {string} name */
  async #take(coming, name) {
    try {
      const { track, notes } = profileOf(await coming);
      this.said.hidden = true;
      this.notes.textContent = [`${name}: ${track.x.length.toLocaleString("en")} places, ${track.x[0]} to ${track.x[track.x.length - 1]} m.`, ...notes].join(" ");
      this.loaded(track);
    } catch (error) {
      this.said.textContent = error instanceof Error ? error.message : String(error);
      this.said.hidden = false;
      this.notes.textContent = "";
      say(this.said.textContent);
    }
  }
}
