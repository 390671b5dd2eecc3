// @ts-check
// The question of a drive: in the address, as the service takes it, and examples to begin with.
//
// In the address a track is `slopes=0:10,2:20` (distance:slope) or `elevations=0:0,4:1.1` (horizontal:elevation), and
// controls are `torques=0:100,6:brake,8:110` (time:torque), as in clients/curl/drive.sh.

import { checked, numberOf, short } from "../query.js";
import { groundOf } from "./drive_ground.js";

/** @typedef {import("./drive_ground.js").Track} Track */
/** @typedef {{time_s: number[], torque_nm: number[], brake: boolean[]}} Controls */
/** @typedef {{mass_kg: number, horizon_s: number, until_distance_m: number | null, start_speed_m_s: number | null, model: string, track: Track, controls: Controls}} Question */

/** @type {Record<string, {words: string, track: Track, torques: string, until?: number, horizon?: number}>} */
export const EXAMPLES = {
  rim: { words: "Over a crater rim", torques: "0:100,18:60", until: 13, horizon: 30,
    track: { kind: "elevations", x: [0, 2, 4, 6, 8, 9.5, 11, 13, 15], y: [0, 0.12, 0.65, 1.5, 2.35, 2.85, 3, 2.75, 2.2] } },
  steps: { words: "Steps of slope", torques: "0:110", until: 11, horizon: 30,
    track: { kind: "slopes", x: [0, 3, 3.4, 6.5, 6.9, 10, 10.4, 14], y: [8, 8, 16, 16, 24, 24, 12, 12] } },
  stop: { words: "Brake on the slope, then go on", torques: "0:100,6:brake,9:110", until: 8, horizon: 30,
    track: { kind: "slopes", x: [0, 2, 2.3], y: [10, 10, 20] } },
  coast: { words: "Motors off on the way up", torques: "0:100,8:0,10:100", until: 8, horizon: 30,
    track: { kind: "slopes", x: [0, 4, 8], y: [18, 22, 20] } },
  steep: { words: "Too steep in the end", torques: "0:32", until: 6, horizon: 30,
    track: { kind: "slopes", x: [0, 2, 4, 6], y: [10, 20, 30, 31] } },
  one: { words: "One slope (with the prior)", torques: "0:60", horizon: 20, track: { kind: "slopes", x: [0], y: [25] } },
};
const ASKED = { numbers: ["mass_kg", "horizon_s", "until_distance_m", "start_speed_m_s"], words: ["slopes", "elevations", "torques", "model"] };
const FIRST = "rim";
const LONGEST = 6000; // characters of a track in the address
const FROM_FILE = "file"; // in place of a track that is longer

/** @param {string | null} text @returns {[string, string][] | undefined} */
function pairs(text) {
  if (!text) return undefined;
  const found = text.split(",").map((each) => each.split(":"));
  return found.every((each) => each.length === 2 && each[0].trim() !== "" && each[1].trim() !== "") ? /** @type {any} */ (found) : undefined;
}

/** @param {string | null} text @returns {Controls | undefined} */
function controlsFrom(text) {
  const found = pairs(text);
  if (!found) return undefined;
  const controls = {
    time_s: found.map(([time]) => Number(time)),
    torque_nm: found.map(([, told]) => (told === "brake" ? 0 : Number(told))),
    brake: found.map(([, told]) => told === "brake"),
  };
  return [...controls.time_s, ...controls.torque_nm].every(Number.isFinite) ? controls : undefined;
}

/** @param {URLSearchParams} query @returns {Track | undefined} */
function trackFrom(query) {
  for (const kind of /** @type {const} */ (["elevations", "slopes"])) {
    const found = pairs(query.get(kind));
    if (!found) continue;
    const [x, y] = [0, 1].map((column) => found.map((each) => Number(each[column])));
    if ([...x, ...y].every(Number.isFinite)) return { kind, x, y };
  }
  return undefined;
}

/**
 * What an address asks, with the first example where it asks nothing.
 * @param {URLSearchParams} query
 * @param {Question | undefined} now  whose track is taken where the address could not hold it
 * @returns {{question: Question, complaint: string}}
 */
export function questionFrom(query, now) {
  const { faults, unknown } = checked(query, ASKED);
  const wrong = faults.map(({ message }) => message);
  if (query.has("slopes") && query.has("elevations")) wrong.push("there are slopes and elevations, where a track has one of them");
  if (wrong.length) {
    const none = questionFrom(new URLSearchParams(), undefined).question;
    return { complaint: `This address cannot be read: ${wrong.join("; ")}. Here is an example.`, question: { ...none, model: query.get("model") ?? "" } };
  }
  const number = (/** @type {string} */ name) => numberOf(query.get(name)) ?? null;
  const given = query.get("slopes") ?? query.get("elevations");
  const example = EXAMPLES[FIRST];
  let complaint = "";
  let track = trackFrom(query);
  if (given === FROM_FILE) {
    track = now && !shareable(now) ? now.track : undefined;
    if (!track) complaint = "The track of this address was in a file that the address could not hold. Load it again; here is an example.";
  } else if (given !== null && !track) complaint = "The track of this address cannot be read; here is an example.";
  const told = query.get("torques");
  const controls = controlsFrom(told);
  if (told !== null && !controls && !complaint) complaint = "The controls of this address cannot be read; here is an example.";
  if (unknown.length && !complaint) complaint = `This view does not know ${unknown.slice(0, 12).map((each) => `“${short(each)}”`).join(", ")} of this address, and leaves it out.`;
  const fresh = given === null || !track;
  return { complaint, question: {
    mass_kg: number("mass_kg") ?? 430,
    horizon_s: number("horizon_s") ?? (fresh ? example.horizon ?? 20 : 20),
    until_distance_m: number("until_distance_m") ?? (fresh ? example.until ?? null : null),
    start_speed_m_s: number("start_speed_m_s"),
    model: query.get("model") ?? "",
    track: track ?? copied(example.track),
    controls: controls ?? /** @type {Controls} */ (controlsFrom(fresh ? example.torques : "0:60")),
  } };
}

/** An example in place of track, controls and ends of a question. @param {Question} question @param {string} name @returns {Question} */
export function exampleOf(question, name) {
  const { track, torques, until = null, horizon = 20 } = EXAMPLES[name];
  return { ...question, track: copied(track), controls: /** @type {Controls} */ (controlsFrom(torques)),
    until_distance_m: until, horizon_s: horizon, start_speed_m_s: null };
}

/** @param {Track} track @returns {Track} */
function copied({ kind, x, y }) {
  return { kind, x: [...x], y: [...y] };
}

/** The question for the address. @param {Question} question @returns {Record<string, string | number>} */
export function addressed({ mass_kg, horizon_s, until_distance_m, start_speed_m_s, model, track, controls }) {
  const { time_s, torque_nm, brake } = controls;
  const places = track.x.map((x, knot) => `${x}:${track.y[knot]}`).join(",");
  return {
    mass_kg,
    [track.kind]: places.length > LONGEST ? FROM_FILE : places,
    torques: time_s.map((time, row) => `${time}:${brake[row] ? "brake" : torque_nm[row]}`).join(","),
    ...(until_distance_m === null ? {} : { until_distance_m }),
    horizon_s,
    ...(start_speed_m_s === null ? {} : { start_speed_m_s }),
    ...(model ? { model } : {}),
  };
}

/** Whether the address holds all of the question. @param {Question} question */
export function shareable(question) {
  return addressed(question)[question.track.kind] !== FROM_FILE;
}

/** The question as `POST /v1/drives` takes it, without how finely to answer. @param {Question} question */
export function asked({ mass_kg, horizon_s, until_distance_m, start_speed_m_s, model, track, controls }) {
  const names = track.kind === "slopes" ? ["distance_m", "slope_deg"] : ["horizontal_m", "elevation_m"];
  const { time_s, torque_nm, brake } = controls;
  const alone = time_s.length === 1 && time_s[0] === 0 && !brake[0];
  return {
    mass_kg,
    track: { [names[0]]: track.x, [names[1]]: track.y },
    controls: alone ? torque_nm[0] : { time_s, torque_nm, ...(brake.includes(true) ? { brake } : {}) },
    horizon_s,
    ...(until_distance_m === null ? {} : { until_distance_m }),
    ...(start_speed_m_s === null ? {} : { start_speed_m_s }),
    ...(model ? { model } : {}),
  };
}

/**
 * The scenario of a prediction that asks the same: one slope and one torque, from rest. Only those have a prior.
 * @param {Question} question
 */
export function scenarioOf({ mass_kg, start_speed_m_s, model, track, controls }) {
  const slope = groundOf(track)?.constant() ?? null;
  if (slope === null || controls.time_s.length > 1 || controls.brake[0] || start_speed_m_s !== null) return undefined;
  return { slope_deg: Number(slope.toPrecision(12)), mass_kg, torque_nm: controls.torque_nm[0], ...(model ? { model } : {}) };
}
