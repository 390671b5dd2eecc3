// @ts-check
// In place of an answer that did not come: why, and another try, by hand or, where nothing answers at all, by itself.

import { address } from "./api.js";
import { h } from "./dom.js";

const WAITS_S = [2, 4, 8, 15, 30]; // from one try to the next, ever longer
const MOST_TRIES = 120; // about an hour; the button goes on working
const SOON_MS = 60_000;

let resumed = -Infinity; // when the service was last found again
let early = 0; // how often it was lost again soon after that

/**
 * Says that the service cannot be reached. Looks for it as long as this is shown.
 * @param {() => void} again  called when it is there
 * @returns {HTMLElement}
 */
export function unreachable(again) {
  early = performance.now() - resumed < SOON_MS ? early + 1 : 0;
  let tries = early;
  let timer = 0;
  let busy = false;
  const said = h("span.small.muted");
  const look = async () => {
    if (busy) return;
    clearTimeout(timer);
    busy = true;
    said.textContent = "It looks for the service …";
    const there = await answers();
    busy = false;
    if (!element.isConnected) return;
    if (there) {
      resumed = performance.now();
      again();
    }
    tries += 1;
    rest();
  };
  const rest = () => {
    const wait_s = WAITS_S[Math.min(tries, WAITS_S.length - 1)];
    said.textContent = tries < MOST_TRIES ? `The page tries again by itself, after ${wait_s} s.` : "";
    if (tries < MOST_TRIES) timer = setTimeout(() => { if (element.isConnected) void look(); }, wait_s * 1000);
  };
  const element = h("div.notice.bad.verdict", { "data-verdict": "none", "data-unreachable": "" },
    h("p", { role: "alert" }, h("strong", {}, "The service cannot be reached. "), "Does it run, and is this machine connected to it?"),
    h("p.row", {}, h("button", { type: "button", click: () => void look() }, "Try again"), said));
  rest();
  return element;
}

/** Whether the service answers, with whatever. */
async function answers() {
  try {
    await fetch(address("health/live"), { cache: "no-store", credentials: "omit", signal: AbortSignal.timeout(5000) });
    return true;
  } catch {
    return false;
  }
}

/**
 * In place of an answer: what the service says, with all reasons.
 * @param {import("./api.js").Problem} problem @param {() => void} again
 * @returns {HTMLElement}
 */
export function noAnswer(problem, again) {
  if (problem.unreachable) return unreachable(again);
  const reasons = problem.fields.map(({ message }) => message).filter((each) => !problem.message.includes(each));
  const passing = problem.status === 0 || problem.status === 429 || problem.status >= 500;
  return h("div.notice.bad.verdict", { "data-verdict": "none" }, h("p", {}, h("strong", {}, `${problem.title}. `), problem.message,
    problem.wait_s ? ` Try again in ${problem.wait_s} s.` : ""),
  reasons.length > 0 && h("ul", {}, ...reasons.slice(0, 20).map((each) => h("li", {}, each))),
  passing && h("p.row", {}, h("button", { type: "button", click: again }, "Try again")));
}
