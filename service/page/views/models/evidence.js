// @ts-check
// What a version says of runs that it had not seen. The service sorts them by what the rover did (`card`, `comparison`).

import { h, shown } from "../../dom.js";

/**
 * @typedef {{run: string, slope_deg: number, mass_kg: number, torque_nm: number, horizon_s: number, final_x_m: number, varies?: boolean,
 *   model: Record<string, number>, prior?: Record<string, number>}} LeftOut
 * @typedef {{median_m: number, p90_m: number}} Spread
 */

const SHORTEST_BAR_M = 0.001;
const LONGEST_BAR_M = 100;

/** The runs that a version was tried on without having seen them, and how. @param {any} manifest @returns {{kind: string, runs: LeftOut[]}} */
export function leftOut(manifest) {
  for (const [part, kind] of [["left_out", "each predicted by a model made without it"], ["test", "kept for testing"]]) {
    const runs = manifest.metrics?.[part]?.by_run;
    if (Array.isArray(runs) && runs.length) return { kind, runs: runs.filter((each) => typeof each?.model?.final_m === "number") };
  }
  return { kind: "", runs: [] };
}

/** A bar from 1 mm on, a factor of ten at each fifth: the median in full colour, on to the 90th percentile lighter. @param {Spread} errors @param {string} color */
export function bar({ median_m, p90_m }, color) {
  const whole = Math.log(LONGEST_BAR_M / SHORTEST_BAR_M);
  const share = (/** @type {number} */ error) => Math.min(1, Math.max(0.005, Math.log(Math.max(error, SHORTEST_BAR_M) / SHORTEST_BAR_M) / whole));
  const made = h("span.error-bar", { "aria-hidden": "true" }, h("span.usual"), h("span.rare"));
  made.style.setProperty("--usual", `${(100 * share(median_m)).toFixed(1)}%`);
  made.style.setProperty("--rare", `${(100 * share(p90_m)).toFixed(1)}%`);
  made.style.setProperty("--swatch", `var(${color})`);
  return made;
}

/** Metres: as many decimals as the number needs. @param {number | undefined} value */
export function metres(value) {
  return shown(value, value !== undefined && Math.abs(value) < 0.1 ? 4 : 3);
}
