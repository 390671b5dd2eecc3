// @ts-check
// The events of a job as they come. EventSource sends no token, so the stream is read here, and taken up again where it broke.

import { Problem, ask } from "../../api.js";

/** @typedef {{id: number | undefined, kind: string, data: any}} JobEvent */

export const ENDED = new Set(["succeeded", "failed", "cancelled"]);
const LONGEST_S = 3700; // the service ends a stream after an hour
const SILENT_MS = 45_000; // it sends a comment each 15 s
const FIRST_WAIT_MS = 1000;
const MOST_WAIT_MS = 30_000;
const MOST_TRIES = 60; // one after another without any event

/**
 * Events in a stream of bytes, as they are complete.
 * @param {ReadableStream<Uint8Array>} stream @param {() => void} alive  called for all that comes
 * @returns {AsyncGenerator<JobEvent>}
 */
export async function* eventsOf(stream, alive = () => {}) {
  const reader = stream.pipeThrough(new TextDecoderStream()).getReader();
  let text = "";
  try {
    for (;;) {
      const { done, value } = await reader.read();
      if (done) return; // what is not complete does not count
      alive();
      text = (text + value).replaceAll("\r\n", "\n");
      const blocks = text.split("\n\n");
      text = blocks.pop() ?? "";
      for (const block of blocks) {
        const event = parsed(block);
        if (event) yield event;
      }
    }
  } finally {
    reader.cancel().catch(() => {});
  }
}

/** @param {string} block @returns {JobEvent | undefined} */
function parsed(block) {
  /** @type {Record<string, string>} */
  const found = {};
  for (const line of block.split("\n")) {
    const [, name, value] = /^([a-z]+): ?(.*)$/.exec(line) ?? [];
    if (name) found[name] = name === "data" && "data" in found ? `${found.data}\n${value}` : value;
  }
  if (!("data" in found)) return undefined;
  try {
    return { id: /^\d+$/.test(found.id ?? "") ? Number(found.id) : undefined, kind: found.event ?? "message", data: JSON.parse(found.data) };
  } catch {
    return undefined;
  }
}

/**
 * Hear of all events of a job until it has ended. Raises Problem where the service does not let us.
 * @param {string} job
 * @param {{signal: AbortSignal, heard: (event: JobEvent) => void, told: (state: "live" | "waiting") => void}} how
 */
export async function follow(job, { signal, heard, told }) {
  /** @type {number | undefined} */
  let last;
  let wait_ms = FIRST_WAIT_MS;
  for (let tries = 0; tries < MOST_TRIES && !signal.aborted; tries++) {
    try {
      for await (const event of opened(job, last, signal, () => told("live"))) {
        last = event.id ?? last;
        tries = 0;
        wait_ms = FIRST_WAIT_MS;
        heard(event);
        if (event.kind === "state" && ENDED.has(event.data.state)) return;
      }
    } catch (error) {
      if (signal.aborted || error === OVER) return;
      if (error instanceof Problem) {
        if (error.status >= 400 && error.status < 500 && error.status !== 408 && error.status !== 429) throw error;
        wait_ms = Math.max(wait_ms, Math.min(MOST_WAIT_MS, error.wait_s * 1000));
      }
    }
    told("waiting");
    await pause(wait_ms * (0.75 + Math.random() / 2), signal);
    wait_ms = Math.min(2 * wait_ms, MOST_WAIT_MS);
  }
  if (!signal.aborted) throw new Problem(0, {}, "the events of this job cannot be reached");
}

const OVER = new Error("there is no later event");

/** @param {string} job @param {number | undefined} last @param {AbortSignal} signal @param {() => void} live */
async function* opened(job, last, signal, live) {
  const silent = new AbortController();
  const stop = () => silent.abort();
  signal.addEventListener("abort", stop);
  let timer = setTimeout(stop, SILENT_MS);
  try {
    /** @type {Record<string, string>} */
    const headers = { Accept: "text/event-stream", ...(last === undefined ? {} : { "Last-Event-ID": String(last) }) };
    const answer = await ask(`v1/admin/training-jobs/${encodeURIComponent(job)}/events`, { headers, signal: silent.signal, deadline_s: LONGEST_S });
    if (answer.status === 204 || !answer.body) throw OVER;
    live();
    yield* eventsOf(answer.body, () => {
      clearTimeout(timer);
      timer = setTimeout(stop, SILENT_MS);
    });
  } finally {
    clearTimeout(timer);
    signal.removeEventListener("abort", stop);
  }
}

/** @param {number} time_ms @param {AbortSignal} signal */
function pause(time_ms, signal) {
  return new Promise((over) => {
    const timer = setTimeout(over, time_ms);
    signal.addEventListener("abort", () => { clearTimeout(timer); over(undefined); }, { once: true });
  });
}
