// @ts-check
// The card of a version: what it is, how well it predicts runs that it has not seen, where it holds, what it was made from.

import { Problem, address, ask, askJson, download, hasToken } from "../../api.js";
import { datum, fill, h, percent, shown } from "../../dom.js";
import { addressOf } from "../../state.js";
import { promote } from "./aliases.js";
import { confirm, whenAdmitted } from "./dialogs.js";
import { bar, leftOut, metres } from "./evidence.js";
import { bytes, counted, facts, fold, picture, refusal, short, table, when } from "./show.js";

/** @typedef {import("./show.js").Chosen} Chosen */

const UNITS = { slope_deg: "°", mass_kg: "kg", torque_nm: "N m", torque_ratio: "", horizon_s: "s" };
const RANGES = { slope_deg: "Slope", mass_kg: "Mass", torque_nm: "Wheel torque", torque_ratio: "Torque over weight", horizon_s: "Time" };
const WORDS = { published: "in use", archived: "archived", deleted: "deleted" };

/** @param {HTMLElement} room @returns {import("./show.js").Part} */
export function mount(room) {
  let asking = new AbortController();
  /** @type {import("./show.js").Part} */
  const part = {
    unmount: () => asking.abort(),
    async update(chosen) {
      asking.abort();
      asking = new AbortController();
      const { signal } = asking;
      const path = `v1/models/${encodeURIComponent(chosen.name)}/versions/${chosen.version}`;
      try {
        const [manifest, state, card] = await Promise.all([askJson(path, { signal }), askJson(`${path}/state`, { signal }), cardOf(path, signal)]);
        if (signal.aborted) return;
        fill(room, head(chosen, manifest, state), errors(manifest, card), band(manifest), domain(manifest), lineage(chosen, manifest, card), figure(path, signal), files(path, manifest));
        room.dataset.shown = `${chosen.name}@${chosen.version}`;
      } catch (error) {
        if (signal.aborted) return;
        if (!(error instanceof Problem)) throw error;
        fill(room, h("div.card", {}, refusal(error, () => void part.update(chosen))));
      }
    },
  };
  return part;
}

/** The card, or why there is none: the rest of the version can be shown without it. @param {string} path  of the version @param {AbortSignal} signal @returns {Promise<any>} */
async function cardOf(path, signal) {
  try {
    return await askJson(`${path}/card`, { query: { format: "json" }, signal });
  } catch (error) {
    if (error instanceof Problem) return error;
    throw error;
  }
}

/** @param {Chosen} chosen @param {any} manifest @param {any} state */
function head(chosen, manifest, state) {
  const reference = `${chosen.name}@${chosen.version}`;
  const told = h("div");
  const { architecture, prior, inputs } = manifest.checkpoint;
  const button = (/** @type {string} */ words, /** @type {() => void} */ open, /** @type {boolean} */ main = false) =>
    h(main ? "button.main" : "button", { type: "button", click: () => whenAdmitted(told, open) }, words);
  const change = (/** @type {"archive" | "restore"} */ what) => button(what === "archive" ? "Archive…" : "Restore…", () => archive(chosen, what));
  const usable = state.state === "published";
  return h("section.card.stack", { "aria-label": `Version ${chosen.version} of ${chosen.name}` },
    h("div.row", {}, h("h2", {}, `${chosen.name}, version ${chosen.version}`), ...tags(chosen),
      !usable && h("span.tag.bad", {}, WORDS[/** @type {keyof typeof WORDS} */ (state.state)] ?? state.state)),
    manifest.description && h("p.said", {}, manifest.description),
    !usable && h("p.notice.warn", {}, `Out of use since `, when(state.since), `, by ${state.actor}${state.reason ? `: ${state.reason}` : "."}`),
    facts([["Published", h("span", {}, when(manifest.created_at), ` by ${manifest.created_by}`)], ["Learned part", architecture?.name?.replaceAll("_", " ")],
      ["Closed-form part", prior?.name?.replaceAll("_", " ")], ["Sees", inputs?.map((/** @type {any} */ each) => each.name).join(", ")],
      ["Says how sure it is", manifest.band ? `yes: ${manifest.band.method ?? "with a band"}` : "no"]]),
    h("div.row", {}, usable && button("Promote…", () => promote(chosen, chosen.version), true),
      usable && h("a", { href: addressOf("slope", { model: reference }) }, "Ask it on a slope"),
      h("a", { href: chosen.to({ show: "compare" }) }, "Compare with another"),
      state.state === "published" && change("archive"), state.state === "archived" && change("restore")), told);
}

/** The aliases that name a version. @param {Chosen} chosen */
function tags({ models, name, version }) {
  const aliases = models.find((each) => each.name === name)?.aliases ?? {};
  return Object.entries(aliases).filter(([, at]) => at === version).map(([alias]) => h("span.tag.good", {}, alias));
}

/** @param {Chosen} chosen @param {"archive" | "restore"} what */
function archive(chosen, what) {
  const reference = `${chosen.name}@${chosen.version}`;
  const words = what === "archive" ? "It predicts no more, and no alias can be pointed to it. It can be restored." : "It predicts again, and aliases can be pointed to it.";
  confirm({
    title: `${what === "archive" ? "Archive" : "Restore"} ${reference}`, body: [h("p", {}, words)], reason: "optional",
    action: `${what === "archive" ? "Archive" : "Restore"} version ${chosen.version}`,
    act: async (reason) => {
      await ask(`v1/admin/models/${encodeURIComponent(chosen.name)}/versions/${chosen.version}/${what}`, { body: { reason } });
      await chosen.reload();
      return `${reference} is ${what}d`;
    },
  });
}

/** @param {any} manifest @param {any} card  or the Problem in its place */
function errors(manifest, card) {
  const { kind, runs } = leftOut(manifest);
  const title = h("h2", {}, "Errors on runs that it has not seen");
  if (!runs.length) return h("section.card", {}, title, h("p", {}, "Its manifest has none: no runs were kept for testing."));
  if (card instanceof Problem) return h("section.card", {}, title, refusal(card));
  const priors = card.regimes.some((/** @type {any} */ each) => each.prior_final);
  const rows = card.regimes.map((/** @type {any} */ { regime, runs: members, final, prior_final: prior }) => [regime, members,
    datum("median_m", final.median_m, final.median_m < 0.1 ? 4 : 3), metres(final.p90_m), ...(priors ? [metres(prior?.median_m)] : []),
    h("span", {}, bar(final, "--line"), prior && bar(prior, "--prior"))]);
  const heads = ["~What the rover did", "Runs", "Median (m)", "90 % below (m)", ...(priors ? ["Prior alone, median (m)"] : []), "~1 mm to 100 m, a factor of ten each fifth"];
  return h("section.card.stack", {}, title, h("p", {}, `At the end of ${runs.length} runs, ${kind}.`),
    table("Errors by what the rover did", heads, rows),
    priors && h("p.small.muted", {}, "Blue bars: this version; brown: its closed-form part alone. Full colour to the median, lighter to the 90th percentile."),
    fold("Every run", () => tall("Errors of every run", ["~Run", "Slope (°)", "Mass (kg)", "Torque (N m)", "Time (s)", "End, error (m)", "Prior alone (m)"],
      runs.toSorted((one, other) => other.model.final_m - one.model.final_m).map((each) => [each.run, each.slope_deg, each.mass_kg, each.torque_nm, each.horizon_s,
        metres(each.model.final_m), metres(each.prior?.final_m)]))));
}

/** A table of many rows. @param {Parameters<typeof table>} what */
function tall(...what) {
  const made = table(...what);
  made.classList.add("tall");
  return made;
}

/** @param {any} manifest */
function band(manifest) {
  const coverage = manifest.band?.coverage;
  if (!coverage?.regimes) return null;
  const rows = Object.entries(coverage.regimes).map(([name, each]) => [name, each.runs, percent(each.pointwise), percent(each.whole), shown(each.median_half_width_m, 3)]);
  return h("section.card.stack", {}, h("h2", {}, `Does its ${Math.round(100 * coverage.level)} % band hold?`),
    table("Coverage of the band", ["~Runs", "Number", "Moments inside", "Whole runs inside", "Half width, median (m)"], rows));
}

/** @param {any} manifest */
function domain(manifest) {
  const found = Object.entries(manifest.domain ?? {}).filter(([, range]) => Array.isArray(range) && range.length === 2 && typeof range[0] === "number");
  const rows = found.map(([name, [low, high]]) => [RANGES[/** @type {keyof typeof RANGES} */ (name)] ?? name, number(low), number(high), UNITS[/** @type {keyof typeof UNITS} */ (name)] ?? ""]);
  const { runs } = manifest.domain ?? {};
  return h("section.card.stack", {}, h("h2", {}, "Where it holds"),
    h("p", {}, "Outside these ranges, and in gaps between its runs, its answers carry a warning.", Array.isArray(runs) ? ` Its domain knows ${counted(runs.length, "run")}.` : ""),
    table("Domain", ["~Field", "from", "to", "~Unit"], rows));
}

/** @param {number} value */
function number(value) {
  return String(Number(value.toPrecision(4))).replace("-", "−");
}

/** @param {Chosen} chosen @param {any} manifest @param {any} card  or the Problem in its place */
function lineage(chosen, { lineage: made, metrics }, card) {
  const names = new Map((card.datasets ?? []).map((/** @type {{id: string, name: string}} */ each) => [each.id, each.name]));
  const { split, libraries = {} } = made;
  const sets = (made.datasets ?? []).map((/** @type {string} */ id) => h("li", {}, names.get(id) ? `${names.get(id)} ` : "", short(id)));
  const same = made.same_weights_as;
  return h("section.card.stack", {}, h("h2", {}, "What it was made from"), facts([
    ["Datasets", sets.length ? h("ul.plain", {}, ...sets) : ""],
    ["Runs", split ? `${split.train?.length ?? 0} to train on, ${split.test?.length ?? 0} to test; ${split.validation ?? ""}` : ""],
    ["Job", made.job && h("a", { href: chosen.to({ show: "jobs", job: made.job }) }, made.job)],
    ["Seed, threads", made.seed === null || made.seed === undefined ? "" : `${made.seed}, ${made.threads ?? "–"}`],
    ["Fit", metrics?.fit ? `${metrics.fit.epochs ? `${counted(metrics.fit.epochs, "epoch")} in ` : ""}${shown(metrics.fit.elapsed_s, 0)} s` : ""],
    ["Code", made.code_version], ["Same weights as", same && h("span", {}, same)]]),
    made.command && h("pre", { tabindex: "0", role: "region", "aria-label": "Command" }, made.command),
    fold("Libraries", () => facts(Object.entries(libraries))),
    fold("Configuration", () => h("pre", { tabindex: "0", role: "region", "aria-label": "Configuration" }, JSON.stringify(made.config ?? {}, null, 1))));
}

/** The card as the service draws it. @param {string} path @param {AbortSignal} signal */
function figure(path, signal) {
  const room = h("div", {}, h("p.muted", {}, "It is being drawn."));
  const made = h("details", { toggle: async () => {
    if (!made.open || room.dataset.asked) return;
    room.dataset.asked = "yes";
    try {
      fill(room, await picture(`${path}/card`, { format: "svg" }, "Card of this version: figures", signal));
    } catch (error) {
      if (!(error instanceof Problem)) throw error;
      delete room.dataset.asked;
      fill(room, refusal(error));
    }
  } }, h("summary", {}, "Figures"), room);
  return h("section.card", {}, made);
}

/** @param {string} path @param {any} manifest */
function files(path, { files: there, name, version, checkpoint }) {
  const rows = Object.entries(there).map(([file, { size_bytes, sha256 }]) => [file, bytes(size_bytes), short(sha256)]);
  const get = (/** @type {string} */ file) => async (/** @type {Event} */ event) => {
    if (!hasToken()) return;
    event.preventDefault(); // a plain link would come without the token
    await download(/** @type {HTMLAnchorElement} */ (event.currentTarget).href, file);
  };
  const fmu = checkpoint?.architecture?.name === "drive_model" ? ["3.0", "2.0"].map((fmi) => h("li", {},
    h("a", { href: address(`${path}/fmu`, { fmi }), click: get(`${name}-${version}-fmi${fmi}.fmu`) }, `FMU (FMI ${fmi})`))) : [];
  return h("section.card.stack", {}, h("h2", {}, "Files"), h("ul.links", {}, h("li", {}, h("a", { href: address(path), click: get(`${name}-${version}.json`) }, "Manifest (JSON)")), ...fmu),
    fold("Stored files", () => table("Stored files", ["~File", "Size", "~SHA-256"], rows)));
}
