// @ts-check
// The side view with its player, its readout, and what the colours mean.

import { fill, h, say, shown } from "../dom.js";
import { Player } from "./drive_player.js";
import { LEGEND, Scene } from "./drive_scene.js";
import { EVENTS } from "./drive_words.js";

const READ_MS = 100; // between two changes of the numbers while it plays
/** @type {[string, string][]} */
const READINGS = [["x", "Position"], ["speed", "Speed"], ["slip", "Slip"], ["slope", "Slope"], ["torque", "Motors"]];

export class Stage {
  /** @param {(moment: import("./drive_motion.js").Moment | null, playing: boolean) => void} moved */
  constructor(moved) {
    this.moved = moved;
    this.scene = new Scene();
    this.player = new Player((time, playing) => this.#draw(time, playing));
    this.values = Object.fromEntries(READINGS.map(([name]) => [name, h("dd", { "data-now": name }, "–")]));
    this.legend = h("ul.scene-legend", { "aria-label": "What is drawn" });
    this.ghost = h("p.small.muted.ghost", {});
    this.element = h("div.stack.tight", {}, h("h2.unseen", {}, "Side view"), h("div.scene-room", {}, this.scene.element, this.legend), this.player.element,
      h("dl.now", {}, ...READINGS.map(([name, words]) => h("div", {}, h("dt", {}, words), this.values[name]))), this.ghost);
    this.read = 0;
    this.passed = 0;
    /** @type {any[]} */
    this.events = [];
  }

  destroy() {
    this.player.destroy();
    this.scene.destroy();
  }

  /** @param {import("./drive_motion.js").Motion} motion @param {any} answer */
  show(motion, answer) {
    const outside = answer.domain.stretches.filter((/** @type {any} */ each) => !each.inside);
    this.events = answer.events.map((/** @type {any} */ each) => ({ ...each, words: EVENTS[each.event] ?? each.event }));
    this.scene.show(motion, { events: this.events, outside, until: answer.drive.until_distance_m });
    const entry = (/** @type {keyof typeof LEGEND} */ name, /** @type {string} */ words) => {
      const mark = h("span.swatch", {});
      mark.style.setProperty("--swatch", LEGEND[name]);
      return h("li", {}, mark, words);
    };
    fill(this.legend, answer.band && entry("band", `${Math.round(answer.band.level * 100)} % band`), motion.prior && entry("prior", "Prior alone"), outside.length > 0 && entry("outside", "Outside what was validated"));
    this.ghost.textContent = motion.prior ? "The ghost is the prior: the closed-form solution for this slope and torque, without what was learned."
      : "No ghost: the service has a prior for one slope and one torque from rest, not for a drive whose slope, torque or brake change.";
    this.player.load(motion.duration);
  }

  /** @param {number} time_s */
  seek(time_s) {
    this.player.pause();
    this.player.seek(time_s);
    this.element.scrollIntoView({ block: "nearest" });
  }

  /** @param {number} time @param {boolean} playing */
  #draw(time, playing) {
    const moment = this.scene.draw(time, playing);
    if (!moment) return;
    this.moved(moment, playing);
    const now = performance.now();
    if (playing) this.#announce(time);
    else this.passed = time;
    if (playing && now - this.read < READ_MS) return;
    this.read = now;
    const { values } = this;
    values.x.textContent = `${shown(moment.x, 2)} m`;
    values.speed.textContent = `${shown(moment.speed, 2)} m/s`;
    values.slip.textContent = shown(moment.slip, 2);
    values.slope.textContent = `${shown(moment.slope, 1)}°`;
    values.torque.textContent = moment.brake ? "Brake" : moment.torque === 0 ? "Off" : `${shown(moment.torque, 0)} N m`;
  }

  /** Events that were passed since the last picture. @param {number} time */
  #announce(time) {
    const news = this.events.filter(({ time_s }) => time_s > this.passed && time_s <= time);
    this.passed = time;
    if (news.length) say(news.map(({ words, time_s }) => `${words} at ${shown(time_s, 1)} s`).join(", "));
  }
}
