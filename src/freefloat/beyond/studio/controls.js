// Parts of the studio's page: the connection to the server and the sliders.

const TAB = crypto.getRandomValues(new Uint32Array(1))[0].toString(36); // names this page in gestures
const INTERVAL = 16; // between two edits of a gesture [ms]
const RETRY = 1000; // before the page connects again [ms]
const SLIDERS = [ // message, component, label, unit
  ["momentum", 0, "h x", "N m s"], ["momentum", 1, "h y", "N m s"], ["momentum", 2, "h z", "N m s"],
  ["duration", null, "duration", "s"], ["margin", null, "margin", ""],
  ["orientation", 0, "end roll", "°"], ["orientation", 1, "end pitch", "°"], ["orientation", 2, "end yaw", "°"],
];
const IN_PLANE = ["h z", "duration", "margin", "end yaw"];

class Connection {
  constructor(receive, changed) {
    Object.assign(this, { receive, changed, gesture: 0, waiting: null, timer: 0 });
    this.open();
  }

  open() {
    this.socket = new WebSocket(`${location.href.replace(/^http/, "ws").replace(/[?#].*/, "")}socket`);
    this.socket.addEventListener("open", () => this.changed(true));
    this.socket.addEventListener("message", event => this.receive(JSON.parse(event.data)));
    this.socket.addEventListener("close", () => {
      this.changed(false);
      setTimeout(() => this.open(), RETRY);
    });
  }

  send(message) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }

  // Sends the edits of a gesture, of those within an interval the last one only.
  edit(message, done) {
    this.waiting = { ...message, gesture: `${TAB}-${this.gesture}`, done };
    if (done) {
      this.gesture += 1;
      this.flush();
    } else {
      this.timer ||= setTimeout(() => this.flush(), INTERVAL);
    }
  }

  flush() {
    clearTimeout(this.timer);
    this.timer = 0;
    if (this.waiting) this.send(this.waiting);
    this.waiting = null;
  }
}

class Sliders {
  constructor(edit) {
    this.edit = edit;
    this.held = null;
    this.rows = SLIDERS.map(([type, part, label, unit]) => {
      const row = document.createElement("label"), input = document.createElement("input");
      const output = document.createElement("output");
      row.className = "slider";
      Object.assign(input, { type: "range", step: "any", name: label });
      row.hidden = true; // until its value is known
      row.append(label, input, output);
      element("sliders").append(row);
      const entry = { type, part, label, unit, row, input, output };
      input.addEventListener("input", () => { this.held = input; this.send(entry, false); });
      input.addEventListener("change", () => { this.send(entry, true); this.held = null; });
      input.addEventListener("keydown", event => { if (!event.ctrlKey && !event.metaKey) event.stopPropagation(); });
      return entry;
    });
  }

  send(entry, done) {
    const { type, part } = entry, values = this.values[type];
    values[part || 0] = this.value(entry); // the others, shown or not, keep their values
    this.write(entry);
    this.edit({ type, value: part === null ? values[0] : [...values] }, done);
  }

  value({ type, input }) { return type === "orientation" ? +input.value * Math.PI / 180 : +input.value; }

  write({ type, input, output, unit }) {
    const number = shortened(+(+input.value).toPrecision(4)), margin = type === "margin" ? this.outline.margin : null;
    output.textContent = margin?.is_fraction ? `${(100 * input.value).toFixed(1)} %` : `${number} ${margin ? printed(margin.unit) : unit}`;
  }

  show(outline, ends) {
    this.outline = outline;
    const { momentum, duration, margin, rpy, normal } = outline;
    this.values = { // those of a goal have no margin, and where it is free no duration
      momentum: [...momentum], duration: duration && [duration], margin: margin && [margin.value], orientation: rpy && [...rpy],
    };
    const limits = { ...ends, margin: margin && [0, margin.is_fraction ? 0.99 : margin.largest], orientation: [-180, 180] };
    for (const entry of this.rows) {
      const { type, part, label, row, input } = entry;
      row.hidden = !this.values[type] || (normal && normal[2] === 1 && !IN_PLANE.includes(label));
      if (row.hidden || input === this.held) continue;
      const scale = type === "orientation" ? 180 / Math.PI : 1;
      const value = scale * this.values[type][part || 0], [low, high] = limits[type];
      Object.assign(input, { min: Math.min(low, value), max: Math.max(high, value), value });
      this.write(entry);
    }
  }
}
