// The curves beside the scene: least and largest value of each pixel column, so that a spike of one tick is seen.
import { History, kColumns, kHistory_s, kUnits } from './history.js';
import { niceAbove } from './math.js';

const norm = (h, row) => Math.hypot(h.value(0, row), h.value(1, row), h.value(2, row));
const column = (name, factor = 1) => {
  const index = kColumns.indexOf(name);
  return (h, row) => factor * h.value(index, row);
};
const kXyz = ['#c8102e', '#1b7f3b', '#2166b8'];
const xyz = (name, factor) => ['x', 'y', 'z'].map((axis, i) => ({
  name: axis, colour: kXyz[i], of: column(`${name}_${axis}`, factor) }));
const one = (name, factor) => [{ name: '', colour: '#2166b8', of: column(name, factor) }];

const kLanes = [
  { name: 'force', unit: 'N', signals: [{ name: '|F|', colour: '#8a939c', of: norm }, ...xyz('force')], least: 0.1 },
  { name: 'position', unit: 'mm', signals: xyz('position', 1000), least: 0.1 },
  { name: 'proxy age', unit: 'ms', signals: one('proxy_age'), zero: true, least: 1 },
  { name: 'energy', unit: 'mJ', signals: one('energy'), least: 0.01 },
  { name: 'wake-up latency', unit: 'us', signals: one('wakeup'), zero: true, least: 10 },
  { name: 'physics step', unit: 'ms', signals: one('step'), zero: true, least: 0.1 },
];
const kTitle = 15, kGap = 6, kRedraw_ms = 50;

function save(name, blob) {
  const link = document.createElement('a');
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

export class Curves {
  constructor() {
    const $ = (id) => document.getElementById(id);
    this.canvas = $('plot');
    this.ink = this.canvas.getContext('2d');
    this.histories = [];
    this.hand = 0;
    this.window_s = 5;
    this.held = null;
    this.cursor = null;
    this.drawnAt = 0;
    this.shown = { lanes: [], from: 0, to: 0 };
    $('window').onchange = (e) => { this.window_s = Number(e.target.value); };
    $('hand').onchange = (e) => { this.hand = Number(e.target.value); if (this.held) this.hold(true); };
    $('hold').onclick = () => this.hold(this.held === null);
    $('png').onclick = () => { this.draw(performance.now(), true); this.canvas.toBlob((blob) => save('curves.png', blob)); };
    $('csv').onclick = () => save('curves.csv', new Blob([this.csv()], { type: 'text/csv' }));
    this.back = $('back');
    this.canvas.onpointermove = (e) => { this.cursor = e.offsetX; };
    this.canvas.onpointerleave = () => { this.cursor = null; };
  }

  setScene(scene) {
    this.hold(false);
    this.histories = scene.hands.map((hand) => new History(hand.rate_hz));
    this.names = scene.hands.map((hand) => hand.name);
    this.hand = 0;
    const select = document.getElementById('hand');
    select.replaceChildren(...this.names.map((name, i) => new Option(name, i)));
    select.hidden = this.names.length < 2;
  }

  /** A recording has jumped. */
  clear() { this.histories.forEach((history) => history.clear()); }

  take(frame) { frame.hands.forEach((hand, i) => this.histories[i]?.take(hand, frame.now)); }

  hold(on) {
    this.held = on && this.histories[this.hand] ? this.histories[this.hand].snapshot() : null;
    document.getElementById('hold').setAttribute('aria-pressed', this.held !== null);
    this.back.hidden = this.held === null;
    this.back.value = 0;
  }

  history() { return this.held ?? this.histories[this.hand]; }

  range() {
    const to = (this.history()?.newest_s ?? 0) - (this.held ? Number(this.back.value) : 0);
    return { from: to - this.window_s, to };
  }

  draw(now_ms, always = false) {
    if (!always && now_ms < this.drawnAt + kRedraw_ms) return;
    this.drawnAt = now_ms;
    const ratio = window.devicePixelRatio, width = this.canvas.clientWidth, height = this.canvas.clientHeight;
    if (this.canvas.width !== Math.round(width * ratio) || this.canvas.height !== Math.round(height * ratio)) {
      this.canvas.width = Math.round(width * ratio);
      this.canvas.height = Math.round(height * ratio);
    }
    const style = getComputedStyle(document.documentElement);
    this.colours = Object.fromEntries(['paper', 'ink', 'faint', 'line'].map((n) => [n, style.getPropertyValue(`--${n}`)]));
    const ink = this.ink, history = this.history(), { from, to } = this.range();
    ink.setTransform(ratio, 0, 0, ratio, 0, 0);
    ink.fillStyle = this.colours.paper;
    ink.fillRect(0, 0, width, height);
    ink.font = '11px "DejaVu Sans", sans-serif';
    this.shown = { lanes: [], from, to };
    if (!history || history.count === 0) return;
    const bottom = 16, lane = (height - bottom) / kLanes.length;
    const at = this.cursor === null ? null : history.find(from + this.cursor / width * (to - from));
    kLanes.forEach((each, i) => this.drawLane(each, history, i * lane + kTitle, lane - kTitle - kGap, width, at));
    this.drawTime(width, height, from, to, at, history);
  }

  /** Least and largest value of each column of pixels, the newest sample in the last; NaN where there is none. */
  columns(signal, history, width) {
    const { from, to } = this.shown, per_s = width / (to - from), first = Math.floor(to * per_s) - width + 1;
    const low = new Float32Array(width).fill(NaN), high = new Float32Array(width).fill(NaN);
    for (let row = history.find(from); row < history.count && history.time(row) <= to; ++row) {
      const x = Math.floor(history.time(row) * per_s) - first, v = signal.of(history, row);
      if (x < 0 || x >= width || !Number.isFinite(v)) continue;
      if (!(low[x] <= v)) low[x] = v;
      if (!(high[x] >= v)) high[x] = v;
    }
    return { signal, low, high };
  }

  drawLane(lane, history, top, height, width, at) {
    const ink = this.ink, whole = Math.floor(width);
    const drawn = lane.signals.map((signal) => this.columns(signal, history, whole));
    let low = lane.zero ? 0 : Infinity, high = -Infinity;
    for (const { low: l, high: h } of drawn) {
      for (let x = 0; x < whole; ++x) { if (l[x] < low) low = l[x]; if (h[x] > high) high = h[x]; }
    }
    const none = high === -Infinity;
    if (none) { low = 0; high = 1; }
    this.shown.lanes.push({ name: lane.name, low, high, none });
    const middle = 0.5 * (low + high), span = Math.max(lane.least, high - low), step = niceAbove(span / 4);
    const y0 = lane.zero ? 0 : middle - 0.54 * span, y1 = lane.zero ? Math.max(high, lane.least) * 1.06 : middle + 0.54 * span;
    const y = (v) => top + height * (1 - (v - y0) / (y1 - y0));
    ink.strokeStyle = this.colours.line;
    ink.fillStyle = this.colours.faint;
    ink.lineWidth = 1;
    for (let v = Math.ceil(y0 / step) * step; v <= y1; v += step) {
      ink.beginPath(); ink.moveTo(0, y(v)); ink.lineTo(width, y(v)); ink.stroke();
      if (y(v) > top + 8) ink.fillText(Number(v.toPrecision(6)).toString(), 3, y(v) - 2);
    }
    for (const { signal, low: l, high: h } of drawn) {
      ink.strokeStyle = signal.colour;
      ink.beginPath();
      let last = null;
      for (let x = 0; x < whole; ++x) {
        if (Number.isNaN(l[x])) { if (last !== null && x - last.x > whole * 0.25 / this.window_s + 2) last = null; continue; }
        // Joined with the column before, so that slow curves have no holes.
        const a = last ? Math.min(l[x], last.high) : l[x], b = last ? Math.max(h[x], last.low) : h[x];
        if (last && last.x < x - 1) { ink.moveTo(last.x + 0.5, y(last.mid)); ink.lineTo(x + 0.5, y(0.5 * (l[x] + h[x]))); }
        ink.moveTo(x + 0.5, y(a) + 0.5); ink.lineTo(x + 0.5, y(b) - 0.5);
        last = { x, low: l[x], high: h[x], mid: 0.5 * (l[x] + h[x]) };
      }
      ink.stroke();
    }
    this.drawTitle(lane, history, top, width, at, none);
  }

  drawTitle(lane, history, top, width, at, none) {
    const ink = this.ink;
    ink.fillStyle = this.colours.ink;
    ink.fillText(`${lane.name} [${lane.unit}]${none ? ': none' : ''}`, 3, top - 4);
    let x = width - 4;
    ink.textAlign = 'right';
    for (const signal of [...lane.signals].reverse()) {
      const value = at !== null && at < history.count ? signal.of(history, at) : null;
      const text = `${signal.name}${value === null ? '' : ` ${Number(value).toPrecision(4)}`}`;
      ink.fillStyle = signal.colour;
      ink.fillText(text, x, top - 4);
      x -= ink.measureText(text).width + 10;
    }
    ink.textAlign = 'left';
  }

  drawTime(width, height, from, to, at, history) {
    const ink = this.ink, step = niceAbove((to - from) / 6);
    ink.fillStyle = this.colours.faint;
    ink.textAlign = 'right';
    const newest = history.newest_s;
    for (let t = Math.ceil((from - newest) / step) * step; t <= to - newest; t += step) {
      const x = Math.min((t + newest - from) / (to - from) * width, width - 1);
      if (x > 30) ink.fillText(`${Number(t.toPrecision(4))} s`, x - 2, height - 4);
    }
    ink.textAlign = 'left';
    if (at === null || at >= history.count) return;
    ink.strokeStyle = this.colours.ink;
    ink.beginPath(); ink.moveTo(this.cursor + 0.5, 0); ink.lineTo(this.cursor + 0.5, height); ink.stroke();
  }

  /** Every tick of the time that is shown. */
  csv() {
    const history = this.history(), { from, to } = this.range();
    const lines = [`time [s],${kColumns.map((name, i) => `${name} [${kUnits[i]}]`).join(',')}`];
    if (!history) return lines[0];
    for (let row = history.find(from); row < history.count && history.time(row) <= to; ++row) {
      const values = kColumns.map((_, c) => history.value(c, row));
      if (values.every(Number.isNaN)) continue;
      lines.push([history.time(row).toFixed(6), ...values.map((v) => (Number.isNaN(v) ? '' : Number(v.toPrecision(7))))].join(','));
    }
    return `${lines.join('\n')}\n`;
  }
}
export { kHistory_s };
