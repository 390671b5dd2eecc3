// @ts-check
// What a manifest says of runs that the version had not seen: errors by what the rover did.

import { h, shown } from "../../dom.js";

/**
 * @typedef {{run: string, slope_deg: number, mass_kg: number, torque_nm: number, horizon_s: number, final_x_m: number, varies?: boolean,
 *   model: Record<string, number>, prior?: Record<string, number>}} LeftOut
 * @typedef {{median: number, p90: number}} Spread
 */

const LONG_S = 10;
const SLOW_M_S = 0.1;
const SLIDES_M_S = -0.015;
const SHORTEST_BAR_M = 0.001;
const LONGEST_BAR_M = 100;

/** In this order; a run is in the first that fits. @type {[string, (run: LeftOut, speed: number) => boolean][]} */
const REGIMES = [
  ["drives (slope, torque or brake change)", (run) => Boolean(run.varies)],
  ["longer than 10 s", (run) => run.horizon_s > LONG_S],
  ["downhill or motors off", (run) => run.slope_deg < 0 || run.torque_nm === 0],
  ["slides back", (_, speed) => speed < SLIDES_M_S],
  ["stalls or crawls, under 0.1 m/s", (_, speed) => speed < SLOW_M_S],
  ["climbs", () => true],
];

/** The runs that a version was tried on without having seen them, and how. @param {any} manifest @returns {{kind: string, runs: LeftOut[]}} */
export function leftOut(manifest) {
  for (const [part, kind] of [["left_out", "each predicted by a model made without it"], ["test", "kept for testing"]]) {
    const runs = manifest.metrics?.[part]?.by_run;
    if (Array.isArray(runs) && runs.length) return { kind, runs: runs.filter((each) => typeof each?.model?.final_m === "number") };
  }
  return { kind: "", runs: [] };
}

/** @param {LeftOut[]} runs @returns {Map<string, LeftOut[]>} */
export function byRegime(runs) {
  const found = new Map(REGIMES.map(([name]) => [name, /** @type {LeftOut[]} */ ([])]));
  for (const run of runs) {
    const regime = REGIMES.find(([, fits]) => fits(run, run.final_x_m / run.horizon_s));
    if (regime) found.get(regime[0])?.push(run);
  }
  return new Map([...found].filter(([, members]) => members.length));
}

/** Median and 90th percentile, as numpy takes them. @param {number[]} values @returns {Spread} */
export function spread(values) {
  const sorted = values.toSorted((one, other) => one - other);
  const at = (/** @type {number} */ share) => {
    const place = share * (sorted.length - 1);
    const low = Math.floor(place);
    return sorted[low] + (place - low) * ((sorted[low + 1] ?? sorted[low]) - sorted[low]);
  };
  return { median: at(0.5), p90: at(0.9) };
}

/** Which run it is, in whatever dataset. @param {LeftOut} run */
export function identity(run) {
  return [run.run, run.slope_deg, run.mass_kg, run.torque_nm, run.horizon_s, run.final_x_m].join(" ");
}

/** A bar from 1 mm on, a factor of ten at each fifth: the median in full colour, on to the 90th percentile lighter. @param {Spread} errors @param {string} color */
export function bar({ median, p90 }, color) {
  const whole = Math.log(LONGEST_BAR_M / SHORTEST_BAR_M);
  const share = (/** @type {number} */ error) => Math.min(1, Math.max(0.005, Math.log(Math.max(error, SHORTEST_BAR_M) / SHORTEST_BAR_M) / whole));
  const made = h("span.error-bar", { "aria-hidden": "true" }, h("span.usual"), h("span.rare"));
  made.style.setProperty("--usual", `${(100 * share(median)).toFixed(1)}%`);
  made.style.setProperty("--rare", `${(100 * share(p90)).toFixed(1)}%`);
  made.style.setProperty("--swatch", `var(${color})`);
  return made;
}

/** Metres: as many decimals as the number needs. @param {number | undefined} value */
export function metres(value) {
  return shown(value, value !== undefined && Math.abs(value) < 0.1 ? 4 : 3);
}
