// @ts-check
// The address holds the question: `#slope?slope_deg=28&mass_kg=430`. So it can be shared, and "back" works.

/** @typedef {{view: string, query: URLSearchParams}} State */

const FIRST_VIEW = "drive";

/** @type {Map<string, string>} the last question of each view */
const last = new Map();

/**
 * What an address asks for.
 * @param {string} hash  the part of the address from `#` on
 * @returns {State}
 */
export function parse(hash) {
  const text = hash.replace(/^#/, "");
  const cut = text.indexOf("?");
  const view = cut < 0 ? text : text.slice(0, cut);
  return { view: view || FIRST_VIEW, query: new URLSearchParams(cut < 0 ? "" : text.slice(cut + 1)) };
}

/** The state that the address holds now. @returns {State} */
export function read() {
  return parse(location.hash);
}

/**
 * The address of a question, relative to the page; for links.
 * @param {string} view
 * @param {URLSearchParams | Record<string, string | number>} [query]
 */
export function addressOf(view, query = {}) {
  const text = new URLSearchParams(/** @type {any} */ (query)).toString().replaceAll("%3A", ":").replaceAll("%2C", ","); // a track stays readable
  return `#${view}${text && `?${text}`}`;
}

/** The address of a view with the question that it was left with. @param {string} view */
export function lastOf(view) {
  return last.get(view) ?? addressOf(view);
}

/**
 * Put a question into the address. Tells no listener: whoever writes knows it.
 * @param {string} view
 * @param {URLSearchParams | Record<string, string | number>} query
 * @param {{replace?: boolean}} [how]  replace: no new entry for "back", as while a slider moves
 */
export function write(view, query, { replace = false } = {}) {
  const address = addressOf(view, query);
  last.set(view, address);
  if (address === location.hash) return;
  history[replace ? "replaceState" : "pushState"](null, "", address);
}

/** Go to a question as a link would. @param {string} view @param {URLSearchParams | Record<string, string | number>} query */
export function go(view, query) {
  location.hash = addressOf(view, query);
}

/** Hear of each change of the address that was not written here. @param {(state: State) => void} heard */
export function listen(heard) {
  const noted = () => {
    const state = read();
    last.set(state.view, addressOf(state.view, state.query));
    return state;
  };
  noted();
  addEventListener("hashchange", () => heard(noted())); // a link, an edited address, "back" and "forward"
}
