// @ts-check
// Slope, in words: each number and each reason is one of the answer's.

import { datum, h, percent, shown } from "../dom.js";

const OUTCOMES = { climbs: "climbs", stalls: "stalls", slides: "slides back" };
const CHANCES = { passes: "goes on", sticks: "gets stuck", slides: "slides" };

/** The summary as a list of facts. @param {any} answer */
export function facts({ summary, scenario, band }) {
  const { final_x_m, mean_speed_m_s, slip_ratio, distance_m } = summary;
  const last = band ? band.x_lower_m.length - 1 : 0;
  const entries = [
    [`Uphill after ${shown(scenario.horizon_s, scenario.horizon_s % 1 ? 1 : 0)} s`, datum("final_x_m", final_x_m, 3, "m")],
    ...(band ? [[`${Math.round(band.level * 100)} % within`, h("span", {}, datum("x_lower_m", band.x_lower_m[last], 3), " to ", datum("x_upper_m", band.x_upper_m[last], 3, "m"))]] : []),
    ["Mean speed", datum("mean_speed_m_s", mean_speed_m_s, 3, "m/s")],
    ["Slip ratio", datum("slip_ratio", slip_ratio, 2)],
    ["Way, back and forth", datum("distance_m", distance_m, 2, "m")],
  ];
  return entries.map(([name, value]) => h("div", {}, h("dt", {}, name), h("dd", {}, value)));
}

/** Whether the version knows such scenarios. @param {any} answer */
export function answered({ model, domain }) {
  const which = `${model.name}, version ${model.version}${model.alias ? ` (${model.alias})` : ""}`;
  if (domain.inside) return h("p.notice", {}, h("strong", {}, "Known ground. "), `Scenarios like this one are among the runs of ${which}.`);
  return h("div.notice.warn", {}, h("p", {}, h("strong", {}, "Outside what was validated. "), `${which} has seen no such runs:`),
    h("ul", {}, ...domain.reasons.map((/** @type {any} */ each) => h("li", {}, each.detail))));
}

/** The nearest simulated runs as rows of a table. @param {any[]} runs */
export function nearest(runs) {
  const heads = ["Slope (°)", "Mass (kg)", "Torque (N m)", "Error at the end (m)"];
  return h("table", {}, h("thead", {}, h("tr", {}, ...heads.map((each) => h("th", { scope: "col" }, each)))),
    h("tbody", {}, ...runs.map((run) => h("tr", { title: run.run },
      ...[run.slope_deg, run.mass_kg, run.torque_nm, shown(run.left_out_final_error_m, 3)].map((each) => h("td", {}, each))))));
}

/**
 * Should it drive? From the outcome, the domain and, once they are there, the steepest slope and the probabilities.
 * @param {any} answer
 * @param {any} map  of this torque; null: not there
 * @param {any} drive  over this slope; null: not there
 */
export function judged(answer, map, drive) {
  const { summary, domain, scenario } = answer;
  const steepest = map?.steepest_climb_slope_deg[0] ?? null;
  const sure = map?.confidence ? percent(map.confidence) : "";
  const goes = summary.outcome === "climbs" && scenario.slope_deg <= 0 ? "drives on" : "";
  const outcome = `The rover ${goes || (OUTCOMES[/** @type {keyof typeof OUTCOMES} */ (summary.outcome)] ?? summary.outcome)}.`;
  const limit = steepest === null ? "" : `At this mass and torque it climbs up to ${shown(steepest, 1)}°${sure ? ` with ${sure} confidence` : " by the central estimate"}.`;
  let [kind, head] = ["bad", "No."];
  if (!domain.inside) [kind, head] = ["warn", "Do not rely on this."];
  else if (summary.outcome === "climbs") {
    if (!map) [kind, head] = ["", goes ? "It drives on." : "It gets up."];
    else if (steepest !== null && scenario.slope_deg <= steepest) [kind, head] = ["good", "Yes, drive."];
    else [kind, head] = ["warn", "Not sure enough."];
  }
  const chances = drive?.summary.probabilities;
  return h(`div.notice.verdict${kind && `.${kind}`}`, { "data-verdict": kind },
    h("p", {}, h("strong", {}, head), ` ${outcome} ${limit}`),
    chances && h("p.small", {}, "Chances: ", Object.entries(CHANCES).map(([name, words]) => `${words} ${percent(chances[name])}`).join(", "), "."));
}
