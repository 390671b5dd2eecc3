// @ts-check
// Curves over time: lines and a band, drawn by uPlot (page/vendor). Read with the pointer, with the arrow keys, or as a table.

import { fill, h, shown } from "./dom.js";

/**
 * Columns of equal length. A line whose column is not there is not drawn.
 * @typedef {Record<string, (number | null)[] | undefined>} Columns
 * @typedef {{key: string, label: string, color: string, dash?: number[], width?: number}} Line  color: a custom property
 * @typedef {{lower: string, upper: string, label: string, color: string}} Band
 * @typedef {{label: string, unit: string, key: string, decimals?: number}} Axis
 */

const HEIGHT = 250;
const ROWS = 11; // of the table
const uPlot = () => /** @type {any} */ (globalThis).uPlot;

/** @param {string} name  of a custom property, `--line` */
export function color(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim() || "#888";
}

export class Chart {
  /**
   * @param {HTMLElement} host
   * @param {{title: string, x: Axis, y: Axis, lines: Line[], band?: Band, sync?: string, height?: number}} what
   */
  constructor(host, what) {
    this.what = what;
    /** @type {any} */
    this.plot = undefined;
    /** @type {Columns} */
    this.columns = {};
    this.shape = "";
    this.at = 0;
    /** @type {Set<string>} */
    this.hidden = new Set();
    this.legend = h("ul.legend", { "aria-label": "Shown in this chart" });
    this.area = h("div.chart", { tabindex: "0", role: "slider", "aria-label": `${what.title}, read along ${what.x.label}`,
      "aria-valuemin": "0", "aria-valuemax": "0", "aria-valuenow": "0" });
    this.reading = h("p.reading", { "aria-hidden": "true" }, "Point at the curve, or use the arrow keys, to read values.");
    this.table = h("div.scroll", { tabindex: "0", role: "region", "aria-label": `${what.title}, table` });
    this.details = h("details", { toggle: () => this.#fillTable() }, h("summary", {}, "Values as a table"), this.table);
    this.element = h("figure.plot", {}, h("figcaption", {}, h("h2", {}, what.title), this.legend), this.area, this.reading, this.details);
    host.append(this.element);
    this.standing = h("span.stand", { hidden: true });
    this.marks = h("div.marks", { "aria-hidden": "true" }, this.standing);
    this.area.style.minHeight = `${what.height ?? HEIGHT}px`;
    this.area.addEventListener("keydown", (/** @type {KeyboardEvent} */ event) => this.#key(event));
    this.sizes = new ResizeObserver(() => this.#size());
    this.sizes.observe(this.area);
    this.scheme = matchMedia("(prefers-color-scheme: dark)");
    this.recolor = () => this.#build();
    this.scheme.addEventListener("change", this.recolor);
  }

  /**
   * Show these columns; `columns[x.key]` rises.
   * @param {Columns} columns
   * @param {{at: number, key: string}[]} [marks]  places along x; `key` goes to `data-key`, for its colour
   */
  show(columns, marks = []) {
    this.columns = columns;
    fill(this.marks, ...marks.map(({ at, key }) => {
      const mark = h("span", { "data-key": key });
      mark.style.left = `${(100 * this.#share(at)).toFixed(3)}%`;
      return mark;
    }), this.standing);
    const shape = this.#lines().map((each) => each.key).join() + this.#hasBand();
    if (!this.plot || shape !== this.shape) {
      this.shape = shape;
      this.#build();
    } else this.plot.setData(this.#data());
    const last = this.#times().length - 1;
    this.area.setAttribute("aria-valuemax", String(Math.max(0, last)));
    this.at = Math.min(this.at || last, last);
    this.#speak();
    if (this.details.open) this.#fillTable();
  }

  /** Mark a place along x that moves; null: none. Cheap, for each picture of an animation. @param {number | null} at */
  stand(at) {
    this.standing.hidden = at === null;
    if (at !== null) this.standing.style.transform = `translateX(${(100 * this.#share(at)).toFixed(3)}%)`;
  }

  /** @param {number} at */
  #share(at) {
    const times = this.#times();
    return (at - times[0]) / Math.max(1e-9, times[times.length - 1] - times[0]);
  }

  /** Take it away. */
  destroy() {
    this.sizes.disconnect();
    this.scheme.removeEventListener("change", this.recolor);
    this.plot?.destroy();
    this.element.remove();
  }

  #times() {
    return this.columns[this.what.x.key] ?? [];
  }

  #lines() {
    return this.what.lines.filter((each) => this.columns[each.key] && !this.hidden.has(each.label));
  }

  #hasBand() {
    const { band } = this.what;
    return Boolean(band && !this.hidden.has(band.lower) && this.columns[band.lower] && this.columns[band.upper]);
  }

  #data() {
    const { band } = this.what;
    const edges = band && this.#hasBand() ? [this.columns[band.upper], this.columns[band.lower]] : [];
    return [this.#times(), ...edges, ...this.#lines().map((each) => this.columns[each.key])];
  }

  #build() {
    this.plot?.destroy();
    this.plot = undefined;
    if (!this.#times().length || !uPlot()) return;
    const { x, y, band, sync, height = HEIGHT } = this.what;
    const edges = this.#hasBand() ? [{ label: "upper", points: { show: false } }, { label: "lower", points: { show: false } }] : [];
    const lines = this.#lines().map((each) => ({ label: each.label, stroke: color(each.color), width: each.width ?? 2,
      dash: each.dash, points: { show: false } }));
    const axis = { stroke: color("--muted"), grid: { stroke: color("--grid"), width: 1 }, ticks: { stroke: color("--grid"), width: 1 },
      font: `12px ${color("--font")}`, labelFont: `12px ${color("--font")}`, labelSize: 18 };
    this.plot = new (uPlot())({
      width: Math.max(200, this.area.clientWidth), height, legend: { show: false },
      scales: { x: { time: false } },
      series: [{}, ...edges, ...lines],
      bands: edges.length && band ? [{ series: [1, 2], fill: color(band.color) }] : [],
      axes: [{ ...axis, label: titled(x), size: 32 }, { ...axis, label: titled(y), size: 52, space: 32 }],
      cursor: { drag: { x: false, y: false }, sync: sync ? { key: sync } : undefined, points: { size: 7 } },
      hooks: { setCursor: [(/** @type {any} */ plot) => this.#pointed(plot.cursor.idx)] },
    }, this.#data(), this.area);
    this.plot.root.setAttribute("aria-hidden", "true");
    this.plot.over.append(this.marks);
    this.#fillLegend();
  }

  #size() {
    const width = this.area.clientWidth;
    if (this.plot && width > 0 && width !== this.plot.width) this.plot.setSize({ width, height: this.plot.height });
  }

  #fillLegend() {
    const { band, lines } = this.what;
    const there = lines.filter((each) => this.columns[each.key]);
    const entries = there.map((each) => this.#entry(each.label, each.label, swatch(each.color, each.dash ? "dashed" : "solid"), there.length > 1));
    if (band && this.columns[band.lower]) entries.push(this.#entry(band.lower, band.label, swatch(band.color, "area"), true));
    fill(this.legend, ...entries);
  }

  /** Shows and hides what it names. @param {string} key @param {string} label @param {Element} mark @param {boolean} optional */
  #entry(key, label, mark, optional) {
    if (!optional) return h("li", {}, mark, label);
    const toggle = () => {
      if (!this.hidden.delete(key)) this.hidden.add(key);
      this.show(this.columns);
      /** @type {HTMLElement | null} */ (this.legend.querySelector(`[data-key="${key}"]`))?.focus();
    };
    const pressed = String(!this.hidden.has(key));
    return h("li", {}, h("button.entry-button", { type: "button", "aria-pressed": pressed, "data-key": key, click: toggle }, mark, label));
  }

  /** @param {number | null | undefined} index */
  #pointed(index) {
    if (index === null || index === undefined) return;
    this.at = index;
    this.reading.textContent = this.words(index);
    this.area.setAttribute("aria-valuenow", String(index));
  }

  #speak() {
    this.area.setAttribute("aria-valuenow", String(this.at));
    this.area.setAttribute("aria-valuetext", this.words(this.at));
    if (this.plot?.cursor.idx != null) this.reading.textContent = this.words(this.at);
  }

  /** What the chart shows at one place, in words. @param {number} index */
  words(index) {
    const { x, y, band } = this.what;
    const at = this.#times()[index];
    if (at === undefined) return "";
    const decimals = y.decimals ?? 3;
    const parts = this.#lines().map((each) => `${each.label} ${shown(this.columns[each.key]?.[index], decimals)} ${y.unit}`.trimEnd());
    if (band && this.#hasBand()) {
      const edge = (/** @type {string} */ key) => shown(this.columns[key]?.[index], decimals);
      parts.push(`${band.label} ${edge(band.lower)} to ${edge(band.upper)} ${y.unit}`);
    }
    return `At ${shown(at, x.decimals ?? 2)} ${x.unit}: ${parts.join("; ")}`;
  }

  /** @param {KeyboardEvent} event */
  #key(event) {
    const last = this.#times().length - 1;
    const page = Math.max(1, Math.round(last / 10));
    /** @type {Record<string, number>} */
    const to = { ArrowRight: this.at + 1, ArrowUp: this.at + 1, ArrowLeft: this.at - 1, ArrowDown: this.at - 1, Home: 0, End: last,
      PageUp: this.at + page, PageDown: this.at - page };
    if (!(event.key in to) || last < 0) return;
    event.preventDefault();
    this.at = Math.min(last, Math.max(0, to[event.key]));
    const left = this.plot.valToPos(this.#times()[this.at], "x");
    const value = this.columns[this.#lines()[0]?.key]?.[this.at];
    this.plot.setCursor({ left, top: value == null ? 0 : this.plot.valToPos(value, "y") });
    this.#speak();
    this.reading.textContent = this.words(this.at);
  }

  #fillTable() {
    if (!this.details.open) return;
    const { x, y, band } = this.what;
    const lines = this.#lines();
    const keys = [...lines.map((each) => each.key), ...(band && this.#hasBand() ? [band.lower, band.upper] : [])];
    const heads = [...lines.map((each) => each.label), ...(band && this.#hasBand() ? ["Band, lower", "Band, upper"] : [])];
    const times = this.#times();
    const rows = Array.from({ length: Math.min(ROWS, times.length) }, (_, row) =>
      Math.round((row * (times.length - 1)) / Math.max(1, Math.min(ROWS, times.length) - 1)));
    fill(this.table, h("table", {},
      h("thead", {}, h("tr", {}, ...[titled(x), ...heads.map((label) => titled({ label, unit: y.unit }))].map((each) => h("th", { scope: "col" }, each)))),
      h("tbody", {}, ...rows.map((row) => h("tr", {}, h("th", { scope: "row" }, shown(times[row], x.decimals ?? 2)),
        ...keys.map((key) => h("td", {}, shown(this.columns[key]?.[row], y.decimals ?? 3))))))));
  }
}

/** @param {{label: string, unit: string}} axis  a ratio has no unit */
function titled({ label, unit }) {
  return unit ? `${label} (${unit})` : label;
}

/** @param {string} name  of a custom property @param {"solid" | "dashed" | "area"} kind */
export function swatch(name, kind) {
  const made = h(`span.swatch.${kind}`, {});
  made.style.setProperty("--swatch", `var(${name})`);
  return made;
}
