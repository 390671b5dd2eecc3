// @ts-check
// Data: upload of runs, and the datasets that the store has.

import { Problem, askJson, download, hasToken } from "../../api.js";
import { fill, h } from "../../dom.js";
import { schemaOf } from "../../fields.js";
import { picture, refusal, short, span, table } from "./show.js";
import { Upload } from "./upload.js";

/** @typedef {{id: string, name: string, names: string[], created_at: string, description: string, summary: any, unreadable: string | null}} Dataset */

const MOST_PAGES = 50;

/** All datasets. Raises Problem. @param {AbortSignal} [signal] @returns {Promise<Dataset[]>} */
export async function datasets(signal) {
  /** @type {Dataset[]} */
  const all = [];
  let after = "";
  for (let page = 0; page < MOST_PAGES; page++) {
    const found = await askJson("v1/admin/datasets", { query: { limit: 200, after }, signal });
    all.push(...found.datasets);
    if (!found.next || !found.datasets.length) break;
    after = found.datasets.at(-1).id;
  }
  return all.sort((one, other) => String(other.created_at).localeCompare(String(one.created_at)));
}

/** @param {HTMLElement} room @returns {import("./show.js").Part} */
export function mount(room) {
  /** @type {Upload | undefined} */
  let upload;
  /** @type {import("./show.js").Chosen | undefined} */
  let chosen;
  const list = h("section.card.stack", { "aria-label": "Datasets" });
  const next = h("div");
  const gone = new AbortController();

  async function show() {
    try {
      const [all, schema] = await Promise.all([datasets(gone.signal), schemaOf("upload")]);
      if (!upload) {
        upload = new Upload(schema, (name) => {
          fill(next, h("p.notice.good", {}, "It can be trained on now: ", h("a", { href: chosen?.to({ show: "jobs", dataset: name, job: "" }) }, `start a training on ${name}`), "."));
          void show();
        });
        fill(room, upload.element, next, list);
      }
      fillList(list, all);
      room.dataset.shown = String(all.length);
    } catch (error) {
      if (gone.signal.aborted) return;
      if (!(error instanceof Problem)) throw error;
      fill(upload ? list : room, h("div.card", {}, refusal(error, () => void show())));
    }
  }

  return {
    unmount: () => {
      upload?.end();
      gone.abort();
    },
    update(now) {
      chosen = now;
      if (!upload?.running) return show();
      return undefined;
    },
  };
}

/** @param {HTMLElement} list @param {Dataset[]} all */
function fillList(list, all) {
  const shown = h("div");
  const rows = all.map((each) => {
    const path = `v1/admin/datasets/${each.id}`;
    const figure = h("button", { type: "button", click: () => show(shown, each.name, path) }, "Figure");
    const get = h("button", { type: "button", click: () => download(path + "/download", `${each.name || each.id.slice(0, 12)}.parquet`).catch((error) => complain(shown, error)) }, "Parquet");
    const { summary = {} } = each;
    return [h("span", { title: each.id }, each.names?.join(", ") || each.name || short(each.id)), summary.runs ?? "–", summary.rows?.toLocaleString("en") ?? "–",
      span(summary.slope_deg, "°"), span(summary.mass_kg, "kg"), span(summary.torque_nm, "N m"), each.unreadable ? h("strong.bad", {}, each.unreadable) : each.description,
      h("span.row.tight", { role: "group", "aria-label": each.name }, figure, get)];
  });
  fill(list, h("h2", {}, "Datasets"), all.length ? table("All datasets", ["~Name", "Runs", "Rows", "Slope", "Mass", "Torque", "~Description", "~See"], rows) :
    h("p", {}, hasToken() ? "The store has none yet. Upload runs above." : ""), shown);
}

/** @param {HTMLElement} room @param {string} name @param {string} path */
async function show(room, name, path) {
  fill(room, h("p.muted", { role: "status" }, "It is being drawn."));
  try {
    fill(room, h("figure.plot", {}, h("figcaption", {}, name), await picture(`${path}/preview`, { format: "svg" }, `Runs of the dataset ${name}`)));
  } catch (error) {
    complain(room, error);
  }
}

/** @param {HTMLElement} room @param {unknown} error */
function complain(room, error) {
  if (!(error instanceof Problem)) throw error;
  fill(room, refusal(error));
}

