// The page put together: frames come in, the newest is kept, and the screen is drawn ten times a second.

import { noteResize } from "./canvas.js";
import { ServerClock } from "./clock.js";
import { Connection } from "./connection.js";
import { FleetList } from "./fleet.js";
import { KIND, readFrame, readJson } from "./frames.js";
import { logIn } from "./login.js";
import { followTheme } from "./theme.js";
import { VehiclePanel } from "./vehicle.js";
import { isNumber, mark, say } from "./words.js";

const IDLE_DRAW_MS = 100; // ages move on though nothing comes
const LEAST_DRAW_MS = 30; // a browser that is slow at drawing shall have time for what comes in

const byId = (id) => document.getElementById(id);
const clock = new ServerClock();
const panel = new VehiclePanel();
const list = new FleetList(byId("vehicles"), (name) => select(name));
const limits = { staleMs: 1000, noDataMs: 3000 };

let selected = new URLSearchParams(location.hash.slice(1)).get("vehicle");
let selection = 0;
let station = { state: "wait", words: "connecting", zenoh: null };
let needsDrawing = true;

const connection = new Connection({
  onFrame: hear,
  onState: (state, words) => {
    station = { ...station, state, words };
    needsDrawing = true;
  },
  onToken: start,
});

function select(name) {
  selected = name;
  history.replaceState(null, "", `#${new URLSearchParams({ vehicle: name })}`);
  panel.select(name);
  list.select(name);
  watch();
  needsDrawing = true;
}

function watch() {
  selection = (selection + 1) % 65536;
  connection.watch({ watch: selected, selection, pictures: !document.hidden });
}

async function hear(buffer) {
  const frame = readFrame(buffer);
  clock.hear(frame.serverMs, performance.now());
  const bornOf = (ageMs) => clock.born(frame.serverMs, ageMs);
  if (frame.kind === KIND.FLEET) {
    hearFleet(readJson(frame), bornOf);
  } else if (frame.selection === selection) {
    const isWanted = () => frame.selection === selection;
    if (frame.kind === KIND.DETAIL) panel.hearDetail(readJson(frame), bornOf);
    else if (frame.kind === KIND.HISTORY) panel.hearHistory(readJson(frame), bornOf);
    else if (frame.kind === KIND.CAMERA) await panel.hearPicture(frame, false, bornOf(frame.ageMs), isWanted);
    else if (frame.kind === KIND.DEPTH) await panel.hearPicture(frame, true, bornOf(frame.ageMs), isWanted);
  }
  needsDrawing = true;
}

function hearFleet(document, bornOf) {
  limits.staleMs = document.stale_ms;
  limits.noDataMs = document.no_data_ms;
  station = { ...station, zenoh: document.zenoh };
  const born = (ageMs) => (isNumber(ageMs) ? bornOf(ageMs) : null);
  list.update(
    document.vehicles.map((vehicle) => ({
      ...vehicle,
      bornMs: born(vehicle.age_ms),
      statusBornMs: born(vehicle.status_age_ms),
    })),
  );
  say(byId("vehicle-count"), document.vehicles.length > 0 ? String(document.vehicles.length) : "");
  byId("no-vehicles").hidden = document.vehicles.length > 0;
  const bad = byId("bad");
  bad.hidden = document.bad_samples === 0;
  say(bad, `${document.bad_samples} samples not understood`);
  bad.title = document.last_bad;
  if (selected === null && document.vehicles.length > 0) {
    const isLive = (vehicle) => isNumber(vehicle.age_ms) && vehicle.age_ms <= limits.staleMs;
    select((document.vehicles.find(isLive) ?? document.vehicles[0]).name);
  }
}

function drawStation() {
  const element = byId("station");
  const peers = station.zenoh?.peers ?? 0;
  const places = (station.zenoh?.endpoints ?? []).join(", ");
  let [state, words] = ["open", `${peers} ${peers === 1 ? "link" : "links"} at ${places}`];
  if (station.state !== "open") [state, words] = [station.state, station.words];
  else if (station.zenoh === null) [state, words] = ["wait", "connecting"];
  else if (peers === 0) [state, words] = ["lost", `no vehicle or router at ${places}, tried again`];
  mark(element, "state", state);
  say(element.querySelector("span"), words);
  element.title = words;
}

function draw(nowMs) {
  needsDrawing = false;
  drawStation();
  list.draw(nowMs, limits);
  panel.draw(nowMs, limits);
}

let drawnMs = -Infinity;

function animate() {
  const nowMs = performance.now();
  if (needsDrawing && nowMs - drawnMs >= LEAST_DRAW_MS) {
    draw(nowMs);
    drawnMs = performance.now();
  }
  requestAnimationFrame(animate);
}

async function start() {
  await logIn();
  connection.open();
}

document.addEventListener("visibilitychange", () => watch());
addEventListener("resize", () => {
  noteResize();
  needsDrawing = true;
});
followTheme(byId("theme"), () => (needsDrawing = true));
if (selected !== null) select(selected);
setInterval(() => (needsDrawing = true), IDLE_DRAW_MS);
requestAnimationFrame(animate);
start();
