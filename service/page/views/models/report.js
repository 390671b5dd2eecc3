// @ts-check
// What the service found in an upload: what can be used, and every finding with its place, rejections first.

import { fill, h } from "../../dom.js";
import { counted, fold, span, table } from "./show.js";

/**
 * @typedef {{file: string, row: number | null, column: string | null, code: string, severity: string, message: string}} Finding
 * @typedef {{accepted: string[], rejected: string[], findings: Finding[], findings_count: number, summary: any}} Report
 */

const SHOWN = 200; // rows at a time

/** @param {Report} report @param {{stored?: string}} [how]  stored: the name under which the store has it */
export function reportView(report, { stored = "" } = {}) {
  const { accepted, rejected, findings } = report;
  const all = accepted.length + rejected.length;
  const kind = accepted.length === 0 ? "bad" : rejected.length ? "warn" : "good";
  const head = stored ? `Stored as “${stored}”: ` : "";
  const words = `${accepted.length} of ${counted(all, "run")} can be used`;
  return h("div.stack", { "data-report": kind }, h(`p.notice.${kind}`, {}, h("strong", {}, `${head}${words}.`),
    rejected.length > 0 && accepted.length > 0 ? " The others stay out; the table says why." : "", accepted.length === 0 ? " The table says why." : ""),
  report.summary && summary(report.summary), findings.length ? findingsView(report) : h("p.muted", {}, "Nothing else was found in it."),
  accepted.length > 0 && fold(`Runs that can be used (${accepted.length})`, () => h("ul.plain.long", { tabindex: "0", "aria-label": "Runs that can be used" }, ...accepted.map((each) => h("li", {}, each)))));
}

/** @param {any} told */
export function summary(told) {
  const rows = [["Slope", span(told.slope_deg, "°")], ["Mass", span(told.mass_kg, "kg")], ["Wheel torque", span(told.torque_nm, "N m")], ["Time", span(told.horizon_s, "s")],
    ["Step", span(told.step_s, "s")], ["Way", span(told.distance_m, "m")]];
  const varies = Object.entries(told.varies ?? {}).filter(([, count]) => count);
  return h("div.stack", {}, h("dl.facts", {}, ...[["Runs", told.runs], ["Rows", told.rows?.toLocaleString("en")], ...rows].map(([name, value]) => h("div", {}, h("dt", {}, name), h("dd", {}, value)))),
    varies.length > 0 && h("p.small", {}, `What changes within runs: ${varies.map(([name, count]) => `${name} in ${count}`).join(", ")}.`));
}

/** @param {Report} report */
function findingsView({ findings, findings_count }) {
  const codes = [...new Set(findings.map((each) => each.code))];
  const severity = h("select", { id: "finding-severity", change: show }, h("option", { value: "" }, `All (${findings.length})`),
    ...["reject", "warn"].map((each) => h("option", { value: each }, `${each === "reject" ? "Rejections" : "Warnings"} (${findings.filter((found) => found.severity === each).length})`)));
  const code = h("select", { id: "finding-code", change: show }, h("option", { value: "" }, "Every reason"),
    ...codes.map((each) => h("option", { value: each }, `${each} (${findings.filter((found) => found.code === each).length})`)));
  const text = h("input", { id: "finding-text", type: "text", input: show, autocomplete: "off", placeholder: "file, column or words" });
  const room = h("div.stack");
  let most = SHOWN;

  function show() {
    const words = text.value.trim().toLowerCase();
    const chosen = findings.filter((each) => (!severity.value || each.severity === severity.value) && (!code.value || each.code === code.value) &&
      (!words || `${each.file} ${each.column ?? ""} ${each.code} ${each.message}`.toLowerCase().includes(words)));
    const rows = chosen.slice(0, most).map((each) => [h(`strong.${each.severity === "reject" ? "bad" : "warn"}`, {}, each.severity === "reject" ? "rejected" : "warning"),
      each.file, each.row ?? "", each.column ?? "", h("code", {}, each.code), each.message]);
    const more = chosen.length > most && h("button", { type: "button", click: () => { most += SHOWN; show(); } }, `Show ${Math.min(SHOWN, chosen.length - most)} more`);
    fill(room, h("p.small.muted", { role: "status" }, `${counted(chosen.length, "finding")} of ${findings_count}.`),
      rows.length > 0 && table("Findings", ["~What", "~File", "Line", "~Column", "~Reason", "~In words"], rows), more);
  }

  const filter = h("div.row", { role: "group", "aria-label": "Which findings" }, h("label", { for: "finding-severity" }, "Show"), severity,
    h("label", { for: "finding-code" }, "Reason"), code, h("label", { for: "finding-text" }, "Find"), text);
  show();
  return h("div.stack.findings", {}, h("h3", {}, "What was found"), filter, room);
}
