// @ts-check
// The shell: the view that the address names is loaded, mounted, told of each change of its question, and taken away.
//
// A view is a module `views/NAME.js` with `mount(element, state)`, which returns, or promises, `{update(state), unmount()}`.

import { onToken } from "./api.js";
import { h, say } from "./dom.js";
import { lastOf, listen, read } from "./state.js";
import { install } from "./token.js";

/** @typedef {{update?: (state: import("./state.js").State) => void, unmount?: () => void}} View */

/** @type {Record<string, {title: string, load: () => Promise<{mount: (element: HTMLElement, state: any) => View | Promise<View>}>}>} */
const VIEWS = {
  drive: { title: "Drive", load: () => import("./views/drive.js") },
  slope: { title: "Slope", load: () => import("./views/slope.js") },
  mobility: { title: "Mobility", load: () => import("./views/mobility.js") },
  models: { title: "Models and training", load: () => import("./views/models.js") },
};

const main = /** @type {HTMLElement} */ (document.getElementById("main"));
const links = /** @type {NodeListOf<HTMLAnchorElement>} */ (document.querySelectorAll("#views a"));
let name = "";
/** @type {View} */
let view = {};
let turn = 0;

/** @param {import("./state.js").State} state @param {{first?: boolean}} [how] */
async function show(state, { first = false } = {}) {
  if (!(state.view in VIEWS)) {
    stop();
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
  const { title, load } = VIEWS[name];
  document.title = `${title} – Rover Twin`;
  mark();
  const room = h("div.view", { "data-view": name });
  try {
    const module = await load();
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
    console.error(error);
    main.replaceChildren(h("h1", {}, title), h("p.notice.bad", { role: "alert" }, `This view could not be shown: ${error}`));
  }
  if (first || mine !== turn) return;
  main.focus({ preventScroll: true });
  scrollTo(0, 0);
  say(title);
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
install(/** @type {HTMLElement} */ (document.getElementById("token")));
onToken((wanted) => {
  if (wanted) return;
  stop(); // who asks with another token sees other things
  void show(read(), { first: true });
});
listen((state) => void show(state));
void show(read(), { first: true });
