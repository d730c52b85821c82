"use strict";
/* Draws the signals, those of one unit in one pane: above each other, over one axis of time. */
const INKS = {
  light: ["#0b5cad", "#c2410c", "#15803d", "#a21caf", "#0e7490", "#b45309", "#4338ca", "#be123c"],
  dark: ["#7ab8ff", "#ffb067", "#6ee7a0", "#f0a6ff", "#67e8f9", "#fcd34d", "#b4b0ff", "#ff9aae"],
};
const SCALE = 76; // CSS pixels left of the panes
const FOOT = 24; // and below them
const GAP = 8;

function niceStep(span, most) {
  const rough = span / Math.max(1, most);
  const power = 10 ** Math.floor(Math.log10(rough));
  return [1, 2, 5, 10].map((each) => each * power).find((each) => each >= rough);
}

function shownNumber(value) { return String(Number(value.toPrecision(6))); }

class Panes {
  constructor(canvas, channels) {
    this.canvas = canvas;
    this.pen = canvas.getContext("2d", { alpha: false });
    this.channels = channels.map((channel) => ({ ...channel, shown: true }));
    const units = [...new Set(channels.map((channel) => this.group(channel)))];
    this.panes = units.map((unit) => ({
      unit,
      members: channels.flatMap((channel, k) => (this.group(channel) === unit ? [k] : [])),
      held: null, // the range that the user has chosen
      range: [0, 1],
    }));
    this.byProject = true;
    this.theme();
  }

  group(channel) { return channel.column === "controller_status" ? "status bits" : channel.unit || "1"; }

  theme() {
    const dark = matchMedia("(prefers-color-scheme: dark)").matches;
    const style = getComputedStyle(document.documentElement);
    this.inks = INKS[dark ? "dark" : "light"];
    this.look = Object.fromEntries(["ground", "ink", "faint", "line"].map((name) => [name, style.getPropertyValue(`--${name}`)]));
  }

  ink(k) { return this.inks[k % this.inks.length]; }

  /* Fits the canvas to its place, and the panes to the canvas. */
  layout() {
    const ratio = window.devicePixelRatio || 1;
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (this.canvas.width !== Math.round(width * ratio) || this.canvas.height !== Math.round(height * ratio)) {
      this.canvas.width = Math.round(width * ratio);
      this.canvas.height = Math.round(height * ratio);
    }
    this.ratio = ratio;
    this.left = SCALE;
    this.wide = Math.max(10, width - SCALE - 8);
    this.visible = this.panes.filter((pane) => pane.members.some((k) => this.channels[k].shown));
    const room = (height - FOOT) / Math.max(1, this.visible.length);
    this.visible.forEach((pane, k) => {
      pane.top = k * room + GAP;
      pane.high = Math.max(10, room - GAP);
    });
  }

  paneAt(y) { return this.visible.find((pane) => y >= pane.top && y <= pane.top + pane.high); }

  rangeOf(pane, store, from, to) {
    if (pane.held) return pane.held;
    const members = pane.members.filter((k) => this.channels[k].shown);
    const found = members.map((k) => this.channels[k]).map(({ low, high }) => [low, high]);
    const finite = found.flat().every((each) => Number.isFinite(each) && Math.abs(each) < 1e30);
    const ranges = this.byProject && finite ? found : members.map((k) => store.extent(k, from, to));
    const low = Math.min(...ranges.map((range) => range[0]));
    const high = Math.max(...ranges.map((range) => range[1]));
    if (!(low <= high)) return [0, 1];
    const margin = (high - low || Math.abs(high) || 1) * 0.04;
    return [low - margin, high + margin];
  }

  /* Where a value stands in a pane, and a step in all of them, in CSS pixels. */
  yOf(pane, value) { return pane.top + pane.high * (1 - (value - pane.range[0]) / (pane.range[1] - pane.range[0])); }

  xOf(view, step) { return this.left + (this.wide * (step - view.begin)) / (view.end - view.begin); }

  stepAt(view, x) { return view.begin + ((x - this.left) / this.wide) * (view.end - view.begin); }

  draw(store, view, period, marks) {
    this.layout();
    const pen = this.pen;
    pen.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    pen.fillStyle = this.look.ground;
    pen.fillRect(0, 0, this.canvas.clientWidth, this.canvas.clientHeight);
    pen.font = "12px system-ui, sans-serif";
    const from = Math.max(0, store.find(view.begin) - 1);
    const to = Math.min(store.length, store.find(view.end) + 1);
    for (const pane of this.visible) {
      pane.range = this.rangeOf(pane, store, from, to);
      this.drawFrame(pane, view, period);
      pen.save();
      pen.beginPath();
      pen.rect(this.left, pane.top, this.wide, pane.high);
      pen.clip();
      for (const k of pane.members) if (this.channels[k].shown) this.drawSignal(pane, k, store, view, from, to);
      pen.restore();
      this.drawNames(pane);
    }
    this.drawTimes(view, period);
    this.drawMarks(view, marks);
  }

  drawFrame(pane, view, period) {
    const pen = this.pen;
    const [low, high] = pane.range;
    const step = niceStep(high - low, pane.high / 20);
    pen.strokeStyle = this.look.line;
    pen.fillStyle = this.look.faint;
    pen.lineWidth = 1;
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    pen.beginPath();
    for (let value = Math.ceil(low / step) * step; value <= high; value += step) {
      const y = Math.round(this.yOf(pane, value)) + 0.5;
      pen.moveTo(this.left, y);
      pen.lineTo(this.left + this.wide, y);
      pen.fillText(shownNumber(Math.abs(value) < step / 1e6 ? 0 : value), this.left - 6, y);
    }
    const every = niceStep((view.end - view.begin) * period, this.wide / 90) / period;
    for (let at = Math.ceil(view.begin / every) * every; at <= view.end; at += every) {
      const x = Math.round(this.xOf(view, at)) + 0.5;
      pen.moveTo(x, pane.top);
      pen.lineTo(x, pane.top + pane.high);
    }
    pen.rect(this.left + 0.5, pane.top + 0.5, this.wide, pane.high);
    pen.stroke();
    pen.save();
    pen.translate(12, pane.top + pane.high / 2);
    pen.rotate(-Math.PI / 2);
    pen.textAlign = "center";
    pen.fillText(pane.unit, 0, 0, pane.high);
    pen.restore();
  }

  drawNames(pane) {
    const pen = this.pen;
    pen.textAlign = "left";
    pen.textBaseline = "top";
    let x = this.left + 8;
    for (const k of pane.members.filter((each) => this.channels[each].shown)) {
      pen.fillStyle = this.ink(k);
      pen.fillText(this.channels[k].name, x, pane.top + 4);
      x += pen.measureText(this.channels[k].name).width + 14;
    }
  }

  drawTimes(view, period) {
    const pen = this.pen;
    const every = niceStep((view.end - view.begin) * period, this.wide / 90);
    const places = Math.max(0, -Math.floor(Math.log10(every)));
    pen.fillStyle = this.look.faint;
    pen.textAlign = "center";
    pen.textBaseline = "bottom";
    const floor = this.canvas.clientHeight - 4;
    for (let at = Math.ceil((view.begin * period) / every) * every; at <= view.end * period; at += every) {
      pen.fillText(at.toFixed(places), this.xOf(view, at / period), floor);
    }
    pen.textAlign = "left";
    pen.fillText("time, s", 4, floor);
  }

  /* Few samples are joined by lines. Of many, each column of pixels shows the lowest and the highest that fall into it;
     the columns keep to the samples, not to the window, so that a moving trace does not flicker. */
  drawSignal(pane, k, store, view, from, to) {
    const pen = this.pen;
    pen.fillStyle = pen.strokeStyle = this.ink(k);
    pen.lineWidth = 1.5;
    const steps = store.steps;
    const values = store.signal(k);
    if (to - from < 2 * this.wide) {
      pen.beginPath();
      for (let i = from; i < to; i++) {
        const x = this.xOf(view, steps[i]);
        const y = this.yOf(pane, values[i]);
        if (i > from && steps[i] - steps[i - 1] <= view.every) pen.lineTo(x, y);
        else pen.moveTo(x, y);
        if (to - from < this.wide / 8) pen.fillRect(x - 2, y - 2, 4, 4);
      }
      pen.stroke();
      return;
    }
    const perPixel = (view.end - view.begin) / this.wide;
    const scale = pane.high / (pane.range[1] - pane.range[0]);
    const floor = pane.top + pane.high + pane.range[0] * scale;
    const shift = Math.round(this.left - view.begin / perPixel);
    let i = from;
    let before = null; // the last value of the column before, if this one follows it without a gap
    while (i < to) {
      const column = Math.floor(steps[i] / perPixel);
      const end = (column + 1) * perPixel;
      let low = values[i];
      let high = low;
      if (before !== null) {
        low = Math.min(low, before);
        high = Math.max(high, before);
      }
      for (; i < to && steps[i] < end; i++) {
        const value = values[i];
        if (value < low) low = value;
        else if (value > high) high = value;
      }
      pen.fillRect(column + shift, floor - high * scale - 0.75, 1, (high - low) * scale + 1.5);
      before = i < to && steps[i] - steps[i - 1] <= view.every ? values[i - 1] : null;
    }
  }

  drawMarks(view, marks) {
    const pen = this.pen;
    pen.lineWidth = 1;
    pen.textBaseline = "top";
    pen.textAlign = "left";
    for (const { step, label } of marks.times) {
      if (step < view.begin || step > view.end) continue;
      const x = Math.round(this.xOf(view, step)) + 0.5;
      this.dash([[x, GAP, x, this.canvas.clientHeight - FOOT]]);
      pen.fillStyle = this.look.ink;
      pen.fillText(label, x + 3, GAP + 18);
    }
    if (marks.level === null) return;
    const pane = this.visible.find((each) => each.members.includes(marks.level.channel));
    if (!pane) return;
    const y = Math.round(this.yOf(pane, marks.level.value)) + 0.5;
    if (y >= pane.top && y <= pane.top + pane.high) this.dash([[this.left, y, this.left + this.wide, y]]);
  }

  dash(lines) {
    const pen = this.pen;
    pen.strokeStyle = this.look.ink;
    pen.setLineDash([4, 4]);
    pen.beginPath();
    for (const [x0, y0, x1, y1] of lines) {
      pen.moveTo(x0, y0);
      pen.lineTo(x1, y1);
    }
    pen.stroke();
    pen.setLineDash([]);
  }
}
