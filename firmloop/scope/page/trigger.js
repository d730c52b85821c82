"use strict";
/* Finds where a signal crosses a level, so that each sweep begins at the same place. */
const BEFORE = 0.1; // of the window that is shown before the crossing

class Trigger {
  constructor() {
    this.mode = "off";
    this.channel = 0;
    this.level = 0;
    this.rising = true;
    this.arm(0);
  }

  /* Forgets what was found; looks on from row number `row`. */
  arm(row) {
    this.row = row;
    this.at = null; // the step of the crossing that is shown
    this.since = null; // the step from which on none was found
  }

  /* Looks through what came; returns true if a new sweep is whole. */
  search(store, width) {
    const values = store.signal(this.channel);
    const after = (1 - BEFORE) * width;
    let found = false;
    let i = Math.max(1, this.row - store.base);
    if (this.since === null && store.length) this.since = store.last;
    for (; i < store.length; i++) {
      const crosses = this.rising
        ? values[i - 1] < this.level && values[i] >= this.level
        : values[i - 1] > this.level && values[i] <= this.level;
      if (!crosses) continue;
      if (store.last < store.steps[i] + after) break; // its sweep is not whole yet
      this.at = this.since = store.steps[i];
      found = true;
      if (this.mode === "single") break;
      i = store.find(this.at + after);
    }
    this.row = store.base + i;
    return found;
  }

  /* Tells where the window begins; null to follow what comes. */
  begin(last, width) {
    if (this.mode === "off") return null;
    if (this.at === null) return null;
    if (this.mode === "auto" && last - this.since > 3 * width) return null;
    return this.at - BEFORE * width;
  }
}
