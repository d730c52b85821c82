"use strict";
/* The samples of the watch: one column of steps and one a signal. The oldest go when there are too many. */
class Store {
  constructor(signals, most) {
    this.most = most;
    this.base = 0; // number of the row at index 0, of all rows that ever came
    this.length = 0;
    this.columns = Array.from({ length: signals + 1 }, () => new Float64Array(1 << 14));
  }

  get steps() { return this.columns[0]; }

  signal(k) { return this.columns[k + 1]; }

  get last() { return this.length ? this.steps[this.length - 1] : 0; }

  /* Takes rows from number `begin` on; those that came before, as after a line that was cut off, are passed over. */
  append(begin, text) {
    const bytes = Uint8Array.from(atob(text), (each) => each.charCodeAt(0));
    const numbers = new Float64Array(bytes.buffer);
    const wide = this.columns.length;
    if (!this.length) this.base = begin;
    const known = this.base + this.length - begin;
    const more = numbers.length / wide - known;
    if (more <= 0) return;
    this.makeRoom(more);
    for (let c = 0; c < wide; c++) {
      const column = this.columns[c];
      for (let i = 0; i < more; i++) column[this.length + i] = numbers[(known + i) * wide + c];
    }
    this.length += more;
  }

  makeRoom(more) {
    const room = this.steps.length;
    if (this.length + more <= room) return;
    const keep = Math.min(this.length, this.most);
    const drop = this.length - keep;
    const wanted = keep + more > room / 2 ? 2 * (keep + more) : room;
    this.columns = this.columns.map((column) => {
      const kept = wanted > room ? new Float64Array(wanted) : column;
      kept.set(column.subarray(drop, this.length));
      return kept;
    });
    this.base += drop;
    this.length = keep;
  }

  /* Returns the index of the first row whose step is `step` or later. */
  find(step) {
    let low = 0;
    let high = this.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.steps[middle] < step) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /* Returns the index of the row nearest to a step, -1 if there is none. */
  nearest(step) {
    const k = this.find(step);
    if (k === this.length) return k - 1;
    return k > 0 && step - this.steps[k - 1] < this.steps[k] - step ? k - 1 : k;
  }

  /* Returns the lowest and the highest of a signal over rows [from, to). */
  extent(k, from, to) {
    const values = this.signal(k);
    let low = Infinity;
    let high = -Infinity;
    for (let i = from; i < to; i++) {
      const value = values[i];
      if (value < low) low = value;
      if (value > high) high = value;
    }
    return [low, high];
  }
}
