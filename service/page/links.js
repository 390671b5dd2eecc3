// @ts-check
// The question of a view for other programs: links to its forms, and a curl command.

import { address, download, hasToken } from "./api.js";
import { h, say } from "./dom.js";

/** @type {Record<string, string>} */
const WORDS = { usda: "USD", arrow: "Arrow", html: "Report" };

/**
 * Links to an answer in each form, and the curl command of the question.
 * @param {string} path  `v1/predictions`
 * @param {Record<string, any>} question
 * @param {string[]} forms  as `format` takes them
 */
export function elsewhere(path, question, forms) {
  const get = (/** @type {string} */ form) => async (/** @type {Event} */ event) => {
    if (!hasToken()) return;
    event.preventDefault(); // a plain link would come without the token
    await download(address(path, { ...question, format: form }), `${path.split("/").at(-1)}.${form}`);
  };
  const links = forms.map((form) => h("li", {},
    h("a", { href: address(path, { ...question, format: form }), click: get(form), "data-form": form }, WORDS[form] ?? form.toUpperCase())));
  const command = `curl "${address(path, question)}"`;
  const copy = h("button", { type: "button", click: async () => {
    await navigator.clipboard.writeText(command);
    copy.textContent = "Copied";
    say("Copied");
  } }, "Copy");
  return h("div.stack", {}, h("ul.links", {}, ...links), h("div.command", {},
    h("pre", { tabindex: "0", role: "region", "aria-label": "The question as a curl command" }, command),
    navigator.clipboard && copy)); // browsers let only https and this machine copy
}
