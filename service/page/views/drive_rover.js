// @ts-check
// VIPER in simple shapes, seen from its right side. Metres, from the rear wheel's centre, ahead and up.

import { VIPER } from "./drive_motion.js";

const SPOKES = 8;
const GROUSERS = 24;
const BODY = [[-0.16, 0.26], [1.44, 0.26], [1.5, 0.5], [1.44, 1.02], [-0.12, 1.02], [-0.2, 0.62]];
const PANEL = [[0.0, 0.42], [1.16, 0.42], [1.16, 0.94], [0.0, 0.94]];
const COLORS = { body: "#d9c9a3", edge: "#f6ecd2", shade: "#8d7f60", panel: "#24406b", cell: "#3f659c", metal: "#9aa4b1", dark: "#3a414b", tyre: "#c3cad2", hub: "#6f7986",
  glass: "#9fd4ff", lamp: "#ff5a5a" };

/** @typedef {CanvasRenderingContext2D} Pen */

/**
 * Draw it. The pen stands at the rear wheel's centre, one metre is one unit, up is positive.
 * @param {Pen} pen
 * @param {{turned: [number, number] | null, brake: boolean, driven: boolean}} how  turned: of rear and front wheels, rad
 */
export function drawRover(pen, { turned, brake, driven }) {
  const { wheelbase } = VIPER;
  // the mast, with cameras and lights
  pen.lineCap = "round";
  stroke(pen, COLORS.metal, 0.06, [[1.22, 1.0], [1.22, 1.92]]);
  stroke(pen, COLORS.shade, 0.03, [[1.22, 1.5], [1.06, 1.02]]);
  shape(pen, [[1.06, 1.9], [1.4, 1.9], [1.4, 2.1], [1.06, 2.1]], COLORS.body, COLORS.edge);
  disc(pen, 1.37, 2.0, 0.055, COLORS.glass);
  // the antenna
  stroke(pen, COLORS.metal, 0.035, [[0.12, 1.0], [0.12, 1.5]]);
  pen.beginPath();
  pen.ellipse(0.12, 1.56, 0.2, 0.07, 0.5, 0, 2 * Math.PI);
  pen.fillStyle = COLORS.metal;
  pen.fill();
  // legs to both wheels, then the body in front of them
  for (const axle of [0, wheelbase]) stroke(pen, COLORS.dark, 0.085, [[axle, 0], [axle + (axle ? -0.2 : 0.2), 0.44]]);
  shape(pen, BODY, COLORS.body, COLORS.edge);
  shape(pen, PANEL, COLORS.panel, COLORS.cell);
  for (let cell = 1; cell < 6; cell++) stroke(pen, COLORS.cell, 0.012, [[(cell * 1.16) / 6, 0.42], [(cell * 1.16) / 6, 0.94]]);
  stroke(pen, COLORS.cell, 0.012, [[0, 0.68], [1.16, 0.68]]);
  shape(pen, [[1.24, 0.5], [1.42, 0.5], [1.42, 0.9], [1.24, 0.9]], COLORS.shade, COLORS.shade);
  disc(pen, -0.13, 0.86, 0.045, brake ? COLORS.lamp : COLORS.dark);
  disc(pen, 1.33, 0.8, 0.04, driven ? "#7fe0a8" : COLORS.dark);
  for (const [wheel, axle] of [0, wheelbase].entries()) drawWheel(pen, axle, turned?.[wheel] ?? null);
}

/** A wheel; without knowing how it turns it has no spokes. @param {Pen} pen @param {number} axle @param {number | null} turned */
function drawWheel(pen, axle, turned) {
  const { radius } = VIPER;
  pen.save();
  pen.translate(axle, 0);
  disc(pen, 0, 0, radius - 0.015, "#262c34");
  ring(pen, radius - 0.02, 0.04, COLORS.tyre);
  if (turned !== null) {
    pen.rotate(-turned); // forwards is clockwise
    pen.beginPath();
    for (let spoke = 0; spoke < SPOKES; spoke++) {
      const angle = (2 * Math.PI * spoke) / SPOKES;
      pen.moveTo(0.05 * Math.cos(angle), 0.05 * Math.sin(angle));
      pen.lineTo((radius - 0.04) * Math.cos(angle), (radius - 0.04) * Math.sin(angle));
    }
    pen.lineWidth = 0.022;
    pen.strokeStyle = COLORS.metal;
    pen.stroke();
    pen.beginPath();
    for (let grouser = 0; grouser < GROUSERS; grouser++) {
      const angle = (2 * Math.PI * grouser) / GROUSERS;
      pen.moveTo((radius - 0.035) * Math.cos(angle), (radius - 0.035) * Math.sin(angle));
      pen.lineTo((radius + 0.012) * Math.cos(angle), (radius + 0.012) * Math.sin(angle));
    }
    pen.lineWidth = 0.02;
    pen.strokeStyle = COLORS.tyre;
    pen.stroke();
    stroke(pen, "#e8ab55", 0.04, [[0.09, 0], [radius - 0.05, 0]]); // one spoke is marked, to see it turn
  }
  disc(pen, 0, 0, 0.06, COLORS.hub);
  pen.restore();
}

/** Only its outline, for a ghost. @param {Pen} pen @param {string} color @param {number} line  width, m */
export function drawGhost(pen, color, line) {
  pen.strokeStyle = color;
  pen.fillStyle = color;
  pen.lineWidth = line;
  pen.setLineDash([4 * line, 3 * line]);
  for (const axle of [0, VIPER.wheelbase]) {
    pen.beginPath();
    pen.arc(axle, 0, VIPER.radius, 0, 2 * Math.PI);
    pen.stroke();
  }
  for (const points of [BODY, [[1.06, 1.9], [1.4, 1.9], [1.4, 2.1], [1.06, 2.1]]]) {
    path(pen, points);
    pen.globalAlpha = 0.16;
    pen.fill();
    pen.globalAlpha = 1;
    pen.stroke();
  }
  pen.beginPath();
  pen.moveTo(1.22, 1.02);
  pen.lineTo(1.22, 1.9);
  pen.stroke();
  pen.setLineDash([]);
}

/** @param {Pen} pen @param {number[][]} points */
function path(pen, points) {
  pen.beginPath();
  for (const [x, y] of points) pen.lineTo(x, y);
  pen.closePath();
}

/** @param {Pen} pen @param {number[][]} points @param {string} inside @param {string} edge */
function shape(pen, points, inside, edge) {
  path(pen, points);
  pen.fillStyle = inside;
  pen.fill();
  pen.lineWidth = 0.018;
  pen.strokeStyle = edge;
  pen.stroke();
}

/** @param {Pen} pen @param {string} color @param {number} width @param {number[][]} points */
function stroke(pen, color, width, points) {
  pen.beginPath();
  for (const [x, y] of points) pen.lineTo(x, y);
  pen.lineWidth = width;
  pen.strokeStyle = color;
  pen.stroke();
}

/** @param {Pen} pen @param {number} x @param {number} y @param {number} radius @param {string} color */
function disc(pen, x, y, radius, color) {
  pen.beginPath();
  pen.arc(x, y, radius, 0, 2 * Math.PI);
  pen.fillStyle = color;
  pen.fill();
}

/** @param {Pen} pen @param {number} radius @param {number} width @param {string} color */
function ring(pen, radius, width, color) {
  pen.beginPath();
  pen.arc(0, 0, radius, 0, 2 * Math.PI);
  pen.lineWidth = width;
  pen.strokeStyle = color;
  pen.stroke();
}
