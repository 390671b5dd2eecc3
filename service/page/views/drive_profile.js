// @ts-check
// An elevation profile from a file or pasted text: two columns, distance and elevation in metres. Read in the browser;
// nothing is sent but the places.

const MOST_BYTES = 2_000_000;
const MOST_PLACES = 10_000; // as many as the service takes
const UNITS = /\b(km|cm|mm|ft|feet|deg|degrees)\b/i;

/**
 * Places of a profile. Raises Error with words for people, naming the line.
 * @param {string} text
 * @returns {{track: import("./drive_ground.js").Track, notes: string[]}}
 */
export function profileOf(text) {
  if (text.length > MOST_BYTES) throw new Error(`The profile has ${(text.length / 1e6).toFixed(1)} MB; ${MOST_BYTES / 1e6} MB are allowed.`);
  const lines = text.replace(/^\uFEFF/, "").split(/\r\n|\r|\n/);
  const notes = [];
  /** @type {number[]} */
  const x = [];
  /** @type {number[]} */
  const y = [];
  let headed = false;
  for (const [row, line] of lines.entries()) {
    const said = line.trim();
    if (!said || said.startsWith("#")) continue;
    const cells = cellsOf(said);
    const numbers = cells.map(numberOf);
    if (!x.length && !headed && numbers.every(Number.isNaN) && cells.length >= 2) {
      headed = true; // a heading
      require(!UNITS.test(said.replace(/[_()[\]]/g, " ")), `Line ${row + 1}: the heading “${short(said)}” names a unit other than metres. Distance and elevation must be in metres.`);
      continue;
    }
    require(cells.length === 2, `Line ${row + 1} has ${cells.length} column${cells.length === 1 ? "" : "s"}; two are needed: distance and elevation in metres.`);
    const wrong = numbers.findIndex(Number.isNaN);
    require(wrong < 0, `Line ${row + 1}: “${short(cells[wrong] ?? "")}” is no number.`);
    require(!x.length || numbers[0] > x[x.length - 1], `Line ${row + 1}: distance ${numbers[0]} does not rise; the one before is ${x[x.length - 1]}.`);
    x.push(numbers[0]);
    y.push(numbers[1]);
    require(x.length <= MOST_PLACES, `The profile has more than ${MOST_PLACES.toLocaleString("en")} places.`);
  }
  require(x.length >= 2, x.length ? "The profile has one place; two or more are needed." : "The profile has no places: two columns are needed, distance and elevation in metres.");
  if (x[0] > 0 || x[x.length - 1] <= 0) {
    notes.push(`Distances were moved by ${-x[0]} m: the rover starts at distance 0.`);
    const first = x[0];
    for (const [row, each] of x.entries()) x[row] = Number((each - first).toPrecision(12));
  }
  return { track: { kind: "elevations", x, y }, notes };
}

/** Cells of a line: by tab or semicolon, by comma, or by spaces. A comma between digits beside a semicolon is a decimal one. @param {string} line */
function cellsOf(line) {
  if (line.includes(";")) return line.split(";").map((each) => each.trim().replace(/^(-?\d+),(\d+)$/, "$1.$2"));
  if (line.includes("\t")) return line.split("\t").map((each) => each.trim().replace(/^(-?\d+),(\d+)$/, "$1.$2"));
  return line.includes(",") ? line.split(",").map((each) => each.trim()) : line.split(/\s+/);
}

/** @param {string} cell */
function numberOf(cell) {
  return /^[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$/i.test(cell) && Number.isFinite(Number(cell)) ? Number(cell) : NaN;
}

/** @param {string} text */
function short(text) {
  return text.length > 30 ? `${text.slice(0, 30)}…` : text;
}

/** @param {boolean} holds @param {string} words */
function require(holds, words) {
  if (!holds) throw new Error(words);
}

/** The text of a file that was chosen. Raises Error. @param {File} file */
export async function textOf(file) {
  require(file.size <= MOST_BYTES, `“${short(file.name)}” has ${(file.size / 1e6).toFixed(1)} MB; ${MOST_BYTES / 1e6} MB are allowed.`);
  const bytes = new Uint8Array(await file.arrayBuffer());
  require(!bytes.includes(0), `“${short(file.name)}” is no text.`);
  return new TextDecoder().decode(bytes);
}
