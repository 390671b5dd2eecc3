// @ts-check
// The surface of a track, for drawing only: where on it a distance is. The same surface as the service's, which answers
// with `frame=world` where the rover is; the tests compare the two.

const RADIANS = Math.PI / 180;
const ALONE_M = 5; // of a track with one slope, as elevations

/**
 * A track as it is edited: `slopes` has slopes (deg) over distances along the surface (m), `elevations` has elevations
 * over horizontal places (m).
 * @typedef {{kind: "slopes" | "elevations", x: number[], y: number[]}} Track
 */

/**
 * The first index whose value is greater.
 * @param {number[]} values  rising @param {number} value
 */
export function after(values, value) {
  let [low, high] = [0, values.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (values[middle] <= value) low = middle + 1;
    else high = middle;
  }
  return low;
}

/**
 * Linear between the places, constant beyond them.
 * @param {number[]} places @param {ArrayLike<number>} values @param {number} at
 */
export function between(places, values, at) {
  const next = after(places, at);
  if (next === 0) return values[0];
  if (next === places.length) return values[next - 1];
  const share = (at - places[next - 1]) / (places[next] - places[next - 1]);
  return values[next - 1] + share * (values[next] - values[next - 1]);
}

/** Slope over distance, linear between knots, constant beyond them. */
export class Ground {
  /** @param {number[]} knots_m @param {number[]} slope_rad @param {number} end_m  where the track was known to; infinite for one slope */
  constructor(knots_m, slope_rad, end_m) {
    this.knots = knots_m;
    this.slopes = slope_rad;
    this.end = end_m;
    /** @type {[number, number][]} from the first knot to each */
    this.places = [[0, 0]];
    for (let knot = 1; knot < knots_m.length; knot++) {
      const [across, up] = chord(knots_m[knot] - knots_m[knot - 1], slope_rad[knot - 1], slope_rad[knot]);
      this.places.push([this.places[knot - 1][0] + across, this.places[knot - 1][1] + up]);
    }
    this.origin = this.#surface(0);
  }

  /** Slope at a distance, rad. @param {number} distance_m */
  slope(distance_m) {
    return between(this.knots, this.slopes, distance_m);
  }

  /**
   * Horizontal and up, m, of what is so high above the surface at a distance; both 0 where the rear wheel starts.
   * @param {number} distance_m @param {number} [height_m]
   * @returns {[number, number]}
   */
  at(distance_m, height_m = 0) {
    const [across, up] = this.#surface(distance_m);
    const slope = this.slope(distance_m);
    return [across - this.origin[0] - height_m * Math.sin(slope), up - this.origin[1] + height_m * Math.cos(slope)];
  }

  /** Whether the slope is the same everywhere, and which, deg; else null. */
  constant() {
    const [first] = this.slopes;
    return this.slopes.every((each) => Math.abs(each - first) < 1e-9) ? first / RADIANS : null;
  }

  /** @param {number} distance_m @returns {[number, number]} */
  #surface(distance_m) {
    const knot = Math.max(0, after(this.knots, distance_m) - 1);
    const part = chord(distance_m - this.knots[knot], this.slopes[knot], this.slope(distance_m));
    return [this.places[knot][0] + part[0], this.places[knot][1] + part[1]];
  }
}

/** Horizontal and up between the ends of a piece whose slope changes linearly. @param {number} length @param {number} from @param {number} to */
function chord(length, from, to) {
  const half = (to - from) / 2;
  const straight = Math.abs(half) < 1e-9 ? length : (length * Math.sin(half)) / half;
  return [straight * Math.cos((from + to) / 2), straight * Math.sin((from + to) / 2)];
}

/** The ground of a track; undefined for what is none: then the service says why. @param {Track} track */
export function groundOf({ kind, x, y }) {
  const rises = x.every((each, knot) => Number.isFinite(each) && Number.isFinite(y[knot]) && (knot === 0 || each > x[knot - 1]));
  if (!rises || x.length < (kind === "slopes" ? 1 : 2)) return undefined;
  if (kind === "slopes") return new Ground(x, y.map((each) => each * RADIANS), x.length > 1 ? x[x.length - 1] : Infinity);
  const slopes = x.slice(1).map((each, piece) => Math.atan2(y[piece + 1] - y[piece], each - x[piece]));
  const lengths = x.slice(1).map((each, piece) => Math.hypot(each - x[piece], y[piece + 1] - y[piece]));
  const knots = [0];
  for (const each of lengths) knots.push(knots[knots.length - 1] + each);
  const piece = Math.min(lengths.length - 1, Math.max(0, after(x, 0) - 1));
  const start = knots[piece] - (x[piece] * lengths[piece]) / (x[piece + 1] - x[piece]);
  return new Ground(lengths.map((_, each) => (knots[each] + knots[each + 1]) / 2 - start), slopes, knots[knots.length - 1] - start);
}

/**
 * The track in the other way of writing it. Elevations become exactly the slopes that the service makes of them; slopes become
 * the elevations of the same places, and between those the slope is then a mean.
 * @param {Track} track
 * @returns {Track}
 */
export function converted(track) {
  const ground = groundOf(track);
  if (!ground) return track;
  const rounded = (/** @type {number} */ value, digits = 4) => Number(value.toFixed(digits));
  if (track.kind === "elevations") return { kind: "slopes", x: ground.knots.map((each) => rounded(each)), y: ground.slopes.map((each) => rounded(each / RADIANS)) };
  const knots = ground.knots.length > 1 ? [...ground.knots] : [0, ALONE_M];
  if (knots[0] > 0) knots.unshift(0);
  const places = knots.map((each) => ground.at(each));
  return { kind: "elevations", x: places.map(([across]) => rounded(across)), y: places.map(([, up]) => rounded(up)) };
}

/**
 * Fewer places of a long profile (Douglas and Peucker): those that matter most.
 * @param {Track} track @param {number} most  places kept
 * @returns {{track: Track, deviation: number}}  how far the old places are from the new line at most, vertically
 */
export function thinned({ kind, x, y }, most) {
  const kept = new Set([0, x.length - 1]);
  const furthest = (/** @type {number} */ from, /** @type {number} */ to) => {
    let [at, far] = [-1, 0];
    for (let knot = from + 1; knot < to; knot++) {
      const off = Math.abs(y[from] + ((x[knot] - x[from]) / (x[to] - x[from])) * (y[to] - y[from]) - y[knot]);
      if (off > far) [at, far] = [knot, off];
    }
    return { from, to, at, far };
  };
  const pieces = [furthest(0, x.length - 1)];
  while (kept.size < most) {
    pieces.sort((one, other) => one.far - other.far);
    const worst = pieces.pop();
    if (!worst || worst.at < 0) {
      if (worst) pieces.push(worst);
      break;
    }
    kept.add(worst.at);
    pieces.push(furthest(worst.from, worst.at), furthest(worst.at, worst.to));
  }
  const rows = [...kept].sort((one, other) => one - other);
  return { track: { kind, x: rows.map((row) => x[row]), y: rows.map((row) => y[row]) }, deviation: Math.max(...pieces.map(({ far }) => far)) };
}
