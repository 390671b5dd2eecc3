// @ts-check
// The shell: the view that the address names is loaded, mounted, told of each change of its question, and taken away.
//
// A view is a module `views/NAME.js` with `mount(element, state)`, which returns, or promises, `{update(state), unmount()}`.

import { noAnswer, unreachable } from "./again.js";
import { Problem, ask, download, hasToken, onToken } from "./api.js";
import { h, say } from "./dom.js";
import { lastOf, listen, read } from "./state.js";
import { install } from "./token.js";

/** @typedef {{update?: (state: import("./state.js").State) => void, unmount?: () => void}} View */

const VIEWS = new Map([["drive", "Drive"], ["slope", "Slope"], ["mobility", "Mobility"], ["models", "Models and training"]]);

const main = /** @type {HTMLElement} */ (document.getElementById("main"));
const links = /** @type {NodeListOf<HTMLAnchorElement>} */ (document.querySelectorAll("#views a"));
let name = "";
/** @type {View} */
let view = {};
let turn = 0;
let failed = 0; // modules that did not come: a browser may remember that of an address

/** @param {import("./state.js").State} state @param {{first?: boolean}} [how] */
async function show(state, { first = false } = {}) {
  const title = VIEWS.get(state.view);
  if (!title) {
    stop();
    mark();
    document.title = "Rover Twin";
    main.replaceChildren(h("h1", {}, "No such view"), h("p", {}, `There is no view “${state.view}”. Choose one above.`));
    return;
  }
  if (state.view === name) {
    view.update?.(state);
    return;
  }
  stop();
  name = state.view;
  const mine = ++turn;
  document.title = `${title} – Rover Twin`;
  mark();
  const room = h("div.view", { "data-view": name });
  try {
    const module = await loaded(name);
    if (mine !== turn) return;
    main.replaceChildren(room);
    const asked = location.hash;
    const mounted = await module.mount(room, read());
    if (mine !== turn) {
      mounted.unmount?.();
      return;
    }
    view = mounted;
    if (location.hash !== asked) view.update?.(read());
  } catch (error) {
    if (mine !== turn) return;
    name = ""; // the next address tries anew
    main.replaceChildren(h("h1", {}, title), failure(error));
  }
  if (first || mine !== turn) return;
  main.focus({ preventScroll: true });
  scrollTo(0, 0);
  say(title);
}

/** The module of a view. Raises Lost. @param {string} view @returns {Promise<{mount: (element: HTMLElement, state: any) => View | Promise<View>}>} */
async function loaded(view) {
  try {
    return await import(`./views/${view}.js${failed ? `?again=${failed}` : ""}`);
  } catch (error) {
    failed += 1;
    console.error(error);
    throw new Lost();
  }
}

/** A module did not come. */
class Lost extends Error {}

/** In place of a view that could not be shown. @param {unknown} error */
function failure(error) {
  const again = () => void show(read(), { first: true });
  if (error instanceof Problem) return noAnswer(error, again);
  if (!(error instanceof Lost)) {
    console.error(error);
    return h("p.notice.bad", { role: "alert" }, `This view could not be shown: ${error}`);
  }
  // A module that a view needs may be remembered as lost, too: only a new page forgets that, and with it a token.
  if (!hasToken()) return unreachable(() => location.reload());
  if (failed < 3) return unreachable(again);
  return h("div.notice.bad", { role: "alert" }, h("p", {}, h("strong", {}, "A part of this page did not come. "), "Load the page again; it will ask for the token again."),
    h("p.row", {}, h("button", { type: "button", click: () => location.reload() }, "Load the page again")));
}

function stop() {
  turn += 1;
  view.unmount?.();
  view = {};
  name = "";
}

function mark() {
  for (const link of links) {
    if (link.dataset.view === name) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
}

for (const link of links) {
  // each view is left and found again with its question
  const aim = () => { link.href = lastOf(/** @type {string} */ (link.dataset.view)); };
  for (const event of ["pointerenter", "focus", "click"]) link.addEventListener(event, aim);
}
document.getElementById("skip")?.addEventListener("click", (event) => {
  event.preventDefault(); // the address is the question's
  main.focus();
});
/** Links that a service may give only for a token, which a plain link cannot carry. @param {HTMLAnchorElement} link @param {(() => Promise<void>) | undefined} get */
function guarded(link, get) {
  const told = h("span", { role: "status" });
  link.after(told);
  link.addEventListener("click", async (event) => {
    if (event.ctrlKey || event.metaKey || event.shiftKey) return;
    event.preventDefault();
    const { status } = await fetch(link.href, { credentials: "omit" }).catch(() => ({ status: 0 }));
    told.textContent = "";
    if (status === 401 && get) await get().catch((error) => { told.textContent = ` (${error.message})`; });
    else if (status === 401) told.textContent = " (needs the token, which a link cannot carry: start with OpenAPI)";
    else if (status === 0) told.textContent = " (the service cannot be reached)";
    else location.assign(link.href);
  });
}

guarded(/** @type {HTMLAnchorElement} */ (document.getElementById("docs")), undefined);
guarded(/** @type {HTMLAnchorElement} */ (document.getElementById("openapi")), async () => {
  await (hasToken() ? download("openapi.json", "openapi.json") : ask("openapi.json")); // without one, the answer asks for it
});
install(/** @type {HTMLElement} */ (document.getElementById("token")));
onToken((wanted) => {
  if (wanted) return;
  stop(); // who asks with another token sees other things
  void show(read(), { first: true });
});
listen((state) => void show(state));
void show(read(), { first: true });
