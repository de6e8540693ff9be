// The studio's page: it sends what the user does and shows what the server answers.

"use strict";
let about = null; // the scene shown, read by player.js
const TAB = crypto.getRandomValues(new Uint32Array(1))[0].toString(36);
const INTERVAL = 16; // between two edits of a gesture [ms]
const RETRY = 1000; // before the page connects again [ms]
const SHOWN = 8000; // time of a notice [ms]
const STALE = ["End-effector path", "Trail", "Singularity"]; // items that an edit changes
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
    const { type, part } = entry;
    const values = this.rows.filter(row => row.type === type).map(row => this.value(row));
    this.write(entry);
    this.edit({ type, value: part === null ? values[0] : values }, done);
  }

  value({ type, input }) { return type === "orientation" ? +input.value * Math.PI / 180 : +input.value; }

  write({ type, input, output, unit }) {
    const { margin } = this.outline, number = shortened(+(+input.value).toPrecision(4));
    const fraction = type === "margin" && margin.is_fraction;
    output.textContent = fraction ? `${(100 * input.value).toFixed(1)} %` : `${number} ${type === "margin" ? printed(margin.unit) : unit}`;
  }

  show(outline, ends) {
    this.outline = outline;
    const { momentum, duration, margin, rpy, planar } = outline;
    const degrees = rpy && rpy.map(angle => angle * 180 / Math.PI);
    const values = { momentum, duration: [duration], margin: [margin.value], orientation: degrees };
    const limits = { ...ends, margin: [0, margin.is_fraction ? 0.99 : margin.largest], orientation: [-180, 180] };
    for (const entry of this.rows) {
      const { type, part, label, row, input } = entry;
      row.hidden = !values[type] || (planar && !IN_PLANE.includes(label));
      if (row.hidden || input === this.held) continue;
      const value = values[type][part || 0], [low, high] = limits[type];
      Object.assign(input, { min: Math.min(low, value), max: Math.max(high, value), value });
      this.write(entry);
    }
  }
}

// The measure over the time of the motion, with the margin, the limits and a cursor.
class Strip {
  constructor(canvas, seek) {
    Object.assign(this, { canvas, limits: [] });
    const point = event => {
      if (about && event.buttons) seek((event.offsetX / canvas.clientWidth) * about.duration);
    };
    canvas.addEventListener("pointerdown", event => { canvas.setPointerCapture(event.pointerId); point(event); });
    canvas.addEventListener("pointermove", point);
  }

  draw(time) {
    const { canvas } = this, { clientWidth: width, clientHeight: height } = canvas, ratio = devicePixelRatio || 1;
    [canvas.width, canvas.height] = [width * ratio, height * ratio];
    const context = canvas.getContext("2d");
    context.scale(ratio, ratio);
    if (!about) return;
    const { times, values } = about.scenes[0].trail, { margin, largest, measure } = about.scale;
    const x = t => t / about.duration * width, y = value => height - 3 - (height - 8) * value / (1.05 * largest);
    const line = (points, colour, dash = []) => {
      context.strokeStyle = colour;
      context.setLineDash(dash);
      context.beginPath();
      points.forEach(([a, b], i) => context[i ? "lineTo" : "moveTo"](a, b));
      context.stroke();
    };
    context.fillStyle = "#0b101a";
    context.fillRect(0, 0, width, height);
    context.lineWidth = 1.5;
    line(times.map((t, i) => [x(t), y(values[i])]), "#6ec1ff");
    line([[0, y(margin)], [width, y(margin)]], "#d55e00", [5, 4]);
    for (const { time: t, kept } of this.limits) line([[x(t), 0], [x(t), 9]], verdictColour(kept));
    line([[x(time), 0], [x(time), height]], "#fff");
    context.fillStyle = "#9fb0c8";
    context.font = "12px system-ui, sans-serif";
    context.fillText(`|${measure}|`, 6, height / 2);
  }
}

class Studio {
  constructor() {
    this.viewer = makeViewer();
    this.player = this.panels = this.state = this.outline = this.set = null;
    this.plays = this.moved = false;
    this.scenario = "";
    this.loading = Promise.resolve();
    this.connection = new Connection(message => this.receive(message), open => this.connected(open));
    const edit = (message, done) => this.connection.edit(message, done);
    this.handles = new Handles(this.viewer, (handle, position, done) => edit({ type: "handle", handle, position }, done));
    this.sliders = new Sliders(edit);
    this.strip = new Strip(element("strip"), time => { this.player.pause(); this.player.seek(time); });
    const hover = sample => this.explain(sample);
    this.ball = new Ball(element("ball"), hover, rotation_vector => this.choose({ rotation_vector }));
    this.dial = new Dial(element("dial"), hover, heading_deg => this.choose({ heading_deg }));
    this.makeButtons();
    this.viewer.controls.addEventListener("start", () => { this.moved = true; });
    new ResizeObserver(() => {
      this.viewer.set_3d_pane_size();
      if (this.player && !this.moved) this.player.look();
    }).observe(element("pane"));
    this.viewer.set_3d_pane_size();
    const frame = now => {
      requestAnimationFrame(frame);
      this.frame(now);
    };
    requestAnimationFrame(frame);
  }

  makeButtons() {
    const { connection } = this;
    for (const type of ["undo", "redo", "save"]) element(type).addEventListener("click", () => connection.send({ type }));
    element("scenario").addEventListener("change", event => connection.send({ type: "open", scenario: event.target.value }));
    element("best").addEventListener("click", () => this.choose({}));
    element("copy").addEventListener("click", async () => {
      await copy(this.state.text);
      this.notice("The scenario was copied.", true);
    });
    document.addEventListener("keydown", event => {
      const key = event.key.toLowerCase();
      if (!(event.ctrlKey || event.metaKey) || !["z", "y"].includes(key)) return;
      connection.send({ type: key === "y" || event.shiftKey ? "redo" : "undo" });
      event.preventDefault();
    });
  }

  connected(open) {
    this.open = open;
    if (!open) this.status({ busy: false });
  }

  receive(message) {
    const handlers = {
      state: this.showState, outline: this.showOutline, attitudes: this.showAttitudes, limits: this.showLimits,
      motion: this.queueMotion, status: this.status, reason: this.showReason, saved: this.showSaved,
      error: ({ text }) => this.notice(text), problem: ({ text }) => this.notice(text, false, true),
    };
    handlers[message.type].call(this, message);
  }

  status({ busy }) {
    element("status").classList.toggle("busy", busy);
    element("status").textContent = this.open === false ? "disconnected: is freefloat studio running?" : busy ? "planning" : "ready";
  }

  notice(text, good = false, lasting = false) {
    clearTimeout(this.vanishes);
    const notice = element("notice");
    Object.assign(notice, { textContent: text, hidden: false });
    notice.classList.toggle("good", good);
    if (!lasting) this.vanishes = setTimeout(() => { notice.hidden = true; }, SHOWN);
  }

  showState(state) {
    this.state = state;
    const select = element("scenario");
    if (select.options.length !== state.scenarios.length) {
      select.replaceChildren(...state.scenarios.map(name => new Option(name, name)));
    }
    select.value = state.scenario;
    element("undo").disabled = !state.undo;
    element("redo").disabled = !state.redo;
  }

  showOutline(outline) {
    this.outline = outline;
    this.handles.show(outline);
    this.sliders.show(outline, this.state.ends);
    element("notice").hidden = !element("notice").classList.contains("good");
    const scene = this.player && this.player.shown[0];
    for (const name of scene ? STALE : []) {
      const node = this.player.node(`${ROOT}/${scene.node}/${name}`);
      if (node) node.set_property("visible", false);
    }
    document.body.classList.add("stale");
  }

  showAttitudes(set) {
    this.set = set;
    const planar = set.kind === "dial";
    element("ball").hidden = planar;
    element("dial").toggleAttribute("hidden", !planar);
    (planar ? this.dial : this.ball).show(set);
    const ranges = (set.branches || []).filter(branch => branch.ranges).map(({ label, ranges }) =>
      `${label}: ${ranges.map(([low, high]) => `${low.toFixed(2)}° to ${high.toFixed(2)}°`).join(", ") || "none"}`);
    element("fraction").textContent = [set.text, ...ranges, ...set.remark ? [set.remark] : []].join("\n");
  }

  explain(sample) {
    if (sample < 0) element("reason").textContent = "";
    else this.connection.send({ type: "explain", samples: this.set.number, sample });
  }

  showReason({ text }) { element("reason").textContent = text; }

  choose(choice) {
    this.plays = true;
    this.connection.send({ type: "choose", ...choice });
  }

  showSaved({ file, reason, refused }) {
    if (refused) this.notice(refused);
    else this.notice(`Saved ${file}: ${reason}.`, true);
  }

  showLimits({ results }) {
    this.strip.limits = results;
    element("limits").replaceChildren(...results.map(({ limit, kept, text, time }) => {
      const row = document.createElement("tr");
      for (const cell of [`${kept ? "✓" : "✗"} ${limit}`, text]) row.insertCell().textContent = cell;
      row.style.color = verdictColour(kept);
      row.addEventListener("click", () => { this.player.pause(); this.player.seek(time); });
      return row;
    }));
    this.viewer.set_dirty();
  }

  // Scenes are loaded one after another; of those that wait only the last one.
  queueMotion(motion) {
    this.newest = motion;
    this.showLimits({ results: [] });
    this.loading = this.loading.then(() => motion === this.newest && this.showMotion(motion));
  }

  async showMotion(motion) {
    const before = this.player;
    this.player = null; // until the scene is complete
    this.viewer.delete_path([ROOT]);
    element("outcome").textContent = [motion.title, motion.outcome].filter(text => text).join(": ");
    this.ball.mark = motion.rotation_vector;
    this.dial.mark = motion.heading_deg;
    if (this.set) (this.set.kind === "dial" ? this.dial : this.ball).draw();
    about = motion.about || null;
    if (about) {
      const player = await loadScene(this.viewer, motion.scene, motion.tracks);
      if (before) Object.assign(player, { time: before.time, speed: before.speed, hidden: before.hidden });
      this.start(player);
    } else {
      element("states").textContent = motion.outcome;
    }
    document.body.classList.remove("stale");
    this.viewer.set_dirty();
  }

  start(player) {
    this.player = player;
    if (this.panels) this.panels.show(player); else this.panels = new Panels(player, null);
    const opened = this.scenario !== this.state.scenario;
    this.scenario = this.state.scenario;
    if (opened) this.moved = false;
    if (opened || !this.moved) player.look();
    player.arrange();
    if (opened || this.plays) player.seek(0);
    if (this.plays) player.play();
    this.plays = false;
  }

  frame(now) {
    const { player, viewer } = this;
    if (player) player.tick(now);
    if (!viewer.needs_render) return;
    viewer.render();
    if (player) this.panels.update();
    this.handles.place();
    this.strip.draw(player ? player.time : 0);
  }
}

const studio = new Studio();
