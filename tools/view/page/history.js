// The ticks of the last 60 s of one hand, by columns, at full rate.
import { kTickFloats } from './protocol.js';

export const kHistory_s = 60;
/** Columns after the time, as the protocol has them. */
export const kColumns = ['force_x', 'force_y', 'force_z', 'position_x', 'position_y', 'position_z', 'proxy_x', 'proxy_y',
  'proxy_z', 'proxy_age', 'energy', 'wakeup', 'compute', 'step', 'gate', 'safety'];
export const kUnits = ['N', 'N', 'N', 'm', 'm', 'm', 'm', 'm', 'm', 'ms', 'mJ', 'us', 'us', 'ms', '1', 'bits'];

export class History {
  constructor(rate_hz) {
    this.capacity = Math.ceil((kHistory_s + 2) * Math.max(100, rate_hz));
    this.times = new Float64Array(this.capacity);
    this.columns = kColumns.map(() => new Float32Array(this.capacity));
    this.count = 0;      // rows ever
    this.expected = null;
  }

  clear() {
    this.count = 0;
    this.expected = null;
  }

  get first() { return Math.max(0, this.count - this.capacity); }
  time(row) { return this.times[row % this.capacity]; }
  value(column, row) { return this.columns[column][row % this.capacity]; }
  get newest_s() { return this.count > 0 ? this.time(this.count - 1) : 0; }

  /** Ticks of a frame. What was not seen becomes a gap. */
  take(hand, now_s) {
    if (hand.count === 0) return;
    if (this.expected !== null && hand.first !== this.expected) this.push(this.newest_s + 1e-6, null);
    for (let i = 0; i < hand.count; ++i) {
      const row = hand.ticks.subarray(kTickFloats * i, kTickFloats * (i + 1)), time = now_s + row[0];
      // A loop that started again after a pause: nothing is drawn between.
      if (this.count > 0 && time > this.newest_s + 0.25) this.push(this.newest_s + 1e-6, null);
      if (time > this.newest_s) this.push(time, row);
    }
    this.expected = hand.first + hand.count;
  }

  push(time, row) {
    const at = this.count++ % this.capacity;
    this.times[at] = time;
    for (let c = 0; c < kColumns.length; ++c) this.columns[c][at] = row ? row[c + 1] : NaN;
  }

  /** First row at or after `time`. */
  find(time) {
    let low = this.first, high = this.count;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.time(middle) < time) low = middle + 1; else high = middle;
    }
    return low;
  }

  /** Stands still while the curves are held. */
  snapshot() {
    const copy = Object.create(History.prototype);
    return Object.assign(copy, this, { times: this.times.slice(), columns: this.columns.map((c) => c.slice()) });
  }
}
