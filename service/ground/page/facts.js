// The tiles: one fact each, with what one has to know of it in small below.

import { DASH, age, fixed, isNumber, rate, say } from "./words.js";

const TILES = [
  ["Altitude", (s) => [fixed(s.altitude_m, 1, "m"), isNumber(s.height_m) ? `${fixed(s.height_m, 1)} m above ground` : "no rangefinder height"]],
  ["Speed", (s) => [fixed(s.speed_mps, 1, "m/s"), isNumber(s.margin_m) ? `margin ${fixed(s.margin_m, 1)} m advised` : "over ground"]],
  ["Mode", (s) => [s.link_connected ? (s.mode ?? DASH) : "no link", s.link_connected ? `${s.autopilot ?? "autopilot"}${s.armed === null ? "" : s.armed ? ", armed" : ", disarmed"}` : "autopilot not heard"]],
  ["Scale", scale],
  ["Latency", latency],
  ["Link", link],
  ["Vision", (s) => [`${fixed(s.frames_per_s, 1)} /s`, [`camera ${s.camera}`, ...(s.extra_cameras ?? []).map(extra)].join(", ")]],
  ["MAVLink", mavlink],
];

function extra(camera) {
  if (camera.trouble !== null) return `${camera.name} OFF`;
  const late = isNumber(camera.latency_ms_p95) ? ` ${fixed(camera.latency_ms_p95, 0)} ms` : "";
  return `${camera.name} ${fixed(camera.frames_per_s, 1)} /s${late}`;
}

function scale(s) {
  if (!isNumber(s.scale_factor)) return ["none", "no metres"];
  const sources = (s.scale_sources ?? []).join(" + ");
  const since = isNumber(s.scale_age_s) ? (s.scale_age_s < 0.5 ? "now" : `${age(s.scale_age_s * 1000)} ago`) : "";
  const sigma = isNumber(s.scale_relative_sigma) ? `±${Math.ceil(s.scale_relative_sigma * 100)} %` : "±?";
  return [sigma, `×${fixed(s.scale_factor, 2)}, ${sources ? `${sources}, ` : ""}${since}`];
}

function latency(s) {
  if (!isNumber(s.latency_ms_p50)) return [DASH, "capture to autopilot"];
  const delay = isNumber(s.cp_delay_s) ? `, CP_DELAY\u00a0${fixed(s.cp_delay_s, 2)}` : "";
  return [`${fixed(s.latency_ms_p50, 0)} ms`, `95 %: ${fixed(s.latency_ms_p95, 0)} ms${delay}`];
}

function link(s, detail) {
  const counts = detail.samples_per_s ?? {};
  const parts = [`${fixed(counts.scan ?? 0, 0)} scans/s`];
  const pictures = (counts.camera ?? 0) + (counts.depth ?? 0);
  parts.push(`${fixed(pictures, 0)} pictures/s`);
  if (s.stream_profile) parts.push(s.stream_profile);
  return [rate(detail.bytes_per_s), parts.join(", ")];
}

function mavlink(s) {
  const value = isNumber(s.obstacle_rate_hz) ? `${fixed(s.obstacle_rate_hz, 1)} /s` : String(s.obstacle_messages);
  const parts = [isNumber(s.obstacle_rate_hz) ? `${s.obstacle_messages} sent` : "obstacle messages"];
  if (s.link_signed === true) parts.push("signed");
  return [value, parts.join(", ")];
}

export class Facts {
  #tiles = [];

  constructor(list) {
    for (const [title, tell] of TILES) {
      const box = document.createElement("div");
      const term = document.createElement("dt");
      const value = document.createElement("dd");
      const note = document.createElement("dd");
      note.className = "small";
      say(term, title);
      box.append(term, value, note);
      list.append(box);
      this.#tiles.push({ box, value, note, tell });
    }
  }

  /** Show the facts of a status, or dashes where there is none. */
  draw(detail) {
    const status = detail?.status ?? null;
    for (const { box, value, note, tell } of this.#tiles) {
      const [text, small] = status === null ? [DASH, ""] : tell(status, detail);
      say(value, text);
      say(note, small);
      box.title = small;
    }
  }
}
