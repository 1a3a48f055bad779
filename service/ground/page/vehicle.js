// The selected vehicle: state, nearest distance, radar, pictures, history and facts.

import { Facts } from "./facts.js";
import { Picture, drawScale } from "./pictures.js";
import { History } from "./plot.js";
import { Radar } from "./radar.js";
import {
  CLEAR,
  DASH,
  FRESHNESS_WORDS,
  OBSTACLE,
  UNKNOWN,
  age,
  bearing,
  freshness,
  isNumber,
  mark,
  metres,
  say,
} from "./words.js";

const byId = (id) => document.getElementById(id);
const SERVICE_WORDS = { BOOT: "starting", STANDBY: "standby", ACTIVE: "active", CRITICAL: "CRITICAL" };

export class VehiclePanel {
  #detail = null;
  #bornMs = null;
  #statusBornMs = null;
  #radar = new Radar(byId("radar"));
  #history = new History(byId("history"));
  #camera = new Picture(byId("camera-figure"), byId("camera"), false);
  #depth = new Picture(byId("depth-figure"), byId("depth"), true);
  #facts = new Facts(byId("facts"));
  #span = { nearM: 0, farM: 0 };
  #spoken = "";
  #name = null;

  /** Another vehicle. */
  select(name) {
    this.#name = name;
    this.#detail = null;
    this.#bornMs = this.#statusBornMs = null;
    this.#radar.reset();
    this.#history.reset();
    this.#camera.clear();
    this.#depth.clear();
    this.#spoken = "";
  }

  /** Take scan and status; `bornOf(ageMs)` is the moment on this browser's clock. */
  hearDetail(detail, bornOf) {
    if (detail === null) return;
    this.#detail = detail;
    this.#bornMs = isNumber(detail.age_ms) ? bornOf(detail.age_ms) : null;
    this.#statusBornMs = isNumber(detail.status_age_ms) ? bornOf(detail.status_age_ms) : null;
    if (this.#bornMs !== null) this.#history.add(this.#bornMs, detail.verdict, detail.nearest_cm);
  }

  /** Take the history. */
  hearHistory(document, bornOf) {
    this.#history.load(document, bornOf);
  }

  /** Take a picture; resolves when it is shown. */
  async hearPicture(frame, isDepth, bornMs, isWanted) {
    if (frame.payload.length === 0) return;
    await (isDepth ? this.#depth : this.#camera).show(frame.payload, bornMs, isWanted);
    if (isDepth) this.#span = { nearM: frame.nearM, farM: frame.farM };
  }

  /** Draw everything as of now. */
  draw(nowMs, limits) {
    const ageMs = this.#bornMs === null ? null : nowMs - this.#bornMs;
    const state = freshness(ageMs, limits);
    const detail = this.#detail;
    const scan = state === "none" || detail === null ? null : detail.scan;
    const hasStatus = this.#statusBornMs !== null && nowMs - this.#statusBornMs <= limits.noDataMs;
    const status = hasStatus ? detail.status : null;
    const margin = isNumber(status?.margin_m) ? status.margin_m : null;

    mark(byId("vehicle"), "freshness", this.#name === null ? "none" : state);
    say(byId("name"), this.#name ?? "No vehicle");
    this.#drawState(state, ageMs, scan, status);
    this.#drawNearest(state, ageMs, scan);
    this.#radar.draw(scan, margin);
    this.#history.draw(nowMs, detail?.scan?.max_m ?? 20, margin);
    const least = this.#history.least(nowMs);
    say(byId("least"), least === null ? "" : `least ${metres(least)} m`);
    drawPicture(this.#camera, nowMs, limits, this.#reason(status, false));
    drawPicture(this.#depth, nowMs, limits, this.#reason(status, true));
    const camera = detail?.camera;
    const perSecond = detail?.samples_per_s?.camera ?? 0;
    const isShown = this.#camera.bornMs !== null && isNumber(camera?.width);
    say(byId("camera-words"), isShown ? `${camera.width} × ${camera.height}, ${perSecond.toFixed(1)} /s` : "");
    drawScale(byId("scale"), this.#span.nearM, this.#span.farM);
    this.#facts.draw(status === null ? null : detail);
  }

  #drawState(state, ageMs, scan, status) {
    const pill = byId("freshness");
    mark(pill, "state", state);
    say(pill.querySelector("b"), FRESHNESS_WORDS[state]);
    say(pill.querySelector("span"), age(ageMs));
    const armed = byId("armed");
    armed.hidden = status === null || status.armed === null;
    mark(armed, "armed", String(status?.armed === true));
    say(armed, status?.armed ? "armed" : "disarmed");
    const recording = byId("recording");
    recording.hidden = status === null || status.recording === null;
    mark(recording, "on", String(status?.recording === true));
    say(recording.querySelector("span"), status?.recording ? "REC" : "not recording");
    const service = byId("service");
    service.hidden = status === null;
    mark(service, "state", status?.state ?? "");
    say(service, status === null ? "" : (SERVICE_WORDS[status.state] ?? status.state));
    const notes = [];
    if (this.#detail?.twins) notes.push("two vehicles seem to use this name");
    if (this.#detail !== null && !this.#detail.alive) notes.push("its session is gone");
    if (scan !== null && !scan.trusted) notes.push(`no distances: ${scan.trouble ?? "not trusted"}`);
    else if (status?.trouble) notes.push(status.trouble);
    for (const extra of status?.extra_cameras ?? []) {
      if (extra.trouble !== null) notes.push(`camera ${extra.name} OFF: ${extra.trouble}`);
      if (extra.camera_detail) notes.push(extra.camera_detail);
    }
    for (const words of [
      status?.link_detail,
      status?.camera_detail,
      status?.recording_detail,
      status?.scale_suspicion,
    ]) {
      if (words) notes.push(words);
    }
    const trouble = byId("trouble");
    trouble.hidden = notes.length === 0;
    say(trouble, notes.join(" · "));
    trouble.title = trouble.textContent;
  }

  #drawNearest(state, ageMs, scan) {
    const { number, unit, words, verdict } = nearestWords(state, ageMs, scan, this.#detail, this.#name);
    const box = byId("nearest").parentElement;
    mark(box, "verdict", String(verdict));
    mark(box, "near", String(verdict === OBSTACLE && this.#detail.nearest_cm < scan.max_m * 25));
    const element = byId("nearest");
    if (element.dataset.text !== number + unit) {
      element.dataset.text = number + unit;
      element.replaceChildren(number);
      if (unit) {
        const small = document.createElement("small");
        small.textContent = ` ${unit}`;
        element.append(small);
      }
    }
    say(byId("nearest-words"), words);
    byId("radar").setAttribute("aria-label", `Sector radar: ${number} ${unit} ${words}`);
    this.#speak(state, verdict);
  }

  /** Tell a screen reader when the state changes, not at every scan. */
  #speak(state, verdict) {
    if (this.#name === null) return;
    const near = verdict === OBSTACLE ? Math.floor(this.#detail.nearest_cm / 200) : -1;
    const key = `${this.#name} ${state} ${verdict} ${near}`;
    if (key === this.#spoken) return;
    this.#spoken = key;
    const words = `${this.#name}: ${FRESHNESS_WORDS[state]}. ${byId("nearest").textContent} ${byId("nearest-words").textContent}`;
    say(byId(state === "live" ? "live" : "alarm"), words);
  }

  #reason(status, isDepth) {
    if (status?.stream_profile === "scan-only") return "the vehicle sends scans only";
    if (isDepth && status !== null && !isNumber(status.scale_factor)) return "no depth without a scale";
    return "no picture";
  }
}

function nearestWords(state, ageMs, scan, detail, name) {
  if (name === null) return { number: DASH, unit: "", words: "choose a vehicle", verdict: UNKNOWN };
  if (state === "none") {
    const since = ageMs === null ? "nothing heard yet" : `last heard ${age(ageMs)} ago`;
    return { number: "no data", unit: "", words: since, verdict: UNKNOWN };
  }
  const old = state === "stale" ? `STALE, ${age(ageMs)} old: ` : "";
  if (detail.verdict === OBSTACLE) {
    const words = `${old}${bearing(detail.bearing_deg)}`;
    return { number: metres(detail.nearest_cm), unit: "m", words, verdict: OBSTACLE };
  }
  if (detail.verdict === CLEAR) {
    const words = `${old}nothing nearer where it sees (${seenDegrees(scan)}° of 360°)`;
    return { number: `> ${Math.floor(scan.max_m)}`, unit: "m", words, verdict: CLEAR };
  }
  const words = `${old}${scan.trouble ?? "nothing is known in any direction"}`;
  return { number: "unknown", unit: "", words, verdict: UNKNOWN };
}

function seenDegrees(scan) {
  const known = [...scan.state].filter((digit) => Number(digit) !== UNKNOWN).length;
  return Math.round(known * scan.step_deg);
}

function drawPicture(picture, nowMs, limits, reason) {
  const ageMs = picture.bornMs === null ? null : nowMs - picture.bornMs;
  const state = freshness(ageMs, limits);
  mark(picture.figure, "freshness", state);
  say(picture.figure.querySelector(".age"), state === "none" ? "" : `${FRESHNESS_WORDS[state]} ${age(ageMs)}`);
  say(picture.figure.querySelector(".cover"), ageMs === null ? reason : `no data for ${age(ageMs)}`);
}
