// @ts-check
// A drive, in words: each number and each reason is one of the answer's.

import { datum, h, percent, shown } from "../dom.js";

/** @type {Record<string, string>} */
const OUTCOMES = { passes: "goes on", sticks: "gets stuck", slides: "slides" };
/** @type {Record<string, string>} */
export const EVENTS = { sticks: "Gets stuck", slides: "Slides back", goes_on: "Goes on", passes: "Passes the last knot", arrives: "Arrives" };
const SURE = 0.9; // the level of band and arrival that is asked for: what Mobility calls confident, too

/** @param {string} term @param {any} value */
const fact = (term, value) => h("div", {}, h("dt", {}, term), h("dd", {}, value));

/** The summary as a list of facts. @param {any} answer */
export function facts({ summary, drive, band }) {
  const { arrival_time_s, arrival_earliest_s, arrival_latest_s, motor_energy_j, steepest_slope_deg, steepest_at_m, final_x_m, mean_speed_m_s, duration_s } = summary;
  const last = band ? band.x_lower_m.length - 1 : 0;
  const to = (/** @type {any} */ one, /** @type {any} */ other) => h("span", {}, one, " to ", other);
  const arrival = drive.until_distance_m === null ? [] : [
    fact(`Arrival at ${shown(drive.until_distance_m, 1)} m`, arrival_time_s === null ? h("span", {}, datum("arrival_time_s", null, 1), " not in time") : datum("arrival_time_s", arrival_time_s, 2, "s")),
    ...(arrival_earliest_s === null ? [] : [fact("Earliest and latest", arrival_latest_s === null ? h("span", {}, datum("arrival_earliest_s", arrival_earliest_s, 1, "s"), " to never in time")
      : to(datum("arrival_earliest_s", arrival_earliest_s, 1), datum("arrival_latest_s", arrival_latest_s, 1, "s")))]),
  ];
  return [
    ...arrival,
    fact(`Position after ${shown(duration_s, 1)} s`, datum("final_x_m", final_x_m, 3, "m")),
    ...(band ? [fact(`${Math.round(band.level * 100)} % within`, to(datum("x_lower_m", band.x_lower_m[last], 3), datum("x_upper_m", band.x_upper_m[last], 3, "m")))] : []),
    fact("Mean speed", datum("mean_speed_m_s", mean_speed_m_s, 3, "m/s")),
    fact("Energy of the motors", datum("motor_energy_j", motor_energy_j, 0, "J")),
    fact(`Steepest, at ${shown(steepest_at_m, 1)} m`, datum("steepest_slope_deg", steepest_slope_deg, 1, "°")),
  ];
}

/** Should it drive? From outcome, probabilities, arrival and domain of the answer. @param {any} answer */
export function judged({ summary, domain, drive, events }) {
  const { outcome, probabilities, arrival_time_s, arrival_latest_s } = summary;
  const goal = drive.until_distance_m;
  const late = goal !== null && arrival_time_s === null;
  const trouble = events.find((/** @type {any} */ { event }) => event === "sticks" || event === "slides");
  const first = trouble && outcome === "passes" ? ` On the way it ${OUTCOMES[trouble.event]}${trouble.event === "slides" ? " back" : ""}, first after ${shown(trouble.time_s, 1)} s.` : "";
  let [kind, head] = ["bad", "No."];
  if (!domain.inside) [kind, head] = ["warn", "Do not rely on this."];
  else if (outcome !== "passes") [kind, head] = ["bad", "No."];
  else if (late) [kind, head] = ["warn", "Not in this time."];
  else if (!probabilities) [kind, head] = ["", "It goes on."];
  else if (probabilities.passes < SURE || (goal !== null && arrival_latest_s === null)) [kind, head] = ["warn", "Not sure enough."];
  else if (trouble) [kind, head] = ["warn", "Not without trouble."];
  else [kind, head] = ["good", "Yes, drive."];
  const end = goal === null || outcome !== "passes" ? `The rover ${OUTCOMES[outcome] ?? outcome}${trouble && outcome !== "passes" ? `, first after ${shown(trouble.time_s, 1)} s` : ""}.`
    : late ? `The rover goes on, but it is not at ${shown(goal, 1)} m within ${shown(drive.horizon_s, 0)} s.`
      : `The rover is at ${shown(goal, 1)} m after ${shown(arrival_time_s, 1)} s.`;
  return h(`div.notice.verdict${kind && `.${kind}`}`, { "data-verdict": kind },
    h("p", {}, h("strong", {}, head), ` ${end}${first}`),
    probabilities ? h("p.small", {}, "Chances: ", Object.entries(OUTCOMES).map(([name, words]) => `${words} ${percent(probabilities[name])}`).join(", "), ".")
      : h("p.small", {}, "By the central estimate: this version does not know its errors."));
}

/** Whether the version knows such drives, and where it does not. @param {any} answer */
export function answered({ model, domain }) {
  const which = `${model.name}, version ${model.version}${model.alias ? ` (${model.alias})` : ""}`;
  if (domain.inside) return h("p.notice", {}, h("strong", {}, "Known ground. "), `All of this drive is like the runs of ${which}.`);
  const outside = domain.stretches.filter((/** @type {any} */ each) => !each.inside);
  return h("div.notice.warn", {}, h("p", {}, h("strong", {}, "Outside what was validated. "), `${which} has seen no such runs:`),
    h("ul", {}, ...outside.slice(0, 8).map((/** @type {any} */ { from_m, to_m, from_s, to_s, reasons }) =>
      h("li", {}, `${shown(from_m, 1)} to ${shown(to_m, 1)} m (${shown(from_s, 1)} to ${shown(to_s, 1)} s): `, reasons.map((/** @type {any} */ each) => each.detail).join("; ")))),
    outside.length + domain.left_out > 8 && h("p.small", {}, `and ${outside.length + domain.left_out - 8} more`));
}

/** What happens on the way; each place in time is a button that goes there. @param {any} answer @param {(time_s: number) => void} seek */
export function happened({ events, events_left_out }, seek) {
  if (!events.length) return h("p.muted.small", {}, "No events: it neither gets stuck nor slides, nor does it arrive or pass the last knot.");
  return h("div", {}, h("ol.events", {}, ...events.map((/** @type {any} */ { event, time_s, x_m }) =>
    h("li", { "data-event": event }, h("button", { type: "button", click: () => seek(time_s), "aria-label": `${EVENTS[event] ?? event}, show at ${shown(time_s, 1)} s` }, h("strong", {}, EVENTS[event] ?? event),
      h("span", {}, " ", datum("time_s", time_s, 1, "s"), ", ", datum("x_m", x_m, 2, "m")))))),
  events_left_out > 0 && h("p.small", {}, `and ${events_left_out} more`));
}
