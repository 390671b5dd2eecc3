// @ts-check
// Aliases: which version answers under which name, its history, and moves that happen only to what was read.

import { Problem, ask, askJson } from "../../api.js";
import { fill, h } from "../../dom.js";
import { confirm, whenAdmitted } from "./dialogs.js";
import { refusal, table, when } from "./show.js";

/**
 * @typedef {import("./show.js").Chosen} Chosen
 * @typedef {{version: number, seq: number, time: string, actor: string, reason: string, previous_seq: number | null}} Alias
 */

const USUAL = "champion"; // what answers those who name no version

/** @param {string} name @param {string} [alias] */
function addressOf(name, alias) {
  return `v1/models/${encodeURIComponent(name)}/aliases${alias === undefined ? "" : `/${encodeURIComponent(alias)}`}`;
}

/** @param {string} name @param {string} alias @returns {Promise<Alias[]>}  newest first */
async function historyOf(name, alias) {
  return (await askJson(`${addressOf(name, alias)}/history`)).history;
}

/** @param {HTMLElement} room @returns {import("./show.js").Part} */
export function mount(room) {
  let turn = 0;
  /** @type {import("./show.js").Part} */
  const part = {
    unmount: () => { turn += 1; },
    async update(chosen) {
      const mine = ++turn;
      try {
        const names = Object.keys((await askJson(addressOf(chosen.name))).aliases).sort((one, other) =>
          Number(other === USUAL) - Number(one === USUAL) || one.localeCompare(other));
        const histories = await Promise.all(names.map((alias) => historyOf(chosen.name, alias)));
        if (mine !== turn) return;
        const told = h("div");
        fill(room, ...(names.length ? names.map((alias, at) => card(chosen, alias, histories[at])) : [h("p.card", {}, "This model has no alias yet.")]),
          h("div.card.stack", {}, h("p", {}, "Aliases are names that programs ask for; they stay while versions change. “champion” answers those who name no version."),
            h("p.row", {}, h("button", { type: "button", click: () => whenAdmitted(told, () => promote(chosen, chosen.version)) }, `Point an alias to version ${chosen.version}…`)), told));
        room.dataset.shown = chosen.name;
      } catch (error) {
        if (!(error instanceof Problem)) throw error;
        if (mine === turn) fill(room, h("div.card", {}, refusal(error, () => void part.update(chosen))));
      }
    },
  };
  return part;
}

/** @param {Chosen} chosen @param {string} alias @param {Alias[]} history */
function card(chosen, alias, history) {
  const [now] = history;
  const usable = chosen.models.find((each) => each.name === chosen.name)?.versions ?? [];
  const back = history.find(({ seq }) => seq === now.previous_seq);
  const why = !back ? "There is no version before." : usable.includes(back.version) ? "" : `Version ${back.version}, which it had before, cannot be used. Point it to another one.`;
  const told = h("div");
  const roll = h("button", { type: "button", disabled: why !== "", click: () => whenAdmitted(told, () => rollBack(chosen, alias)) }, "Roll back…");
  return h("section.card.stack", { "data-alias": alias }, h("div.row", {}, h("h2", {}, alias), h("span.tag.good", {}, `version ${now.version}`), roll,
    why && h("span.small.muted", {}, why)), told,
    table(`History of ${alias}`, ["Move", "Version", "~When", "~Who", "~Why"], history.map((each) => [each.seq,
      usable.includes(each.version) ? h("a", { href: chosen.to({ version: each.version, show: "card" }) }, each.version) : each.version, when(each.time), each.actor, each.reason])));
}

/** @param {Alias | undefined} now @param {string} alias */
function standing(now, alias) {
  if (!now) return h("p", {}, "There is no ", h("strong", {}, alias), " of this model yet.");
  return h("p", {}, h("strong", {}, alias), " points to ", h("strong", {}, `version ${now.version}`), " since ", when(now.time), `, by ${now.actor}${now.reason ? `: ${now.reason}` : "."}`);
}

/** @param {Problem} problem @param {Alias | undefined} now @param {string} alias */
function overtaken(problem, now, alias) {
  return h("div.notice.warn", { role: "alert", "data-refused": problem.type }, h("p", {}, h("strong", {}, "Somebody moved it meanwhile. "), "You moved nothing. Look at what holds now, then decide again."),
    standing(now, alias));
}

/** Ask which alias is to point to a version, and move it. @param {Chosen} chosen @param {number} version */
export async function promote(chosen, version) {
  const there = (await askJson(addressOf(chosen.name))).aliases;
  const names = [...new Set([USUAL, "candidate", ...Object.keys(there)])];
  const list = h("select", { id: "alias-name", change: () => void again(list.value) }, ...names.map((each) => h("option", { value: each }, each)));
  const choice = h("p.row", {}, h("label", { for: "alias-name" }, "Alias"), list);
  const body = h("div.stack", {}, choice, h("div"));
  /** @type {Alias | undefined} */
  let now;

  /** @param {string} alias @param {Problem} [problem] @returns {Promise<import("./dialogs.js").Content>} */
  async function content(alias, problem) {
    now = (await askJson(addressOf(chosen.name))).aliases[alias];
    list.value = alias;
    fill(body.children[1], problem ? overtaken(problem, now, alias) : standing(now, alias), moves(alias, now?.version));
    return {
      title: `Promote ${chosen.name}, version ${version}`, body: [body], action: words(alias, now?.version), reason: "wanted",
      act: (reason) => move(alias, now, reason),
      again: async (refused) => (refused.status === 412 ? content(alias, refused) : undefined),
    };
  }

  /** @param {string} alias @param {number | undefined} from */
  const words = (alias, from) => (from === undefined ? `Point ${alias} to ${version}` : `Move ${alias} from ${from} to ${version}`);

  /** @param {string} alias @param {number | undefined} from */
  const moves = (alias, from) => h("p", { "data-will": alias }, from === version ? "It names this version already; a move only adds a reason to its history." :
    `It will point to version ${version}.${alias === USUAL ? " Every prediction that names no version comes from it within seconds. Requests that run finish on the version that they began with." : ""}`);

  /** @param {string} alias @param {Alias | undefined} was @param {string} reason */
  async function move(alias, was, reason) {
    /** @type {Record<string, string>} */
    const condition = was ? { "If-Match": `"${was.seq}"` } : { "If-None-Match": "*" };
    await ask(addressOf(chosen.name, alias), { method: "PUT", body: { version, reason }, headers: condition });
    await chosen.reload();
    return `${alias} of ${chosen.name} points to version ${version}`;
  }

  /** Another alias was chosen in the dialog. @param {string} alias */
  async function again(alias) {
    const other = await content(alias);
    asked.replace(other);
  }

  const asked = confirm(await content(USUAL));
}

/** Take the last move of an alias back. @param {Chosen} chosen @param {string} alias */
async function rollBack(chosen, alias) {
  /** @param {Problem} [problem] @returns {Promise<import("./dialogs.js").Content>} */
  async function content(problem) {
    const history = await historyOf(chosen.name, alias);
    const [now] = history;
    const back = history.find(({ seq }) => seq === now.previous_seq);
    return {
      title: `Roll back ${alias} of ${chosen.name}`, action: `Move ${alias} from ${now.version} back to ${back?.version ?? "–"}`, reason: "wanted",
      body: [problem ? overtaken(problem, now, alias) : standing(now, alias), h("p", { "data-will": alias }, back ?
        `It will point to version ${back.version} again, as it did since ${back.time.slice(0, 10)}.` : "There is no version before: move it to a version by hand.")],
      act: async (reason) => {
        const { version } = await askJson(`${addressOf(chosen.name, alias)}/rollback`, { body: { reason }, headers: { "If-Match": `"${now.seq}"` } });
        await chosen.reload();
        return `${alias} of ${chosen.name} points to version ${version} again`;
      },
      again: async (refused) => (refused.status === 412 ? content(refused) : undefined),
    };
  }
  confirm(await content());
}
