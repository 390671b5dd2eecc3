// @ts-check
// A small plot as SVG: axes that fit, and places on it.

const SVG = "http://www.w3.org/2000/svg";
const MARGIN = { left: 46, right: 14, top: 12, bottom: 30 };

/**
 * An element of SVG; as `h` of dom.js makes those of HTML.
 * @param {string} tag @param {Record<string, any>} [attributes] @param {...any} children
 * @returns {any}
 */
export function svg(tag, attributes = {}, ...children) {
  const element = document.createElementNS(SVG, tag);
  for (const [key, value] of Object.entries(attributes)) {
    if (typeof value === "function") element.addEventListener(key, value);
    else if (value !== null && value !== undefined && value !== false) element.setAttribute(key, String(value));
  }
  element.append(...children.filter((each) => each !== null && each !== undefined && each !== false));
  return element;
}

/** Steps of an axis, 1, 2 or 5 times a power of ten, about so many. @param {number} low @param {number} high @param {number} about */
export function ticks(low, high, about) {
  const rough = (high - low) / Math.max(1, about);
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((each) => each * power).find((each) => each >= rough * 0.999) ?? power;
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const found = [];
  for (let at = Math.ceil(low / step - 1e-9); at * step <= high + step * 1e-9; at++) found.push((at * step).toFixed(digits));
  return found;
}

/** Where values are drawn. */
export class Scale {
  /** @param {number} width @param {number} height @param {[number, number]} x @param {[number, number]} y  ranges of values */
  constructor(width, height, x, y) {
    Object.assign(this, { width, height });
    this.box = { left: MARGIN.left, right: width - MARGIN.right, top: MARGIN.top, bottom: height - MARGIN.bottom };
    this.x = x;
    this.y = y;
  }

  /** @param {number} value */
  across(value) {
    const { left, right } = this.box;
    return left + ((value - this.x[0]) / (this.x[1] - this.x[0])) * (right - left);
  }

  /** @param {number} value */
  up(value) {
    const { top, bottom } = this.box;
    return bottom - ((value - this.y[0]) / (this.y[1] - this.y[0])) * (bottom - top);
  }

  /** The values at a place of the picture. @param {number} left @param {number} top @returns {[number, number]} */
  back(left, top) {
    const { box } = this;
    return [
      this.x[0] + ((left - box.left) / (box.right - box.left)) * (this.x[1] - this.x[0]),
      this.y[0] + ((box.bottom - top) / (box.bottom - box.top)) * (this.y[1] - this.y[0]),
    ];
  }

  /** Points of a line. @param {number[]} x @param {number[]} y */
  line(x, y) {
    return x.map((each, row) => `${this.across(each).toFixed(1)},${this.up(y[row]).toFixed(1)}`).join(" ");
  }

  /** Grid and numbers. @param {string} across @param {string} up  what the axes are */
  axes(across, up) {
    const { left, right, top, bottom } = this.box;
    const text = { fill: "var(--muted)", "font-size": 11.5 };
    const rule = { stroke: "var(--grid)", "stroke-width": 1 };
    return svg("g", { "aria-hidden": "true" },
      ...ticks(...this.x, (right - left) / 70).flatMap((each) => {
        const at = this.across(Number(each));
        return [svg("line", { ...rule, x1: at, x2: at, y1: top, y2: bottom }), svg("text", { ...text, x: at, y: bottom + 14, "text-anchor": "middle" }, minus(each))];
      }),
      ...ticks(...this.y, (bottom - top) / 34).flatMap((each) => {
        const at = this.up(Number(each));
        return [svg("line", { ...rule, x1: left, x2: right, y1: at, y2: at }), svg("text", { ...text, x: left - 6, y: at + 4, "text-anchor": "end" }, minus(each))];
      }),
      svg("text", { ...text, x: right, y: bottom + 27, "text-anchor": "end" }, across),
      svg("text", { ...text, x: left, y: top - 2, "text-anchor": "start" }, up));
  }
}

/** @param {string} number */
function minus(number) {
  return number.replace("-", "−");
}
