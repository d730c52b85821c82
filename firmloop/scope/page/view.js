"use strict";
/* Which steps are shown: the latest ones while it follows, those that were there when it was paused otherwise. */
const NARROWEST = 8; // steps

class View {
  constructor(every, width) {
    this.every = every; // steps between two samples
    this.width = width; // steps
    this.paused = false;
    this.begin = 0;
    this.end = width;
  }

  follow(last) {
    this.end = Math.max(last, this.width);
    this.begin = this.end - this.width;
  }

  show(begin) {
    this.begin = begin;
    this.end = begin + this.width;
  }

  /* Zooms about a step while paused, about the right end while it follows. */
  zoom(factor, about) {
    const width = Math.min(Math.max(this.width * factor, NARROWEST * this.every), 1e9);
    const share = (about - this.begin) / (this.end - this.begin);
    this.width = width;
    this.show(this.paused ? about - share * width : this.end - width);
  }

  move(steps) { this.show(this.begin + steps); }
}
