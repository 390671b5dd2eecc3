// @ts-check
// Asks for a token. It is kept in memory only, never in the address, a cookie or the browser's storage.

import { hasToken, onToken, setToken } from "./api.js";
import { h } from "./dom.js";

/** @type {HTMLDialogElement | undefined} */
let dialog;

/** Let the button of the header ask for a token, and ask for it where an answer wanted one. @param {HTMLElement} button */
export function install(button) {
  const show = () => {
    button.textContent = hasToken() ? "Token in use" : "Token";
  };
  button.addEventListener("click", () => open());
  onToken((wanted) => {
    show();
    if (wanted) open(hasToken() ? "The service did not accept this token." : "This service wants a token.");
  });
  show();
}

/**
 * Ask for a token.
 * @param {string} [why]
 */
export function open(why = "") {
  if (dialog?.open) return;
  const field = h("input", { type: "password", id: "token-text", autocomplete: "off", spellcheck: "false" });
  const close = () => dialog?.close();
  dialog = h("dialog", { "aria-labelledby": "token-title" },
    h("form", {
      method: "dialog",
      submit: (/** @type {Event} */ event) => {
        event.preventDefault();
        close();
        setToken(field.value);
      },
    },
    h("h2", { id: "token-title" }, "Token of this service"),
    why && h("p.notice.warn", {}, why),
    h("p", {}, "Uploads, trainings and moves of aliases want a token; some services want one for everything. " +
      "It stays in the memory of this page and is gone when you close it."),
    h("label", { for: "token-text" }, "Token"), field,
    h("p.row", {}, h("button.main", { type: "submit" }, "Use"),
      hasToken() && h("button", { type: "button", click: () => { close(); setToken(""); } }, "Forget it"),
      h("button", { type: "button", click: close }, "Cancel"))));
  const made = /** @type {HTMLDialogElement} */ (dialog);
  made.addEventListener("close", () => made.remove());
  document.body.append(made);
  made.showModal();
}
