// What the plots show. Each line: label, colour variable, side of its axis; `of` takes it from a row,
// `spread` its standard deviation.

import { DEGREES, scaled } from "./words.js";

/** Commanded and flown velocity along one axis of the level body frame. */
const velocity = (name, axis, factor, unit) => ({
  title: `Velocity ${name}`, units: [unit], source: "vehicle",
  lines: [
    { label: "commanded", colour: "--b", side: 0, dash: true, of: (row) => scaled(row.setpoint[axis], factor) },
    { label: "flown", colour: "--a", side: 0, of: (row) => scaled(row.flown[axis], factor) },
  ],
});

export const PLOTS = [
  {
    title: "Error", units: ["m", "°"], source: "results",
    lines: [
      { label: "distance", colour: "--a", side: 0, of: (row) => row.error_m, spread: (row) => row.error_spread_m },
      { label: "angle", colour: "--b", side: 1, dash: true, of: (row) => scaled(row.error_rad, DEGREES) },
    ],
  },
  velocity("forward", 0, 1, "m/s"),
  velocity("right", 1, 1, "m/s"),
  velocity("down", 2, 1, "m/s"),
  velocity("yaw", 3, DEGREES, "°/s"),
  {
    title: "Altitude above origin", units: ["m"], source: "vehicle",
    lines: [{ label: "estimated", colour: "--d", side: 0, of: (row) => -row.down_m }],
  },
  {
    title: "Depth", units: ["m"], source: "results",
    lines: [{ label: "median of the scene", colour: "--c", side: 0, of: (row) => row.depth_m }],
  },
  {
    title: "Matching", units: ["%", "px"], source: "results",
    lines: [
      { label: "inliers", colour: "--a", side: 0, of: (row) => scaled(row.inlier_share, 100) },
      { label: "overlap", colour: "--c", side: 0, dash: true, of: (row) => scaled(row.overlap, 100) },
      { label: "residual", colour: "--b", side: 1, of: (row) => row.residual_px },
    ],
  },
  {
    title: "Conditioning", units: [""], log: true, source: "results",
    lines: [{ label: "condition number", colour: "--d", side: 0, of: (row) => row.condition }],
  },
  {
    title: "Latency", units: ["ms"], zero: true, source: "results",
    lines: [{ label: "capture to result", colour: "--b", side: 0, of: (row) => row.delay_ms }],
  },
];
