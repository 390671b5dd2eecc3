// @ts-check
// Asking the service. Addresses are relative to the page, so that it works behind a proxy with a prefix.

const DEADLINE_S = 20;
const PATIENCE_MS = 2000; // so long an outdated question may still be answered: giving up sooner, a slow service would never answer any

let token = ""; // in memory only: gone with the page
/** @type {Set<(wanted: boolean) => void>} */
const watchers = new Set();

/** @param {string} text  empty: forget it */
export function setToken(text) {
  token = text.trim();
  watchers.forEach((heard) => heard(false));
}

/** Whether there is a token. */
export function hasToken() {
  return token !== "";
}

/** Hear of each change of the token, with true where an answer asked for one. @param {(wanted: boolean) => void} heard */
export function onToken(heard) {
  watchers.add(heard);
  return () => watchers.delete(heard);
}

/** What the service refused, in its own words. `fields` are those of the question that are wrong. */
export class Problem extends Error {
  /** @param {number} status  0: no answer @param {any} [document] @param {string} [otherwise] @param {number} [wait_s]  before the next try */
  constructor(status, document = {}, otherwise = "", wait_s = 0) {
    super(document?.detail || otherwise || `the service answered ${status}`);
    this.name = "Problem";
    this.status = status;
    this.title = document?.title || "No answer";
    this.type = String(document?.type || "").replace(/^.*:/, ""); // `outside-domain`
    /** @type {{field: string, value?: string, allowed?: string, message: string}[]} */
    this.fields = Array.isArray(document?.errors) ? document.errors : [];
    this.document = document;
    this.wait_s = wait_s;
    this.unreachable = false; // nothing answers at all
  }

  /** Which controls to mark, and why. */
  get faults() {
    return this.type === "model-not-found" ? [{ field: "model", message: this.message }] : this.fields;
  }
}

/**
 * The whole address of a question to the service.
 * @param {string} path  without a slash in front: `v1/predictions`
 * @param {URLSearchParams | Record<string, any>} [query]  empty values are left out
 */
export function address(path, query = {}) {
  const found = new URL(path, document.baseURI.replace(/#.*$/, ""));
  const entries = query instanceof URLSearchParams ? [...query] : Object.entries(query);
  for (const [name, value] of entries) {
    if (value !== "" && value !== null && value !== undefined) found.searchParams.set(name, String(value));
  }
  found.search = found.search.replaceAll("%2C", ",").replaceAll("%40", "@");
  return found.href;
}

/**
 * Ask. Raises Problem; an AbortError where `signal` says that nobody waits any more.
 * @param {string} path
 * @param {{query?: URLSearchParams | Record<string, any>, method?: string, body?: any, headers?: Record<string, string>,
 *   signal?: AbortSignal, deadline_s?: number}} [how]  a plain object as `body` goes as JSON
 * @returns {Promise<Response>}
 */
export async function ask(path, { query, method, body, headers = {}, signal, deadline_s = DEADLINE_S } = {}) {
  const late = AbortSignal.timeout(deadline_s * 1000);
  const plain = body !== undefined && Object.getPrototypeOf(body) === Object.prototype;
  /** @type {Record<string, string>} */
  const sent = { ...headers };
  if (token) sent.Authorization = `Bearer ${token}`;
  if (plain) sent["Content-Type"] = "application/json";
  let answer;
  try {
    answer = await fetch(address(path, query), {
      method: method ?? (body === undefined ? "GET" : "POST"),
      body: plain ? JSON.stringify(body) : body,
      headers: sent,
      signal: signal ? either(signal, late) : late,
      credentials: "omit",
    });
  } catch (error) {
    if (signal?.aborted) throw error;
    throw late.aborted ? new Problem(0, {}, `no answer within ${deadline_s} s`) : unreached();
  }
  if (!answer.ok) throw await refused(answer);
  return answer;
}

/** The same for an answer in JSON. @param {string} path @param {Parameters<typeof ask>[1]} [how] @returns {Promise<any>} */
export async function askJson(path, how) {
  const answer = await ask(path, how);
  try {
    return await answer.json();
  } catch (error) {
    if (how?.signal?.aborted) throw error;
    throw unreached(); // the connection ended within the answer
  }
}

function unreached() {
  return Object.assign(new Problem(0, {}, "the service cannot be reached"), { unreachable: true });
}

/**
 * Send a form, and hear how much of it is sent, which `fetch` does not tell. Raises Problem; an AbortError at `signal`.
 * @param {string} path
 * @param {FormData} form
 * @param {{signal: AbortSignal, sent: (share: number) => void}} how  sent: of one, which is when the service works on it
 * @returns {Promise<any>} the answer's JSON
 */
export function sendForm(path, form, { signal, sent }) {
  const request = new XMLHttpRequest();
  request.open("POST", address(path));
  if (token) request.setRequestHeader("Authorization", `Bearer ${token}`);
  request.upload.addEventListener("progress", ({ loaded, total }) => sent(total ? Math.min(0.999, loaded / total) : 0));
  request.upload.addEventListener("load", () => sent(1));
  return new Promise((answered, failed) => {
    signal.addEventListener("abort", () => request.abort(), { once: true });
    request.addEventListener("abort", () => failed(new DOMException("nobody waits", "AbortError")));
    request.addEventListener("error", () => failed(new Problem(0, {}, "the service cannot be reached or ended the connection, or the file has changed since it was chosen")));
    request.addEventListener("load", () => {
      const { status } = request;
      if (status >= 200 && status < 300) answered(JSON.parse(request.responseText));
      else failed(problem(status, parsed(request.responseText), request.getResponseHeader("Retry-After")));
    });
    request.send(form);
  });
}

/** @param {Response} answer */
async function refused(answer) {
  return problem(answer.status, parsed(await answer.text().catch(() => "")), answer.headers.get("Retry-After"));
}

/** @param {number} status @param {any} document @param {string | null} wait */
function problem(status, document, wait) {
  if (status === 401) watchers.forEach((heard) => heard(true));
  return new Problem(status, document, "", Number(wait) || 0);
}

/** @param {string} text */
function parsed(text) {
  try {
    return JSON.parse(text);
  } catch {
    return {};
  }
}

/** @param {AbortSignal} one @param {AbortSignal} other */
function either(one, other) {
  if ("any" in AbortSignal) return AbortSignal.any([one, other]);
  const both = new AbortController();
  for (const each of [one, other]) each.addEventListener("abort", () => both.abort(each.reason), { once: true });
  if (one.aborted) both.abort(one.reason);
  return both.signal;
}

/**
 * Questions of which only the newest counts, as while a slider moves: one is under way, the newest of the others waits,
 * and whatever takes long while a newer one waits is given up.
 * @template Question, Answer
 */
export class Newest {
  /**
   * @param {(question: Question, signal: AbortSignal) => Promise<Answer>} asked
   * @param {(answer: Answer, question: Question) => void} answered
   * @param {(problem: Problem, question: Question) => void} failed
   */
  constructor(asked, answered, failed) {
    this.asked = asked;
    this.answered = answered;
    this.failed = failed;
    /** @type {Question | undefined} */
    this.next = undefined;
    /** @type {AbortController | undefined} */
    this.running = undefined;
    this.began = 0;
    this.timer = 0;
  }

  /** @param {Question} question */
  ask(question) {
    this.next = question;
    if (!this.running) void this.#turn();
    else if (!this.timer) {
      const left = Math.max(0, PATIENCE_MS - (performance.now() - this.began));
      this.timer = setTimeout(() => this.running?.abort(), left);
    }
  }

  /** Nobody wants an answer to what was asked so far. */
  drop() {
    this.next = undefined;
    this.running?.abort();
  }

  /** Nobody wants an answer any more. */
  end() {
    this.next = undefined;
    this.answered = this.failed = () => {};
    this.running?.abort();
  }

  async #turn() {
    const question = /** @type {Question} */ (this.next);
    this.next = undefined;
    this.running = new AbortController();
    this.began = performance.now();
    const { signal } = this.running;
    try {
      const answer = await this.asked(question, signal);
      if (!signal.aborted) this.answered(answer, question);
    } catch (error) {
      if (signal.aborted) return;
      if (!(error instanceof Problem)) throw error;
      this.failed(error, question);
    } finally {
      clearTimeout(this.timer);
      this.timer = 0;
      this.running = undefined;
      if (this.next !== undefined) void this.#turn();
    }
  }
}

/**
 * A link's target fetched with the token, for what a plain link cannot reach.
 * @param {string} href @param {string} name  of the file
 */
export async function download(href, name) {
  const answer = await ask(href);
  save(await answer.blob(), name);
}

/** Save what was fetched. @param {Blob} blob @param {string} name  of the file */
export function save(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}
