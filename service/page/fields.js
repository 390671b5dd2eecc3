// @ts-check
// What may be asked: ranges, defaults and meanings as the service says them, the domain of a version, and which there are.

import { askJson } from "./api.js";

/**
 * A field of a question.
 * @typedef {{name: string, minimum: number, maximum: number, start: number, meaning: string, unit: string}} Field
 */

const UNITS = { deg: "°", kg: "kg", nm: "N m", s: "s", m: "m" };

/** @type {Promise<Record<string, any>> | undefined} */
let schemas;

/**
 * The fields of a question that are numbers.
 * @param {"prediction" | "mobility" | "drive"} question
 * @returns {Promise<Record<string, Field>>}
 */
export async function fieldsOf(question) {
  /** @type {Record<string, Field>} */
  const found = {};
  for (const [name, told] of Object.entries((await schemaOf(question)).properties)) {
    const said = /** @type {any} */ (told);
    const range = said.type ? said : said.anyOf?.find((/** @type {any} */ each) => "minimum" in each) ?? said;
    if (range.type !== "number" && range.type !== "integer") continue;
    found[name] = {
      name,
      minimum: range.minimum,
      maximum: range.maximum,
      start: said.examples?.[0] ?? said.default ?? range.minimum,
      meaning: said.description ?? "",
      unit: UNITS[/** @type {keyof typeof UNITS} */ (name.split("_").at(-1))] ?? "",
    };
  }
  return found;
}

/** The forms that an answer can have, as `format` takes them. @param {"prediction" | "mobility"} question @returns {Promise<string[]>} */
export async function formsOf(question) {
  const { properties, $defs } = await schemaOf(question);
  const { $ref = "", anyOf = [] } = properties.format;
  return $defs[($ref || anyOf[0]?.$ref || "").split("/").at(-1)]?.enum ?? [];
}

/**
 * What may be asked, as a JSON schema.
 * @param {"prediction" | "mobility" | "drive" | "upload" | "training"} question
 * @returns {Promise<any>}
 */
export async function schemaOf(question) {
  schemas ??= askJson("page/fields.json");
  schemas.catch(() => { schemas = undefined; }); // asked anew, the next time
  return (await schemas)[question];
}

/** @typedef {{name: string, versions: number[], archived: number[], deleted: number[], aliases: Record<string, number>}} ModelEntry */

/** All models with their versions and aliases. @returns {Promise<ModelEntry[]>} */
export async function models() {
  return (await askJson("v1/models")).models;
}

/**
 * The references that can be asked for, each with words for a list.
 * @param {ModelEntry[]} all
 * @returns {{reference: string, words: string}[]}
 */
export function references(all) {
  return all.flatMap(({ name, versions, aliases }) => [
    ...Object.entries(aliases).map(([alias, version]) =>
      ({ reference: `${name}@${alias}`, words: `${name}, ${alias} (version ${version})` })),
    ...versions.toReversed().map((version) => ({ reference: `${name}@${version}`, words: `${name}, version ${version}` })),
  ]);
}

/**
 * What a version knows. `ranges` are those of the runs that it was trained on, by field.
 * @typedef {{ranges: Record<string, [number, number]>, band: boolean, drives: boolean}} Knowledge
 */

/**
 * What a version knows, from its manifest; undefined where that cannot be read: the answer to the question says why.
 * @param {string} reference  empty: the service's default model
 * @returns {Promise<Knowledge | undefined>}
 */
export async function knowledgeOf(reference) {
  try {
    const { name, version } = await resolved(reference);
    const { domain, band, checkpoint } = await askJson(`v1/models/${encodeURIComponent(name)}/versions/${version}`);
    const ranges = Object.entries(domain ?? {}).filter(([, range]) =>
      Array.isArray(range) && range.length === 2 && range.every((each) => typeof each === "number"));
    return { ranges: Object.fromEntries(ranges), band: Boolean(band), drives: checkpoint?.architecture?.name === "drive_model" };
  } catch {
    return undefined;
  }
}

/** @param {string} reference @returns {Promise<{name: string, version: number | string}>} */
async function resolved(reference) {
  if (!reference) return (await askJson("health/ready")).model;
  const [name, at = "champion"] = reference.split("@");
  if (/^[0-9]+$/.test(at)) return { name, version: at };
  return { name, version: (await askJson(`v1/models/${encodeURIComponent(name)}`)).aliases[at] };
}
