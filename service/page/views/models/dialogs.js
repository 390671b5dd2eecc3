// @ts-check
// Dialogs that say what will happen and ask for a reason before it does.

import { Problem, ask as askService } from "../../api.js";
import { fill, h, say } from "../../dom.js";
import { refusal } from "./show.js";

/** @type {Set<HTMLDialogElement>} */
const opened = new Set();

/**
 * What a dialog shows. `otherwise` names the button that does nothing. `act` is called with the reason and does it; `again` gets a refusal, and may return what holds now.
 * @typedef {{title: string, body: Node[], action: string, otherwise?: string, reason?: "wanted" | "optional" | "none",
 *   act: (reason: string) => Promise<string>, again?: (problem: Problem) => Promise<Content | undefined>}} Content
 */

/**
 * Ask; does nothing until the button that names it is pressed.
 * @param {Content} content
 * @returns {{replace: (other: Content) => void}}  shows something else in the dialog
 */
export function confirm(content) {
  let now = content;
  const title = h("h2", { id: "confirm-title", tabindex: "-1" });
  const body = h("div.stack");
  const told = h("div");
  const reason = h("textarea", { id: "confirm-reason", rows: "2", maxlength: "4000" });
  const label = h("label", { for: "confirm-reason" });
  const go = h("button.main", { type: "submit" });
  const close = () => dialog.close();
  const leave = h("button", { type: "button", click: close });
  const dialog = /** @type {HTMLDialogElement} */ (h("dialog.wide", { "aria-labelledby": "confirm-title" }, h("form", { method: "dialog", submit: sent },
    title, body, label, reason, told, h("p.row", {}, go, leave))));

  function show() {
    fill(title, now.title);
    fill(body, ...now.body);
    go.textContent = now.action;
    leave.textContent = now.otherwise ?? "Cancel";
    label.hidden = reason.hidden = now.reason === "none";
    reason.required = (now.reason ?? "wanted") === "wanted";
    label.textContent = reason.required ? "Reason, kept in the history" : "Reason, kept with it (may be empty)";
  }

  /** @param {Event} event */
  async function sent(event) {
    event.preventDefault();
    if (reason.required && !reason.value.trim()) {
      reason.focus();
      return;
    }
    go.disabled = true;
    try {
      const words = await now.act(reason.value.trim());
      close();
      say(words);
    } catch (error) {
      if (!(error instanceof Problem)) throw error;
      if (dialog.isConnected) await refused(error);
    } finally {
      go.disabled = false;
    }
  }

  /** @param {Problem} problem */
  async function refused(problem) {
    const other = await now.again?.(problem);
    if (other) {
      now = other;
      fill(told);
      show();
    } else fill(told, refusal(problem));
  }

  dialog.addEventListener("close", () => {
    opened.delete(dialog);
    dialog.remove();
  });
  opened.add(dialog);
  show();
  document.body.append(dialog);
  dialog.showModal();
  (reason.hidden ? go : reason).focus();
  return { replace: (other) => {
    now = other;
    fill(told);
    show();
  } };
}

/** Take all of them away: what they ask about is not shown any more. */
export function closeAll() {
  for (const dialog of [...opened]) dialog.close();
}

/**
 * Whether this page may change something. Raises Problem where it may not; the shell asks for a token where one is missing.
 * @returns {Promise<void>}
 */
export async function admitted() {
  await askService("v1/admin/datasets", { query: { limit: 1 } });
}

/**
 * Open a dialog if the token allows what it would do; say why not in `room` otherwise.
 * @param {HTMLElement} room @param {() => void | Promise<void>} open
 */
export async function whenAdmitted(room, open) {
  try {
    await admitted();
    fill(room);
    await open();
  } catch (error) {
    if (!(error instanceof Problem)) throw error;
    fill(room, refusal(error));
  }
}
