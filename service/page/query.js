// @ts-check
// What of an address cannot be read. A number that is none is never answered with another number: the reader is told.

import { h } from "./dom.js";

const NUMBER = /^[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$/i;

/** @typedef {{field: string, message: string}} Fault */

/** A number of an address; undefined where it is not there or none. @param {string | null} text */
export function numberOf(text) {
  const value = Number(text);
  return text !== null && NUMBER.test(text.trim()) && Number.isFinite(value) ? value : undefined;
}

/**
 * What of an address cannot be read, and the names that the view does not have.
 * @param {URLSearchParams} query
 * @param {{numbers: readonly string[], words: readonly string[]}} known  names of the view
 * @returns {{faults: Fault[], unknown: string[]}}
 */
export function checked(query, { numbers, words }) {
  const known = [...numbers, ...words];
  const faults = known.flatMap((field) => {
    const [text, ...more] = query.getAll(field);
    if (text === undefined) return [];
    if (more.length) return [{ field, message: `${field} is there ${more.length + 1} times` }];
    if (text.trim() === "") return [{ field, message: `${field} is empty` }];
    if (!numbers.includes(field) || numberOf(text) !== undefined) return [];
    return [{ field, message: `${field} is “${short(text)}”, which is no number${text.includes(",") ? " (decimals have a point)" : ""}` }];
  });
  return { faults, unknown: [...new Set(query.keys())].filter((each) => !known.includes(each)) };
}

/** In place of an answer to what cannot be read. @param {Fault[]} faults */
export function unreadable(faults) {
  return h("div.notice.bad.verdict", { role: "alert", "data-verdict": "none", "data-unreadable": "" },
    h("p", {}, h("strong", {}, "This address cannot be read. "), "Nothing was asked."),
    h("ul", {}, ...faults.map(({ message }) => h("li", {}, `${message}.`))), h("p", {}, "Correct the address, or choose values on this page."));
}

/** Names that are no part of the question; null: there are none. @param {string[]} unknown */
export function leftOut(unknown) {
  if (!unknown.length) return null;
  const names = unknown.slice(0, 12).map((each) => `“${short(each)}”`).join(", ");
  return h("p.notice.warn", { role: "status", "data-left-out": "" }, h("strong", {}, "Not all of this address was asked. "), `This view does not know ${names}, and leaves it out.`);
}

/** @param {string} text */
export function short(text) {
  return text.length > 40 ? `${text.slice(0, 40)}…` : text;
}
