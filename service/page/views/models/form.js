// @ts-check
// Form fields from a JSON schema of the service: their kinds, ranges, defaults and meanings are the service's.

import { h } from "../../dom.js";

/** @type {Record<string, string>} */
const LABELS = {
  slope_deg: "Slope (°)", mass_kg: "Mass (kg)", torque_nm: "Wheel torque (N m)", horizon_s: "Time (s)", name: "Name", description: "Description",
  column_map: "Column map", set_name: "Set", passport: "Passport (JSON)", strict: "Refuse all when one run is unusable", frame: "Frame", reference: "Point of the rover",
  start: "Start", model: "Model", architecture: "Learned part", prior: "Closed-form part", x_form: "Output", seed: "Seed", promote: "Promotion", margin: "Margin",
  "budget.max_epochs": "Most epochs", "budget.max_minutes": "Most minutes", "split.test_slopes_deg": "Slopes kept for testing (°)", "split.test_fraction": "Share kept for testing",
  inputs: "Inputs",
};

/** The schema of one field, without null and references. @param {any} whole @param {string} path  `budget.max_epochs` @returns {any} */
export function schemaAt(whole, path) {
  let found = whole;
  for (const part of path.split(".")) {
    const told = found.properties?.[part];
    if (!told) return undefined;
    found = plain(told, whole);
  }
  return found;
}

/** @param {any} told @param {any} whole */
function plain(told, whole) {
  const choices = (told.anyOf ?? [told]).filter((/** @type {any} */ each) => each.type !== "null");
  const [chosen] = choices;
  const name = chosen.$ref?.split("/").at(-1);
  return { ...(name ? whole.$defs[name] : chosen), ...told, anyOf: undefined, json: choices.some((/** @type {any} */ each) => each.type === "object") };
}

/** The fields at these paths; those that the service does not have are left out. */
export class Form {
  /** @param {string} prefix  of ids @param {any} schema @param {string[]} paths @param {() => void} [changed] */
  constructor(prefix, schema, paths, changed = () => {}) {
    this.fields = paths.map((path) => ({ path, schema: schemaAt(schema, path) })).filter((each) => each.schema).map(({ path, schema: told }) =>
      ({ path, ...made(`${prefix}-${path.replace(".", "-")}`, path, told, changed) }));
    this.element = h("div.fields", {}, ...this.fields.map((each) => each.element));
  }

  /** What was filled in, by path; what is empty or the default is left to the service. @returns {Record<string, any>} */
  values() {
    return Object.fromEntries(this.fields.map(({ path, read }) => [path, read()]).filter(([, value]) => value !== undefined));
  }

  /** @param {string} path @param {string} value */
  set(path, value) {
    const field = this.fields.find((each) => each.path === path);
    if (field) field.input.value = value;
  }

  /** Say what is wrong at its field; returns the faults of other fields. @param {import("../../api.js").Problem["fields"]} faults */
  complain(faults) {
    for (const { path, input, hint, meaning, element } of this.fields) {
      const fault = faults.find(({ field }) => field === path || field.startsWith(`${path}.`));
      hint.textContent = fault ? fault.message : meaning;
      element.classList.toggle("wrong", Boolean(fault));
      if (fault) {
        input.setAttribute("aria-invalid", "true");
        for (let at = element.closest("details"); at; at = at.parentElement?.closest("details") ?? null) at.open = true;
      } else input.removeAttribute("aria-invalid");
    }
    return faults.filter(({ field }) => !this.fields.some(({ path }) => field === path || field.startsWith(`${path}.`)));
  }
}

/** @param {string} id @param {string} path @param {any} told @param {() => void} changed */
function made(id, path, told, changed) {
  const meaning = (told.description ?? "").replaceAll("`", "");
  const hint = h("span.hint", { id: `${id}-hint` }, meaning);
  const about = { id, "aria-describedby": `${id}-hint`, change: changed };
  const [input, read] = control(about, told);
  const label = h("label", { for: id }, LABELS[path] ?? path.replaceAll("_", " "));
  const element = h("div.field", { "data-field": path }, ...(input.type === "checkbox" ? [h("span.row", {}, input, label)] : [label, input]), hint);
  return { input, read, hint, meaning, element };
}

/** An input, and how its value is read: undefined where it is left to the service. @param {any} about @param {any} told @returns {[any, () => any]} */
function control(about, told) {
  if (told.type === "boolean") {
    const box = h("input", { ...about, type: "checkbox" });
    return [box, () => (box.checked ? true : undefined)];
  }
  if (told.enum) {
    const list = h("select", about, told.default === undefined || told.default === null ? h("option", { value: "" }, "as the file says") : null,
      ...told.enum.map((/** @type {string} */ each) => h("option", { value: each }, each.replaceAll("_", " "))));
    list.value = told.default ?? "";
    return [list, () => (list.value === (told.default ?? "") ? undefined : list.value)];
  }
  if (told.type === "number" || told.type === "integer") {
    const field = h("input", { ...about, type: "number", step: told.type === "integer" ? "1" : "any", min: told.minimum, max: told.maximum, placeholder: told.default });
    return [field, () => (field.value.trim() === "" ? undefined : Number(field.value))];
  }
  if (told.type === "array") {
    const field = h("input", { ...about, type: "text", placeholder: "none", autocomplete: "off" });
    const read = () => field.value.split(/[\s,;]+/).filter(Boolean).map((/** @type {string} */ each) => (told.items?.type === "number" && Number.isFinite(Number(each)) ? Number(each) : each));
    return [field, () => (field.value.trim() ? read() : undefined)];
  }
  const usual = typeof told.default === "string" ? told.default : undefined;
  const text = told.type === "object" ? h("textarea", { ...about, rows: "2", spellcheck: "false" }) :
    h("input", { ...about, type: "text", maxlength: told.json ? undefined : told.maxLength, autocomplete: "off", placeholder: usual });
  return [text, () => (text.value.trim() === "" || text.value === usual ? undefined : text.value.trim())];
}
