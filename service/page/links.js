// @ts-check
// The question of a view for other programs: links to its forms, and a curl command.

import { address, ask, download, hasToken, save } from "./api.js";
import { h, say } from "./dom.js";

/** @type {Record<string, string>} */
const WORDS = { usda: "USD", arrow: "Arrow", html: "Report" };

/**
 * The same for a question that is sent as a body: each form is fetched and saved.
 * @param {string} path  `v1/drives`
 * @param {Record<string, any>} body
 * @param {string[]} forms
 */
export function elsewherePosted(path, body, forms) {
  const get = (/** @type {string} */ form) => async (/** @type {any} */ event) => {
    const button = event.currentTarget;
    button.disabled = said.hidden = true;
    try {
      const answer = await ask(path, { query: { format: form }, body, deadline_s: 60 });
      save(await answer.blob(), `${path.split("/").at(-1)}.${form}`);
    } catch (error) {
      said.textContent = error instanceof Error ? error.message : String(error);
      said.hidden = false;
    } finally {
      button.disabled = false;
    }
  };
  const said = h("p.fault", { role: "alert", hidden: true });
  const buttons = forms.map((form) => h("button", { type: "button", click: get(form), "data-form": form }, WORDS[form] ?? form.toUpperCase()));
  const command = `curl ${address(path)} -H 'Content-Type: application/json' -d '${JSON.stringify(body)}'`;
  return h("div.stack", {}, h("div.row", { role: "group", "aria-label": "Save the answer as" }, ...buttons), said, copied(command));
}

/** A command with a button that copies it. @param {string} command */
function copied(command) {
  const copy = h("button", { type: "button", click: async () => {
    await navigator.clipboard.writeText(command);
    copy.textContent = "Copied";
    say("Copied");
  } }, "Copy");
  return h("div.command", {}, h("pre", { tabindex: "0", role: "region", "aria-label": "The question as a curl command" }, command),
    navigator.clipboard && copy); // browsers let only https and this machine copy
}

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
  return h("div.stack", {}, h("ul.links", {}, ...links), copied(`curl "${address(path, question)}"`));
}
