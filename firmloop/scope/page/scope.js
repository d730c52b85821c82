"use strict";
/* The scope: takes what comes, shows it, and does what the user asks for. */
const facts = JSON.parse(document.getElementById("facts").textContent);
const period = facts.period_s;
const element = (id) => document.getElementById(id);
const canvas = element("canvas");

const MOST = 600000; // rows that are kept here; the recording keeps all
const WIDTHS = [0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300]; // s
const USUAL_STEPS = 5000;
const FRAME = 66; // ms between two pictures
const IDLE = 4; // times as long as a picture took, nothing is drawn: at most a fifth of a processor
const READ = 250; // ms between two readings of the figures while they run
const sinceBegin = Math.max(0, facts.rows - MOST);

const store = new Store(facts.channels.length, MOST);
const panes = new Panes(canvas, facts.channels);
const usual = WIDTHS.reduce((a, b) => (Math.abs(Math.log(b / (USUAL_STEPS * period))) < Math.abs(Math.log(a / (USUAL_STEPS * period))) ? b : a));
const view = new View(facts.every, usual / period);
const trigger = new Trigger();
const tunables = new Tunables(element("tunables"), facts.tunables);
const cursors = { a: null, b: null, pointer: null }; // steps
let missing = 0;
let over = "";
let broken = false;

/* Drawing, at a bounded share of a processor. */
let asked = false;
let free = 0; // ms, when the next picture may be begun
let read = 0;

function redraw() {
  if (asked) return;
  asked = true;
  setTimeout(() => requestAnimationFrame(picture), Math.max(0, free - performance.now()));
}

function picture() {
  asked = false;
  const begun = performance.now();
  if (!view.paused) {
    if (trigger.mode !== "off" && trigger.search(store, view.width) && trigger.mode === "single") {
      view.show(trigger.at - BEFORE * view.width);
      setPaused(true);
    }
  }
  if (!view.paused) {
    const begin = trigger.begin(store.last, view.width);
    if (begin === null) view.follow(store.last);
    else view.show(begin);
  }
  const times = Object.entries(cursors).filter(([, step]) => step !== null);
  panes.draw(store, view, period, {
    times: times.map(([name, step]) => ({ step, label: name === "pointer" ? "" : name.toUpperCase() })),
    level: trigger.mode === "off" ? null : { channel: trigger.channel, value: trigger.level },
  });
  if (begun - read > READ || view.paused || cursors.pointer !== null) {
    read = begun;
    figures();
  }
  free = performance.now() + Math.max(FRAME - (performance.now() - begun), IDLE * (performance.now() - begun));
}

/* The table of figures. */
const rows = facts.channels.map((channel, k) => {
  const row = element("signals").insertRow();
  const head = document.createElement("th");
  head.scope = "row";
  const label = document.createElement("label");
  const box = document.createElement("input");
  Object.assign(box, { type: "checkbox", checked: true, id: `shown-${channel.name}` });
  const swatch = document.createElement("span");
  swatch.className = "swatch";
  swatch.style.background = panes.ink(k);
  label.append(box, swatch, channel.name);
  head.append(label);
  row.append(head);
  row.insertCell().textContent = channel.unit || "1";
  box.addEventListener("change", () => {
    panes.channels[k].shown = box.checked;
    redraw();
  });
  return { swatch, cells: ["at", "a", "ab"].map((name) => Object.assign(row.insertCell(), { id: `${channel.name}-${name}` })) };
});

function valueAt(k, step) {
  const i = store.nearest(step);
  return i < 0 ? NaN : store.signal(k)[i];
}

function figures() {
  const words = (value) => (Number.isFinite(value) ? shownNumber(value) : "");
  const at = cursors.pointer ?? store.last;
  element("at").textContent = cursors.pointer === null ? "last" : "here";
  facts.channels.forEach((channel, k) => {
    const a = cursors.a === null ? NaN : valueAt(k, cursors.a);
    const b = cursors.b === null ? NaN : valueAt(k, cursors.b);
    [valueAt(k, at), a, b - a].forEach((value, n) => { rows[k].cells[n].textContent = words(value); });
    if (channel.column === "controller_status") {
      const set = facts.status.filter(({ bit }) => Math.floor(valueAt(k, at) / 2 ** bit) % 2 === 1);
      element("bits").textContent = set.map(({ name, says }) => `${name}: ${says}`).join("; ");
    }
  });
  const time = (step) => (step === null ? NaN : step * period);
  element("time-at").textContent = words(time(at));
  element("time-a").textContent = words(time(cursors.a));
  element("time-ab").textContent = words(time(cursors.b) - time(cursors.a));
  if (!over && !broken) {
    const lost = missing ? `${missing.toLocaleString("en")} samples lost` : "none lost";
    element("state").textContent = `${(store.base + store.length).toLocaleString("en")} samples, ${lost}, ${time(store.last).toFixed(1)} s`;
    element("state").className = missing ? "wrong" : "";
  }
}

/* What comes. */
const source = new EventSource(`events?begin=${sinceBegin}`);
source.addEventListener("rows", (event) => {
  const told = JSON.parse(event.data);
  broken = false;
  missing = told.missing;
  store.append(told.begin, told.rows);
  tunables.hold(told.now);
  redraw();
});
source.addEventListener("over", (event) => {
  over = JSON.parse(event.data).says;
  source.close();
  element("state").textContent = over;
  element("state").className = "wrong";
  figures();
});
source.addEventListener("error", () => {
  broken = true;
  element("state").textContent = "the scope does not answer; what came so far stays here";
  element("state").className = "wrong";
});

/* What the user asks for. */
function setPaused(paused) {
  view.paused = paused;
  element("pause").setAttribute("aria-pressed", String(paused));
  if (!paused) trigger.arm(store.base + store.length);
  redraw();
}

element("pause").addEventListener("click", () => setPaused(!view.paused));
for (const seconds of WIDTHS) element("width").add(new Option(`${seconds} s`, seconds, false, seconds === usual));
element("width").addEventListener("change", (event) => {
  view.zoom(Number(event.target.value) / period / view.width, view.end);
  redraw();
});
element("range").addEventListener("change", (event) => {
  panes.byProject = event.target.value === "project";
  for (const pane of panes.panes) pane.held = null;
  redraw();
});
facts.channels.forEach((channel, k) => element("trigger-channel").add(new Option(channel.name, k)));

function setTrigger() {
  trigger.mode = element("trigger-mode").value;
  trigger.channel = Number(element("trigger-channel").value);
  trigger.rising = element("trigger-edge").value === "rising";
  trigger.level = Number(element("trigger-level").value);
  setPaused(false);
}

element("trigger-channel").addEventListener("change", () => {
  const { low, high } = facts.channels[Number(element("trigger-channel").value)];
  element("trigger-level").value = shownNumber((low + high) / 2);
});
element("trigger-channel").dispatchEvent(new Event("change"));
for (const name of ["mode", "channel", "edge", "level"]) element(`trigger-${name}`).addEventListener("change", setTrigger);

element("save").addEventListener("click", () => {
  const begin = store.base + store.find(view.begin);
  const end = store.base + store.find(view.end);
  const link = document.createElement("a");
  link.href = `recording.csv?begin=${begin}&end=${Math.max(begin + 1, end)}`;
  link.download = `${facts.name}_${(view.begin * period).toFixed(3)}_s.csv`;
  link.click();
});

/* Pointer and keys. */
let dragged = null;
const stepOf = (event) => panes.stepAt(view, event.offsetX);

canvas.addEventListener("wheel", (event) => {
  event.preventDefault();
  const factor = event.deltaY > 0 ? 1.25 : 0.8;
  const pane = panes.paneAt(event.offsetY);
  if (event.offsetX < panes.left && pane) {
    const [low, high] = pane.range;
    const about = high - ((event.offsetY - pane.top) / pane.high) * (high - low);
    pane.held = [about + (low - about) * factor, about + (high - about) * factor];
  } else {
    view.zoom(factor, stepOf(event));
  }
  redraw();
}, { passive: false });
canvas.addEventListener("dblclick", (event) => {
  const pane = panes.paneAt(event.offsetY);
  if (event.offsetX < panes.left && pane) pane.held = null;
  redraw();
});
canvas.addEventListener("pointerdown", (event) => {
  dragged = { x: event.offsetX, begin: view.begin, moved: false };
  canvas.setPointerCapture(event.pointerId);
});
canvas.addEventListener("pointermove", (event) => {
  cursors.pointer = event.offsetX >= panes.left ? Math.round(stepOf(event)) : null;
  if (dragged && (dragged.moved || Math.abs(event.offsetX - dragged.x) > 4)) {
    if (!dragged.moved) {
      dragged.moved = true;
      setPaused(true);
      dragged.begin = view.begin;
    }
    view.show(dragged.begin - ((event.offsetX - dragged.x) / panes.wide) * view.width);
  }
  redraw();
});
canvas.addEventListener("pointerup", (event) => {
  if (dragged && !dragged.moved && event.offsetX >= panes.left) setCursor(event.shiftKey ? "b" : "a", stepOf(event));
  dragged = null;
});
canvas.addEventListener("pointerleave", () => {
  cursors.pointer = null;
  redraw();
});

/* A cursor stands on a sample. */
function setCursor(name, step) {
  const i = store.nearest(step);
  cursors[name] = i < 0 ? null : store.steps[i];
  redraw();
}

canvas.addEventListener("keydown", (event) => {
  const middle = cursors.pointer ?? (view.begin + view.end) / 2;
  const actions = {
    " ": () => setPaused(!view.paused),
    "+": () => view.zoom(0.8, middle),
    "-": () => view.zoom(1.25, middle),
    ArrowLeft: () => { setPaused(true); view.move(-view.width / 10); },
    ArrowRight: () => { setPaused(true); view.move(view.width / 10); },
    a: () => setCursor("a", middle),
    b: () => setCursor("b", middle),
    Escape: () => { cursors.a = cursors.b = null; },
  };
  const action = actions[event.key.length === 1 ? event.key.toLowerCase() : event.key];
  if (!action) return;
  event.preventDefault();
  action();
  redraw();
});

/* The look of the system. */
element("title").textContent = `${facts.name} on ${facts.target}`;
canvas.setAttribute("aria-label", `Signals over time: ${facts.channels.map((channel) => channel.name).join(", ")}`);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  panes.theme();
  rows.forEach(({ swatch }, k) => { swatch.style.background = panes.ink(k); });
  redraw();
});
new ResizeObserver(redraw).observe(canvas);
tunables.hold(facts.now);
redraw();
