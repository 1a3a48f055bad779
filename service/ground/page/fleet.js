// The list of vehicles. Arrow keys, Home and End go through it.

import { FRESHNESS_WORDS, OBSTACLE, CLEAR, age, freshness, mark, metres, say } from "./words.js";

export class FleetList {
  #items = new Map(); // name -> elements
  #vehicles = [];
  #selected = null;
  #isInView = false;

  /** @param {(name: string) => void} onSelect called when the user chooses a vehicle. */
  constructor(list, onSelect) {
    this.list = list;
    this.onSelect = onSelect;
    list.addEventListener("keydown", (event) => this.#key(event));
    list.addEventListener("click", (event) => {
      const item = event.target.closest("li");
      if (item !== null) this.#choose(item.dataset.name);
    });
  }

  /** Names in the order shown. */
  get names() {
    return this.#vehicles.map((vehicle) => vehicle.name);
  }

  /** What the list knows of a vehicle. */
  of(name) {
    return this.#vehicles.find((vehicle) => vehicle.name === name) ?? null;
  }

  /** Take the vehicles as the gateway tells them, each with the moments that its data are from. */
  update(vehicles) {
    this.#vehicles = vehicles;
    const names = new Set(vehicles.map((vehicle) => vehicle.name));
    for (const [name, item] of this.#items) {
      if (!names.has(name)) {
        item.root.remove();
        this.#items.delete(name);
      }
    }
    vehicles.forEach((vehicle, index) => {
      let item = this.#items.get(vehicle.name);
      if (item === undefined) {
        item = makeItem(vehicle.name);
        this.#items.set(vehicle.name, item);
      }
      if (this.list.children[index] !== item.root) this.list.insertBefore(item.root, this.list.children[index] ?? null);
    });
    this.#markSelected();
  }

  /** Show which vehicle is selected. */
  select(name) {
    this.#selected = name;
    this.#isInView = false;
    this.#markSelected();
  }

  /** Draw ages as of now. */
  draw(nowMs, limits) {
    for (const vehicle of this.#vehicles) {
      const item = this.#items.get(vehicle.name);
      const ageMs = vehicle.bornMs === null ? null : nowMs - vehicle.bornMs;
      const state = freshness(ageMs, limits);
      mark(item.root, "freshness", state);
      mark(item.root, "verdict", state === "none" ? "0" : String(vehicle.verdict));
      say(item.distance, distanceWords(vehicle, state));
      const words = state === "live" ? [FRESHNESS_WORDS.live] : [FRESHNESS_WORDS[state], age(ageMs)];
      if (!vehicle.alive) words.push("session gone");
      say(item.freshness, words.filter(Boolean).join(" "));
      const isKnown = vehicle.statusBornMs !== null && nowMs - vehicle.statusBornMs <= limits.noDataMs;
      const facts = isKnown ? [vehicle.mode, vehicle.armed === true ? "armed" : null] : [];
      if (vehicle.twins) facts.unshift("two of this name?");
      say(item.facts, facts.filter(Boolean).join(" · "));
      item.record.hidden = !(isKnown && vehicle.recording === true);
    }
  }

  #markSelected() {
    for (const [name, item] of this.#items) {
      item.root.setAttribute("aria-selected", String(name === this.#selected));
      if (name !== this.#selected) continue;
      this.list.setAttribute("aria-activedescendant", item.root.id);
      if (!this.#isInView) {
        this.#isInView = true;
        item.root.scrollIntoView({ block: "nearest", inline: "nearest" });
      }
    }
  }

  #key(event) {
    const names = this.names;
    if (names.length === 0 || event.ctrlKey || event.altKey || event.metaKey) return;
    const at = names.indexOf(this.#selected);
    const to = { ArrowDown: at + 1, ArrowRight: at + 1, ArrowUp: at - 1, ArrowLeft: at - 1, Home: 0, End: names.length - 1 }[
      event.key
    ];
    if (to === undefined) return;
    event.preventDefault();
    this.#choose(names[Math.min(names.length - 1, Math.max(0, to))]);
  }

  #choose(name) {
    if (name !== undefined && name !== this.#selected) this.onSelect(name);
  }
}

function distanceWords(vehicle, state) {
  if (state === "none") return "–";
  if (vehicle.verdict === OBSTACLE) return `${metres(vehicle.nearest_cm)} m`;
  return vehicle.verdict === CLEAR ? "clear" : "unknown";
}

let count = 0;

function makeItem(name) {
  const root = document.createElement("li");
  root.id = `vehicle-${(count += 1)}`;
  root.setAttribute("role", "option");
  root.dataset.name = name;
  const add = (className, tag = "span") => {
    const element = document.createElement(tag);
    element.className = className;
    root.append(element);
    return element;
  };
  add("mark", "i");
  const title = add("vehicle-name");
  const distance = add("distance");
  const below = add("row");
  const record = add("rec");
  const facts = add("facts-line");
  const freshness = add("fresh");
  below.append(record, facts, freshness);
  say(title, name);
  say(record, "REC");
  return { root, distance, facts, record, freshness };
}
