// Plays a scene with MeshCat's viewer and scene tree: time, what is shown, what is said.

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 5, 10, 20, 50, 100];
const MAX_PLAYBACK = 30; // initial playback [s], see scene.py
const SIDE_BY_SIDE = "side by side";
const ALL_PHASES = "all phases";

class Player {
  constructor(viewer) {
    this.viewer = viewer;
    this.time = 0;
    this.playing = false;
    this.view = 0;
    this.speed = SPEEDS.find(speed => about.duration / speed <= MAX_PLAYBACK) || SPEEDS.at(-1);
    this.shown = about.scenes.length ? [about.scenes[0]] : [];
    this.follows = about.sequence; // shows the phase of the present time
    this.hidden = new Set(about.items.filter(item => !item.visible).map(item => item.name));
    this.trails = new Map(about.scenes.map(scene => [scene, this.geometries(scene)]));
  }

  // The node of the scene tree at a path, or undefined (MeshCat's search creates missing nodes).
  node(path) {
    const names = path.split("/").filter(name => name);
    return names.reduce((node, name) => node && node.children[name], this.viewer.scene_tree);
  }

  sceneNode(scene) { return this.node(`${ROOT}/${scene.node}`); }

  // Those of the trails of all end-effectors.
  geometries(scene) {
    const trails = scene.trail && this.node(`${ROOT}/${scene.node}/Trail`), found = [];
    if (trails) trails.object.traverse(part => part.geometry && found.push(part.geometry));
    return found;
  }

  // Offset of a scene: several scenes form a row across the initial line of sight.
  offset(scene) {
    const place = this.shown.indexOf(scene) - (this.shown.length - 1) / 2;
    const [x, y] = about.view.direction, level = Math.hypot(x, y);
    const across = about.view.flat ? [1, 0, 0] : [-y / level, x / level, 0];
    return across.map((part, i) => scene.origin[i] + part * place * 2.05 * about.view.radius);
  }

  show(title) {
    this.follows = title === ALL_PHASES;
    this.shown = about.scenes.filter(scene => title === SIDE_BY_SIDE || scene.title === title);
    if (this.follows) this.shown = [this.phase()];
    else if (about.sequence) this.time = this.shown[0].begin;
    if (!this.shown.length) throw new Error(`there is no motion ${title}`);
    this.arrange();
    this.look();
  }

  // The phase of the present time.
  phase() { return about.scenes.findLast(scene => scene.begin <= this.time) || about.scenes[0]; }

  arrange() {
    for (const scene of about.scenes) {
      const { object } = this.sceneNode(scene);
      this.sceneNode(scene).set_property("visible", this.shown.includes(scene));
      if (this.shown.includes(scene)) object.position.set(...this.offset(scene));
      for (const { name } of about.items) {
        const item = this.node(`${ROOT}/${scene.node}/${name}`);
        if (item) item.set_property("visible", !this.hidden.has(name));
      }
    }
    this.seek(this.time);
  }

  // Whether a shown scene has an item.
  has(name) { return this.shown.some(scene => this.node(`${ROOT}/${scene.node}/${name}`)); }

  toggle(name, visible) {
    if (!about.items.some(item => item.name === name)) throw new Error(`there is no item ${name}`);
    if (visible) this.hidden.delete(name); else this.hidden.add(name);
    this.arrange();
  }

  // Looks from one of VIEWS, 0 is the first.
  look(number = this.view) {
    this.view = number;
    lookFrom(this, VIEWS[number]);
  }

  seek(time) {
    this.time = Math.min(Math.max(time, 0), about.duration);
    if (this.follows && this.shown[0] !== this.phase()) {
      this.shown = [this.phase()];
      this.arrange();
      return;
    }
    this.viewer.animator.seek(this.time);
    for (const [scene, geometries] of this.trails) {
      for (const geometry of geometries) {
        const rings = countUpTo(scene.trail.times, this.time);
        geometry.setDrawRange(0, Math.max(0, rings - 1) * scene.trail.indices);
      }
    }
    this.viewer.set_dirty();
  }

  play() {
    if (this.time >= about.duration) this.seek(0);
    this.playing = about.duration > 0;
    this.before = performance.now();
    this.viewer.set_dirty(); // the button shows the state
  }

  pause() {
    this.playing = false;
    this.viewer.set_dirty();
  }

  // Steps are limited to 0.25 s, so that time does not jump after the tab was hidden.
  tick(now) {
    if (!this.playing) return;
    this.seek(this.time + this.speed * Math.min((now - this.before) / 1000, 0.25));
    this.before = now;
    if (this.time >= about.duration) this.pause();
  }

  // Text of a scene at the current time, with limits that were checked after it was made.
  lines(scene, limits) {
    if (!scene.trail) return scene.lines || [];
    const { times, values, fractions } = scene.trail, { measure } = about.scale;
    const ended = this.time >= scene.end;
    const now = table => ended ? table.at(-1) : interpolated(times, table, this.time);
    const value = now(values) < 1e-9 * about.scale.largest ? 0 : now(values); // singular
    const lines = [
      `t = ${clock(Math.min(Math.max(this.time, scene.begin), scene.end))} s`,
      ...fractions ? [`s = ${now(fractions).toFixed(3)}`] : [],
      `|${measure}| = ${shortened(value)}` + (scene.margin > 0 ? `, margin ${shortened(scene.margin)}` : ""),
      ...scene.lines.map(warning => ({ verdict: warning, feasible: false })),
    ];
    return ended ? [...lines, { verdict: scene.verdict, feasible: keeps(scene, limits) }] : lines;
  }
}
