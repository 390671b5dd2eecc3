// @ts-check
// How this view shows tables, times, sizes and refusals.

import { unreachable } from "../../again.js";
import { ask as askService, hasToken } from "../../api.js";
import { h, shown } from "../../dom.js";
import { open as openToken } from "../../token.js";

/**
 * What each part of the view is told: which version is chosen, and how to go elsewhere.
 * @typedef {{models: import("../../fields.js").ModelEntry[], name: string, version: number, query: URLSearchParams,
 *   to: (changes: Record<string, string | number>) => string, reload: () => Promise<void>}} Chosen
 * @typedef {{update: (chosen: Chosen) => void | Promise<void>, unmount?: () => void}} Part
 */

/**
 * A table in a region that scrolls by itself.
 * @param {string} label @param {(string | Node)[]} heads  those that begin with a tilde hold text @param {any[][]} rows  the first cell heads its row
 * @returns {HTMLElement}
 */
export function table(label, heads, rows) {
  const texts = heads.map((each) => typeof each === "string" && each.startsWith("~"));
  const head = heads.map((each, at) => h(texts[at] ? "th.text" : "th", { scope: "col" }, typeof each === "string" ? each.replace(/^~/, "") : each));
  return h("div.scroll", { tabindex: "0", role: "region", "aria-label": label }, h("table", {}, h("thead", {}, h("tr", {}, ...head)),
    h("tbody", {}, ...rows.map((row) => h("tr", {}, ...row.map((cell, at) =>
      h(`${at ? "td" : "th"}${texts[at] ? ".text" : ""}`, at ? {} : { scope: "row" }, cell)))))));
}

/** A list of names with values; empty ones are left out. @param {[string, any][]} entries */
export function facts(entries) {
  const there = entries.filter(([, value]) => value !== null && value !== undefined && value !== "");
  return h("dl.rows", {}, ...there.flatMap(([name, value]) => [h("dt", {}, name), h("dd", {}, value)]));
}

/** A time of the service as people read it. @param {string | null | undefined} text */
export function when(text) {
  const time = new Date(text ?? "");
  if (Number.isNaN(time.valueOf())) return "–";
  const iso = time.toISOString();
  return h("time", { datetime: iso, title: time.toLocaleString() }, `${iso.slice(0, 10)} ${iso.slice(11, 16)} UTC`);
}

/** @param {number} size */
export function bytes(size) {
  if (size < 1000) return `${size} B`;
  return size < 1e6 ? `${shown(size / 1e3, 1)} kB` : `${shown(size / 1e6, 1)} MB`;
}

/** @param {number} count @param {string} one @param {string} [many] */
export function counted(count, one, many = `${one}s`) {
  return `${count} ${count === 1 ? one : many}`;
}

/** A range of the service's summaries. @param {{lowest: number, highest: number} | undefined} range @param {string} [unit] */
export function span(range, unit = "") {
  if (!range || typeof range.lowest !== "number") return "–";
  const [low, high] = [range.lowest, range.highest].map((each) => String(Number(each.toPrecision(4))).replace("-", "−"));
  return `${low === high ? low : `${low} to ${high}`}${unit && ` ${unit}`}`;
}

/** Short words for a long id. @param {string} id */
export function short(id) {
  return h("code", { title: id }, id.slice(0, 12));
}

const TURN_ON = `(umask 077; python3 -c "import secrets; print(secrets.token_urlsafe(32))" > token)
ROVER_TWIN_ADMIN_TOKEN=$(cat token) rover-twin serve --store STORE`;

/**
 * Why the service did not do it, in plain words, and what to do.
 * @param {import("../../api.js").Problem} problem @param {(() => void)} [again]
 */
export function refusal(problem, again) {
  if (problem.unreachable && again) return unreachable(again);
  const retry = again && h("button", { type: "button", click: again }, "Try again");
  const ask = h("button", { type: "button", click: () => openToken() }, hasToken() ? "Use another token" : "Enter a token");
  /** @type {Record<string, [string, any]>} */
  const known = {
    "admin-off": ["Uploads, trainings and moves are off.", h("div.stack", {},
      h("p", {}, "This service was started without a token. Whoever runs it turns them on with one:"),
      h("pre", { tabindex: "0", role: "region", "aria-label": "How to start the service with a token" }, TURN_ON),
      h("p", {}, "ROVER_TWIN_TOKENS_FILE does the same for several people. Then enter the token here."))],
    unauthorized: ["This needs a token.", h("div.stack", {}, h("p", {}, hasToken() ? "The service did not accept the one that you entered." :
      "Uploads, trainings and moves want a token of scope “admin”."), h("p.row", {}, ask, retry))],
    "insufficient-scope": ["This token may only read.", h("div.stack", {}, h("p", {}, "Uploads, trainings and moves want a token of scope “admin”."), h("p.row", {}, ask))],
    "too-many-attempts": ["Too many wrong tokens.", h("div.stack", {}, h("p", {}, `The right one is let in at once. Other tries wait${problem.wait_s ? ` ${problem.wait_s} s` : ""}.`), h("p.row", {}, ask, retry))],
  };
  const [head, body] = known[problem.type] ?? [`${problem.title}.`, h("div.stack", {}, h("p", {}, problem.message,
    problem.wait_s ? ` Try again in ${problem.wait_s} s.` : ""), retry && h("p.row", {}, retry))];
  return h("div.notice.bad", { role: "alert", "data-refused": problem.type || problem.status }, h("p", {}, h("strong", {}, head)), body);
}

/** A refusal of some fields, where they cannot be shown beside each. @param {import("../../api.js").Problem} problem */
export function faults(problem) {
  const told = problem.fields.filter(({ message }) => message !== problem.message);
  return h("div.notice.bad", { role: "alert", "data-refused": problem.type || problem.status }, h("p", {}, h("strong", {}, `${problem.title}. `), problem.message),
    told.length > 0 && h("ul", {}, ...told.slice(0, 20).map((each) => h("li", {}, each.message))));
}

/** A fold that is made when it is first opened. @param {string} words @param {() => Node} make */
export function fold(words, make) {
  const made = h("details", { toggle: () => { if (made.open && made.children.length === 1) made.append(make()); } }, h("summary", {}, words));
  return made;
}

/** A picture of the service; with the token where there is one. @param {string} path @param {Record<string, string>} query @param {string} alt @param {AbortSignal} [signal] */
export async function picture(path, query, alt, signal) {
  const answer = await askService(path, { query, signal, deadline_s: 60 });
  const image = h("img.figure", { alt, src: URL.createObjectURL(await answer.blob()) });
  image.addEventListener("load", () => URL.revokeObjectURL(image.src), { once: true });
  return image;
}
