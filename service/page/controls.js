// @ts-check
// Inputs that views share: a number by slider or by typing, and the choice of a version.

import { h, shown } from "./dom.js";
import { models, references } from "./fields.js";

/**
 * A number with a slider beside a field. The field takes the whole range of the service, the slider the part around the
 * runs that the version was trained on, which its track shows.
 */
export class NumberControl {
  /**
   * @param {import("./fields.js").Field} field
   * @param {string} label
   * @param {{input: () => void, commit: () => void}} heard  while it moves; when it rests
   */
  constructor(field, label, heard) {
    this.field = field;
    this.label = label;
    this.value = field.start;
    this.low = field.minimum;
    this.high = field.maximum;
    /** @type {[number, number]} */
    this.domain = [this.low, this.high];
    this.step = 1;
    const id = `field-${field.name}`;
    this.slider = h("input", { type: "range", id: `${id}-slider`, "aria-label": `${label}, slider` });
    this.number = h("input", { type: "number", id, step: "any", inputmode: "decimal", "aria-describedby": `${id}-hint` });
    this.hint = h("span.hint", { id: `${id}-hint` });
    this.element = h("div.control", { "data-field": field.name },
      h("label", { for: id, title: field.meaning }, label), h("span.entry", {}, this.number, h("span.unit", {}, field.unit)),
      this.slider, this.hint);
    this.slider.addEventListener("input", () => {
      this.set(this.#allowed(Number(this.slider.value)));
      heard.input();
    });
    this.slider.addEventListener("change", heard.commit);
    this.number.addEventListener("input", () => {
      if (!this.number.value.trim() || !Number.isFinite(Number(this.number.value))) return;
      this.set(Number(this.number.value), { typed: true });
      heard.input();
    });
    this.number.addEventListener("change", () => {
      this.set(this.value);
      heard.commit();
    });
    this.range([field.minimum, field.maximum]);
    this.set(field.start);
  }

  /** Show this value. @param {number} value @param {{typed?: boolean}} [how]  typed: leave the field as it is written */
  set(value, { typed = false } = {}) {
    const changed = value !== this.value;
    this.value = value;
    this.#place();
    if (!typed) this.number.value = String(Number(value.toPrecision(10)));
    if (changed) this.complain("");
    else if (!this.element.classList.contains("wrong")) this.#hint(); // what is wrong stays wrong, as when the field is left
  }

  /** @param {number} value  of the slider, whose steps may begin below the least that is allowed */
  #allowed(value) {
    return Math.min(this.field.maximum, Math.max(this.field.minimum, value));
  }

  /** The runs of the version go from here to there; all at one value, the slider goes from nothing to twice of it. @param {[number, number] | undefined} domain */
  range(domain) {
    const { minimum, maximum } = this.field;
    this.domain = domain ?? [minimum, maximum];
    let [low, high] = this.domain;
    if (isPoint(this.domain)) [low, high] = low ? [low - Math.abs(low), low + Math.abs(low)] : [minimum, maximum].map((each) => each / 10);
    const beyond = isPoint(this.domain) ? 0 : 0.15 * (high - low);
    this.step = 10 ** Math.floor(Math.log10((high - low) / 200));
    const grain = 10 * this.step;
    this.low = onGrid(low - beyond, grain, Math.floor);
    this.high = onGrid(high + beyond, grain, Math.ceil);
    if (this.low < minimum) this.low = onGrid(minimum, this.step, Math.ceil); // steps of the slider count from its low end
    if (this.high > maximum) this.high = onGrid(maximum, this.step, Math.floor);
    this.#place();
    if (!this.element.classList.contains("wrong")) this.#hint(); // what is wrong stays wrong
  }

  /** Say what is wrong with it; nothing: all is well. @param {string} words */
  complain(words) {
    this.element.classList.toggle("wrong", words !== "");
    if (words) this.number.setAttribute("aria-invalid", "true");
    else this.number.removeAttribute("aria-invalid");
    if (words) this.hint.textContent = words;
    else this.#hint();
  }

  #hint() {
    const [low, high] = this.domain;
    if (low === this.field.minimum && high === this.field.maximum) this.hint.textContent = "";
    else {
      const inside = this.value >= low && this.value <= high;
      const runs = isPoint(this.domain) ? `All runs at ${number(low)} ${this.field.unit}` : `Runs from ${number(low)} to ${number(high)} ${this.field.unit}`;
      this.hint.textContent = inside ? runs : `Outside. ${runs}`;
      this.element.classList.toggle("outside", !inside);
    }
  }

  /** Put the slider where the value is; where that is beyond its ends, they move. */
  #place() {
    const low = Math.min(this.low, onGrid(this.value, this.step, Math.floor));
    const high = Math.max(this.high, onGrid(this.value, this.step, Math.ceil));
    Object.assign(this.slider, { min: String(low), max: String(high), step: String(this.step) });
    const seen = isPoint(this.domain) ? 0.006 * (high - low) : 0; // a point would not be seen
    const [first, last] = [this.domain[0] - seen, this.domain[1] + seen];
    const share = (/** @type {number} */ at) => `${(100 * Math.min(1, Math.max(0, (at - low) / (high - low)))).toFixed(2)}%`;
    this.slider.style.setProperty("--from", share(first));
    this.slider.style.setProperty("--to", share(last));
    this.slider.value = String(this.value);
    this.slider.setAttribute("aria-valuetext", `${this.value} ${this.field.unit}`);
  }
}

/** What is wrong with a number, beside it. @param {{message: string, allowed?: string} | undefined} fault  undefined: nothing */
export function faultWords(fault) {
  return fault?.allowed ? `Allowed is ${fault.allowed}` : fault?.message ?? "";
}

/** Whether all runs are at one value. @param {[number, number]} domain */
function isPoint([low, high]) {
  return !(high - low > 1e-6 * Math.max(Math.abs(low), Math.abs(high)));
}

/** A multiple of a step beside a value. @param {number} value @param {number} step @param {(share: number) => number} round */
function onGrid(value, step, round) {
  return Number((round(Number((value / step).toPrecision(12))) * step).toPrecision(12));
}

/** @param {number} value */
function number(value) {
  return shown(value, Number.isInteger(value) ? 0 : 1);
}

/**
 * The choice of who answers: the service's default, an alias, or a version.
 * @param {string} chosen  a reference; empty: the default
 * @param {(reference: string) => void} heard
 */
export function versionControl(chosen, heard) {
  const list = h("select", { id: "field-model", "aria-describedby": "field-model-hint", change: () => heard(list.value) }, h("option", { value: "" }, "Default of this service"));
  const hint = h("span.hint", { id: "field-model-hint" });
  const element = h("div.control", { "data-field": "model" }, h("label", { for: "field-model" }, "Version"), list, hint);
  const set = (/** @type {string} */ reference) => {
    if (![...list.options].some((each) => each.value === reference)) list.append(h("option", { value: reference }, reference));
    list.value = reference;
  };
  set(chosen);
  const refill = () => models().then((all) => {
    const now = list.value;
    for (const { reference, words } of references(all)) {
      const there = [...list.options].find((each) => each.value === reference);
      if (there) there.textContent = words;
      else list.append(h("option", { value: reference }, words));
    }
    list.value = now;
  }, () => {}); // the default can be asked all the same
  void refill();
  /** @param {string} words */
  const complain = (words) => {
    element.classList.toggle("wrong", words !== "");
    if (words) list.setAttribute("aria-invalid", "true");
    else list.removeAttribute("aria-invalid");
    hint.textContent = words;
  };
  return { element, set, complain, refill, get value() { return list.value; } };
}
