// The studio's page: it sends what the user does and shows what the server answers.

"use strict";
let about = null; // the scene shown, read by the scripts of pages
const SHOWN = 8000; // time of a notice [ms]
const UNREACHED = "#738099"; // as in attitudes.py
const STILL = matchMedia("(prefers-reduced-motion: reduce)").matches; // nothing plays by itself
const STALE = ["End-effector path", "Trail", "Singularity"]; // items that an edit changes

class Studio {
  constructor() {
    this.viewer = makeViewer();
    this.player = this.panels = this.state = this.outline = this.set = null;
    this.moved = false;
    this.scenario = "";
    this.loading = Promise.resolve();
    this.connection = new Connection(message => this.receive(message), open => this.connected(open));
    const edit = (message, done) => this.known && this.connection.edit(message, done);
    this.handles = new Handles(this.viewer, (handle, position, done) => {
      this.moved = true; // the view stays as it is under the pointer
      edit({ type: "handle", handle, position }, done);
    });
    this.sliders = new Sliders(edit);
    this.plot = new Plot(element("plot"));
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
      error: this.showError, problem: this.showProblem,
    };
    handlers[message.type].call(this, message);
    if (message.type === "outline") this.stale = true;
    if (message.type === "motion") this.stale = false;
    if (message.type === "status" || !this.busy) return;
    this.arrived = message.type;
    this.status({ busy: true });
  }

  // Says what is under way, which follows from what has arrived.
  status({ busy, compiling = false }) {
    const planning = this.outline?.is_goal ? "searching for a motion, up to half a minute" : "computing attitudes and a motion";
    const stage = !this.known ? "reading the scenario" : {
      motion: "checking limits", limits: "computing more attitudes", attitudes: this.stale ? planning : "computing more attitudes",
    }[this.arrived] || planning;
    element("status").classList.toggle("busy", busy);
    element("status").textContent = this.open === false ? "disconnected: is freefloat studio running?"
      : !busy ? "ready" : compiling ? "compiling kernels, once per machine" : stage;
    this.busy = busy;
  }

  notice(text, good = false, lasting = false) {
    clearTimeout(this.vanishes);
    const notice = element("notice");
    Object.assign(notice, { textContent: text, hidden: false });
    notice.classList.toggle("good", good);
    if (!lasting) this.vanishes = setTimeout(() => { notice.hidden = true; }, SHOWN);
  }

  showProblem({ text }) {
    document.body.classList.remove("loading");
    this.notice(text, false, true);
  }

  // What was refused is shown as it was before.
  showError({ text }) {
    this.notice(text);
    if (this.state) this.showState(this.state);
    if (this.known) this.showControls();
  }

  showState(state) {
    if (this.state && state.scenario !== this.state.scenario) this.clear();
    this.state = state;
    this.known = state.outlined; // whether the handles and sliders are those of this scenario
    this.played ??= state.choice; // before this page was opened
    const select = element("scenario");
    if (select.options.length !== state.scenarios.length) {
      select.replaceChildren(...state.scenarios.map(name => new Option(name, name)));
    }
    select.value = state.scenario;
    element("undo").disabled = !state.undo;
    element("redo").disabled = !state.redo;
  }

  // Removes what belongs to another scenario.
  clear() {
    this.player = this.set = this.newest = this.ball.mark = this.dial.mark = this.ball.now = this.dial.now = null;
    this.viewer.delete_path([ROOT]);
    this.handles.show({ lines: [], handles: [] });
    this.showLimits({ results: [] });
    for (const id of ["states", "outcome", "fraction", "reason"]) element(id).textContent = "";
    element("key").replaceChildren();
    element("sliders").classList.remove("known");
    for (const id of ["ball", "dial"]) element(id).toggleAttribute("hidden", true);
    document.body.classList.add("still", "loading");
  }

  showOutline(outline) {
    this.outline = outline;
    this.known = true;
    this.showControls();
    element("notice").hidden = !element("notice").classList.contains("good");
    const scene = this.player && this.player.shown[0];
    for (const name of scene ? STALE : []) {
      const node = this.player.node(`${ROOT}/${scene.node}/${name}`);
      if (node) node.set_property("visible", false);
    }
    document.body.classList.add("stale");
  }

  showControls() {
    element("initial").hidden = this.outline.is_goal;
    element("sliders").classList.add("known");
    element("edited").textContent = this.outline.is_goal ? "Goal" : "Path and margin";
    this.handles.show(this.outline);
    this.sliders.show(this.outline, this.state.ends);
  }

  showAttitudes(set) {
    this.set = set;
    element("reason").textContent = "";
    const planar = set.kind === "dial";
    element("ball").hidden = planar;
    element("dial").toggleAttribute("hidden", !planar);
    (planar ? this.dial : this.ball).show(set);
    const ranges = (set.branches || []).filter(branch => branch.ranges).map(({ label, ranges }) =>
      `${label}: ${ranges.map(([low, high]) => `${low.toFixed(2)}° to ${high.toFixed(2)}°`).join(", ") || "none"}`);
    const marks = [...set.present ? ["◇ present attitude"] : [], "○ initial attitude", "● attitude now"].map(mark => mark.replaceAll(" ", "\u00a0"));
    element("key").replaceChildren(
      ...legendOf(set.scale), colourKey("start of the path not reached", UNREACHED),
      textElement("div", marks.join("  ")));
    element("fraction").textContent = [set.text, ...ranges, ...set.remark ? [set.remark] : []].join("\n");
  }

  explain(sample) {
    if (sample < 0) element("reason").textContent = "";
    else this.connection.send({ type: "explain", samples: this.set.number, sample });
  }

  showReason({ text }) { element("reason").textContent = text; }

  choose(choice) { this.connection.send({ type: "choose", ...choice }); }

  showSaved({ file, reason, contact, refused }) {
    if (refused) this.notice(refused);
    else this.notice(`Saved ${file}: ${reason}.${contact ? ` Warning: ${contact}.` : ""}`, !contact);
  }

  showLimits({ results }) {
    this.plot.marks = results;
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
    this.loading = this.loading.then(() => motion === this.newest && this.showMotion(motion))
      .catch(error => this.notice(`The motion cannot be shown: ${error}`));
  }

  async showMotion(motion) {
    const before = this.player;
    this.player = null; // until the scene is complete
    this.viewer.delete_path([ROOT]);
    element("outcome").textContent = [motion.title, motion.outcome].filter(text => text).join(": ");
    this.ball.mark = motion.rotation_vector;
    this.dial.mark = motion.heading_deg;
    this.ball.now = this.dial.now = null;
    if (this.set) (this.set.kind === "dial" ? this.dial : this.ball).draw();
    about = motion.about || null;
    if (about) {
      const player = await loadScene(this.viewer, motion.scene, motion.tracks);
      if (!this.newest) { // another scenario was opened
        this.viewer.delete_path([ROOT]);
        return;
      }
      const same = before && this.scenario === this.state.scenario;
      if (same) Object.assign(player, { time: before.time, speed: before.speed, hidden: before.hidden });
      this.start(player, motion.choice, same && before.playing);
    } else {
      element("states").textContent = motion.outcome;
    }
    document.body.classList.remove("stale", "loading");
    document.body.classList.toggle("still", !about);
    this.viewer.set_dirty();
  }

  // Shows a scene that was loaded; a motion that was chosen plays from its start.
  start(player, choice, playing) {
    this.player = player;
    if (this.panels) this.panels.show(player); else this.panels = new Panels(player, null, this.plot);
    const opened = this.scenario !== this.state.scenario, chosen = choice !== this.played;
    this.scenario = this.state.scenario;
    this.played = choice;
    if (opened) this.moved = false;
    if (!this.moved) player.look();
    player.arrange();
    if (opened || chosen) player.seek(0);
    if ((chosen && !STILL) || playing) player.play();
  }

  // Shows the attitude at the time of the page on the ball and the dial.
  markAttitude() {
    const { player, newest, set } = this, [scene] = player ? player.shown : [];
    if (!scene || !newest || !set) return;
    const { normal } = this.outline, { quaternion } = player.node(`${ROOT}/${scene.node}/Spacecraft axes`).object;
    const turn = quaternion.clone().multiply(new MeshCat.THREE.Quaternion(...newest.attitude).conjugate());
    this.ball.now = rotationVector(quaternion);
    this.dial.now = normal && newest.heading_deg + along(rotationVector(turn), normal) * 180 / Math.PI;
    (set.kind === "dial" ? this.dial : this.ball).draw();
  }

  frame(now) {
    const { player, viewer } = this;
    if (player) player.tick(now);
    if (!viewer.needs_render) return;
    viewer.render();
    this.handles.place();
    if (player) this.panels.update(); // labels stand beside handles
    element("outcome").style.color = !player || keeps(player.shown[0], this.plot.marks) ? "" : verdictColour(false);
    this.markAttitude();
  }
}

let studio = null;
try {
  studio = new Studio();
} catch (error) {
  element("states").textContent = `The scene cannot be shown: ${error}. It needs WebGL.`;
}
