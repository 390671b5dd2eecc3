// @ts-check
// Where the rover of an answer is at a time: the answer's own points, linear between them.

import { after, between } from "./drive_ground.js";

/** As in service/physics/parameters.py; the tests compare them. */
export const VIPER = { wheelbase: 1.2836, radius: 0.25 };

/**
 * @typedef {{x: number, rear: [number, number], front: [number, number], pitch: number}} Pose  metres; rad, nose up
 * @typedef {Pose & {time: number, speed: number, slip: number, slope: number, torque: number, brake: boolean, turned: [number, number] | null,
 *   band: [number, number] | null, prior: Pose | null}} Moment
 */

export class Motion {
  /** @param {any} answer @param {any} prior  the prior's own answer; null: there is none @param {import("./drive_ground.js").Ground} ground */
  constructor(answer, prior, ground) {
    const { trajectory, band = null } = answer;
    Object.assign(this, { answer, band, ground });
    this.times = /** @type {number[]} */ (trajectory.time_s);
    this.columns = trajectory;
    this.duration = this.times[this.times.length - 1];
    this.prior = prior && { times: prior.trajectory.time_s, x: prior.prior.x_m, y: prior.prior.y_m };
    this.turns = ["rear_wheel_speed_rad_s", "front_wheel_speed_rad_s"].map((name) => trajectory[name] && this.#turned(trajectory[name]));
  }

  /** How far a wheel has turned at each time, rad. @param {number[]} speeds */
  #turned(speeds) {
    const angles = [0];
    for (let row = 1; row < speeds.length; row++) {
      angles.push(angles[row - 1] + 0.5 * (speeds[row] + speeds[row - 1]) * (this.times[row] - this.times[row - 1]));
    }
    return angles;
  }

  /** @param {string} name @param {number} time */
  value(name, time) {
    return between(this.times, this.columns[name], time);
  }

  /** @param {number} distance @param {number} height @returns {Pose} */
  pose(distance, height) {
    const rear = this.ground.at(distance, height);
    const front = this.ground.at(distance + VIPER.wheelbase, height);
    return { x: distance, rear, front, pitch: Math.atan2(front[1] - rear[1], front[0] - rear[0]) };
  }

  /** @param {number} time @returns {Moment} */
  at(time) {
    const row = Math.max(0, after(this.times, time) - 1);
    const [rear, front] = this.turns;
    const { prior, band } = this;
    const height = this.value("y_m", time);
    return {
      ...this.pose(this.value("x_m", time), height),
      time,
      speed: this.value("speed_m_s", time),
      slip: this.value("slip_ratio", time),
      slope: this.value("slope_deg", time),
      torque: this.columns.torque_nm[row],
      brake: this.columns.brake[row],
      turned: rear && front ? [between(this.times, rear, time), between(this.times, front, time)] : null,
      band: band && [between(this.times, band.x_lower_m, time), between(this.times, band.x_upper_m, time)],
      prior: prior && this.pose(between(prior.times, prior.x, time), between(prior.times, prior.y, time)),
    };
  }
}
