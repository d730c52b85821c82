"use strict";
/* A slider and a field for each tunable parameter: what they ask for is set on the controller, which answers what it holds. */
class Tunables {
  constructor(section, tunables) {
    this.entries = new Map(tunables.map((tunable) => [tunable.name, this.entry(section, tunable)]));
    section.hidden = !tunables.length;
  }

  entry(section, { name, unit, low, high }) {
    const box = document.createElement("div");
    box.className = "tunable";
    const label = document.createElement("label");
    const field = document.createElement("input");
    Object.assign(field, { type: "number", step: "any", min: low, max: high, id: `value-${name}` });
    label.append(`${name}, ${unit || "1"}`, field);
    const slider = document.createElement("input");
    Object.assign(slider, { type: "range", step: "any", min: low, max: high, id: `slider-${name}` });
    slider.setAttribute("aria-label", `${name}, ${unit || "1"}`);
    const says = document.createElement("p");
    says.setAttribute("role", "status");
    says.textContent = `proven range ${shownNumber(low)} to ${shownNumber(high)}`;
    box.append(label, slider, says);
    section.append(box);
    const entry = { slider, field, says, told: says.textContent, wanted: null, sending: false };
    slider.addEventListener("input", () => {
      field.value = shownNumber(Number(slider.value));
      this.want(name, Number(slider.value));
    });
    field.addEventListener("change", () => { if (field.value !== "") this.want(name, Number(field.value)); });
    return entry;
  }

  /* One request at a time; of what was asked for meanwhile, the latest counts. */
  async want(name, value) {
    const entry = this.entries.get(name);
    entry.wanted = value;
    if (entry.sending) return;
    entry.sending = true;
    while (entry.wanted !== null) {
      const asked = entry.wanted;
      entry.wanted = null;
      await this.set(entry, name, asked);
    }
    entry.sending = false;
  }

  async set(entry, name, value) {
    try {
      const reply = await fetch("set", {
        method: "POST",
        headers: { "Content-Type": "application/json" },
        body: JSON.stringify({ name, value }),
      });
      const told = await reply.json();
      entry.says.className = reply.ok ? "" : "wrong";
      entry.says.textContent = reply.ok ? `${entry.told}; set from ${told.time_s.toFixed(3)} s on` : told.error;
      if (reply.ok && entry.wanted === null) this.show(entry, told.value);
    } catch {
      entry.says.className = "wrong";
      entry.says.textContent = "not set: the scope does not answer any more";
    }
  }

  show(entry, value) {
    entry.field.placeholder = value === null ? "no number" : ""; // the controller holds NaN or an infinity
    if (value !== null) entry.slider.value = value;
    if (document.activeElement !== entry.field) entry.field.value = value === null ? "" : shownNumber(value);
  }

  /* Shows what the controller holds, as another page may have set it. */
  hold(now) {
    for (const [name, value] of Object.entries(now)) {
      const entry = this.entries.get(name);
      if (entry.sending || entry.held === value) continue;
      entry.held = value;
      this.show(entry, value);
    }
  }
}
