// Plays a scene with MeshCat's viewer, scene tree and camera; clock and panels are defined here.

const ROOT = "meshcat";
const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 5, 10, 20, 50, 100];
const MAX_PLAYBACK = 30; // initial playback [s], see scene.py
const SIDE_BY_SIDE = "side by side";
const ALL_PHASES = "all phases";
const INK = "#e8ecf2";
const FIELD_OF_VIEW = 40; // degrees
const FRAME = 0.88; // fraction of the picture that the scene fills
const WIDE = 1.2; // width over height of views with panels beside the scenes, not above and below them
const PANELS = ["states", "legend"];
const GAP = 12; // between a label and its point, or a panel and the scenes [pixels]
const REACH = 8; // from the pointer to a sample that it shows [pixels]
const element = id => document.getElementById(id);

async function unpacked(text) {
  const raw = Uint8Array.from(atob(text), letter => letter.charCodeAt(0));
  const stream = new Blob([raw]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// Yields the bytes of each command, which follow their length.
function* commands(bytes) {
  const view = new DataView(bytes.buffer);
  for (let at = 0; at < bytes.length;) {
    const length = view.getUint32(at, true);
    yield bytes.slice(at + 4, at + 4 + length);
    at += 4 + length;
  }
}

class Player {
  constructor(viewer) {
    this.viewer = viewer;
    this.time = 0;
    this.playing = false;
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

  // Sets the initial direction and the smallest distance at which the scenes fit in the picture, in
  // a narrow one between the panels, which leave at least two fifths of it.
  look() {
    const { camera, controls, renderer } = this.viewer, { centre, direction } = about.view;
    const { clientWidth, clientHeight } = renderer.domElement;
    const inset = clientWidth < WIDE * clientHeight ? 2 * Math.max(...PANELS.map(id => element(id).offsetHeight + GAP)) : 0;
    const tangent = Math.tan(FIELD_OF_VIEW * Math.PI / 360), across = tangent * FRAME * clientWidth / clientHeight;
    const up = tangent * Math.min(FRAME, Math.max(1 - inset / clientHeight, 0.4));
    const length = Math.hypot(...direction), toEye = direction.map(part => part / length);
    const level = Math.hypot(toEye[0], toEye[1]);
    const right = [-toEye[1] / level, toEye[0] / level, 0];
    const above = [toEye[1] * right[2] - toEye[2] * right[1], toEye[2] * right[0] - toEye[0] * right[2],
      toEye[0] * right[1] - toEye[1] * right[0]];
    const along = (axis, point) => axis.reduce((sum, part, i) => sum + part * point[i], 0);
    const shifts = this.shown.map(scene => this.offset(scene).map((part, i) => part - scene.origin[i] - centre[i]));
    const points = shifts.flatMap(shift => about.view.points.map(point => point.map((part, i) => part + shift[i])));
    // Smallest distance at which the points fit between two edges, and the shift of the target.
    const fit = (axis, slope) => {
      const [first, second] = [-1, 1].map(sign => points.reduce((most, point) =>
        Math.max(most, sign * along(axis, point) / slope + along(toEye, point)), -Infinity));
      return [(first + second) / 2, slope * (second - first) / 2];
    };
    const [[wide, aside], [high, raised]] = [fit(right, across), fit(above, up)];
    const distance = Math.max(wide, high, 1e-3);
    const target = centre.map((part, i) => part + aside * right[i] + raised * above[i]);
    const [x, y, z] = target.map((part, i) => part + toEye[i] * distance);
    camera.fov = FIELD_OF_VIEW;
    camera.near = distance / 500;
    camera.far = distance * 50;
    camera.position.set(x, z, -y);
    controls.target.set(target[0], target[2], -target[1]);
    camera.updateProjectionMatrix();
    controls.update();
    this.viewer.set_dirty();
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

  // Text of a scene at the current time.
  lines(scene) {
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
    return ended ? [...lines, { verdict: scene.verdict, feasible: scene.ending === "completed" }] : lines;
  }

  // Visible labels with their positions on a canvas [pixels].
  labels(width, height) {
    const { camera } = this.viewer, placed = [];
    for (const scene of this.shown) {
      for (const label of scene.labels) {
        if (this.time < label.since || this.hidden.has(label.item)) continue;
        const { object } = this.node(`${ROOT}/${scene.node}/${label.node}`);
        const point = new MeshCat.THREE.Vector3(...label.position);
        object.localToWorld(point).project(camera); // the viewer's world has y up
        if (Math.abs(point.z) > 1) continue;
        placed.push({ text: label.text, colour: label.colour, x: (1 + point.x) * width / 2, y: (1 - point.y) * height / 2 });
      }
    }
    return placed;
  }
}

// What the clock shows at a time of the page.
function clock(time) { return (time + about.start).toFixed(2).replace(/^-0\.00$/, "0.00"); }

function countUpTo(sorted, value) {
  let low = 0, high = sorted.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (sorted[middle] <= value) low = middle + 1; else high = middle;
  }
  return low;
}

// Linear interpolation in a table.
function interpolated(times, values, time) {
  const next = Math.min(countUpTo(times, time), times.length - 1), last = Math.max(next - 1, 0);
  const span = times[next] - times[last];
  const fraction = span > 0 ? Math.min(Math.max((time - times[last]) / span, 0), 1) : 1;
  return values[last] + fraction * (values[next] - values[last]);
}

function shortened(value) {
  const size = Math.abs(value);
  return size !== 0 && (size < 1e-3 || size >= 1e5) ? value.toExponential(2) : String(+value.toPrecision(4));
}

// Copies a text, also where the clipboard is refused: in frames and on insecure pages.
async function copy(text) {
  try {
    await navigator.clipboard.writeText(text);
  } catch {
    const area = document.createElement("textarea");
    area.value = text;
    document.body.append(area);
    area.select();
    document.execCommand("copy");
    area.remove();
  }
}

function plainLine(line) { return typeof line === "string" ? line : line.verdict; }

function verdictColour(feasible) { return feasible ? "#9be3a0" : "#ffb27a"; }

function lineColour(line) { return typeof line === "string" ? INK : verdictColour(line.feasible); }

// A unit with superscripts; empty without a unit.
function printed(unit) {
  return unit === "1" ? "" : unit.replace(/\^(-?\d+)/g, (_, power) =>
    [...power].map(digit => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(digit)]).join(""));
}

function unit() { return printed(about.scale.unit); }

// The samples of a map: the pointer shows one, a click keeps it.
class SamplePicker {
  static async of(player, packed) {
    const arrays = [...commands(await unpacked(packed))].map(bytes => new Float32Array(bytes.buffer));
    return new SamplePicker(player, ...arrays);
  }

  constructor(player, points, margins) {
    Object.assign(this, { player, points, margins, current: -1, pinned: false });
    const pane = element("meshcat-pane");
    let down = null;
    pane.addEventListener("pointerdown", event => { down = event; });
    pane.addEventListener("pointermove", event => {
      if (!this.pinned && !event.buttons) this.select(this.nearest(event.offsetX, event.offsetY), false);
    });
    pane.addEventListener("pointerup", event => {
      if (!down || Math.hypot(event.clientX - down.clientX, event.clientY - down.clientY) > 4) return;
      const sample = this.nearest(event.offsetX, event.offsetY);
      this.select(sample, sample >= 0 && !(this.pinned && sample === this.current));
    });
  }

  point(sample) { return this.points.subarray(3 * sample, 3 * sample + 3); }

  row(sample) {
    const { length } = about.samples.columns;
    return this.margins.subarray(length * sample, length * sample + length);
  }

  // Whether the page shows a sample: maps over attitudes draw them in three items.
  visible(sample) {
    const { columns, parts } = about.samples, row = this.row(sample);
    if (!parts) return true;
    const column = columns.indexOf(this.player.shown[0].title);
    const margin = column < 0 ? Math.max(...row) : row[column];
    const part = margin < 0 ? 3 : !feasible(margin) ? 2 : this.point(sample)[1] < 0 ? 0 : 1;
    return !this.player.hidden.has(parts[part]);
  }

  // Function from a sample to its pixel and depth, fast enough for all samples at each move of the pointer.
  projection() {
    const { camera, scene } = this.player.viewer, { clientWidth, clientHeight } = element("meshcat-pane");
    camera.updateMatrixWorld();
    const matrix = camera.matrixWorldInverse.clone().multiply(scene.matrixWorld);
    matrix.premultiply(camera.projectionMatrix);
    const point = new MeshCat.THREE.Vector3();
    return sample => {
      point.fromArray(this.points, 3 * sample).applyMatrix4(matrix);
      return { x: (1 + point.x) * clientWidth / 2, y: (1 - point.y) * clientHeight / 2, depth: point.z };
    };
  }

  // The foremost sample near a pixel, or -1; over headings the nearest one.
  nearest(x, y) {
    const place = this.projection(), { flat } = about.view;
    let best = Infinity, found = -1;
    for (let sample = 0; sample < this.points.length / 3; sample++) {
      const pixel = place(sample), distance = Math.hypot(pixel.x - x, pixel.y - y);
      const rank = flat ? distance : pixel.depth;
      if (rank < best && (flat || distance < REACH) && this.visible(sample)) [best, found] = [rank, sample];
    }
    return found;
  }

  select(sample, pinned) {
    if (sample === this.current && pinned === this.pinned) return;
    Object.assign(this, { current: sample, pinned });
    this.fill();
    this.player.viewer.set_dirty();
  }

  // Quaternion x, y, z, w of a sample, and its heading in degrees on maps over headings.
  attitude(sample) {
    const [x, y, z] = this.point(sample);
    if (about.samples.parts) {
      const angle = Math.hypot(x, y, z), along = angle > 0 ? Math.sin(angle / 2) / angle : 0;
      return { quaternion: [x * along, y * along, z * along, Math.cos(angle / 2)] };
    }
    const heading = (Math.atan2(y, x) + 2 * Math.PI) % (2 * Math.PI);
    return { quaternion: [0, 0, Math.sin(heading / 2), Math.cos(heading / 2)],
      heading: `${+(heading * 180 / Math.PI).toFixed(4)}` };
  }

  fill() {
    const panel = element("sample");
    panel.hidden = element("ring").hidden = this.current < 0;
    if (panel.hidden) return;
    const { quaternion, heading } = this.attitude(this.current);
    const attitude = quaternion.map(part => part.toFixed(6)).join(" ");
    const text = document.createElement("p"), table = document.createElement("table");
    text.innerText = (heading ? `heading ${heading}°\n` : "") + `attitude x y z w\n${attitude}`;
    this.row(this.current).forEach((margin, column) => {
      const row = table.insertRow(), ending = margin < 0 ? "start not reached" : "ends early";
      row.insertCell().textContent = about.samples.columns[column];
      row.insertCell().textContent = margin > 0 ? shortened(margin) : ending;
      row.style.color = verdictColour(feasible(margin));
    });
    panel.replaceChildren(text, table, this.pinned ? this.copyButton(heading || attitude) : "click to keep this");
  }

  copyButton(text) {
    const button = document.createElement("button");
    button.textContent = "Copy";
    button.title = `Copy ${text}`;
    button.addEventListener("click", async () => {
      await copy(text);
      button.textContent = "Copied";
    });
    return button;
  }

  // Puts the ring around the current sample.
  mark() {
    if (this.current < 0) return;
    const { x, y } = this.projection()(this.current);
    Object.assign(element("ring").style, { left: `${x}px`, top: `${y}px` });
  }
}

// The margin is kept up to rounding; see keeps_threshold in margin.py.
function feasible(value) { return value > 0 && value >= about.scale.margin * (1 - 1e-6); }

// The panels around the 3D view.
class Panels {
  constructor(player, picker) {
    this.picker = picker;
    this.makeBar();
    this.show(player);
  }

  // Fills the panels for the scene of a player.
  show(player) {
    this.player = player;
    this.makeItems();
    this.makeChoices();
    this.makeLegend();
  }

  makeItems() {
    element("items").replaceChildren(element("items").firstElementChild); // its summary
    for (const { name } of about.items) {
      const box = document.createElement("input"), label = document.createElement("label");
      box.type = "checkbox";
      box.name = name;
      box.addEventListener("change", () => this.player.toggle(name, box.checked));
      label.append(box, ` ${name}`);
      element("items").append(label);
    }
  }

  makeBar() {
    for (const speed of SPEEDS) element("speed").add(new Option(`${speed}×`, speed));
    element("play").addEventListener("click", () => this.playOrPause());
    element("time").addEventListener("input", event => {
      this.player.pause();
      this.player.seek(+event.target.value);
    });
    element("speed").addEventListener("change", event => { this.player.speed = +event.target.value; });
    element("motion").addEventListener("change", event => this.player.show(event.target.value));
    element("view").addEventListener("click", () => this.player.look());
    element("picture").addEventListener("click", () => savePicture(this.player));
    document.addEventListener("keydown", event => this.key(event));
  }

  makeChoices() {
    const motions = element("motion"), still = about.duration === 0;
    for (const id of ["play", "time", "clock", "speed"]) element(id).hidden = still;
    element("time").max = about.duration;
    const titles = about.scenes.map(scene => scene.title);
    if (about.sequence) titles.unshift(ALL_PHASES);
    else if (titles.length > 1 && !still) titles.push(SIDE_BY_SIDE);
    motions.replaceChildren(...titles.map(title => new Option(title, title)));
    motions.hidden = titles.length < 2;
  }

  makeLegend() {
    const { entries, stops, below, margin, largest } = about.scale, legend = element("legend");
    legend.replaceChildren();
    if (entries) {
      legend.append(...entries.map(([text, colour]) => this.colourKey(text, colour)));
      return;
    }
    const bar = document.createElement("div"), ends = document.createElement("div");
    bar.className = "bar";
    bar.style.background = `linear-gradient(to right, ${stops.join(", ")})`;
    ends.className = "ends";
    for (const value of [margin, largest]) {
      const end = document.createElement("span");
      end.textContent = shortened(value);
      ends.append(end);
    }
    legend.append(`|${about.scale.measure}|` + (unit() && ` [${unit()}]`), ...stops.length ? [bar, ends] : []);
    if (margin > 0) legend.append(this.colourKey(`below the margin ${shortened(margin)} ${unit()}${about.scale.limited ? " or beyond a limit" : ""}`, below));
  }

  colourKey(text, colour) {
    const key = document.createElement("div");
    key.className = "key";
    key.style.setProperty("--colour", colour);
    key.textContent = text;
    return key;
  }

  playOrPause() { if (this.player.playing) this.player.pause(); else this.player.play(); }

  key(event) {
    const { player } = this, { tagName, id } = event.target;
    if (["INPUT", "SELECT", "BUTTON", "SUMMARY"].includes(tagName) && id !== "time" && event.key === " ") return;
    const step = about.duration / 100;
    const jumps = { ArrowLeft: player.time - step, ArrowRight: player.time + step, Home: 0, End: about.duration };
    if (event.key === " ") { this.playOrPause(); event.preventDefault(); }
    if (event.key in jumps && tagName !== "SELECT") {
      player.pause();
      player.seek(jumps[event.key]);
      event.preventDefault();
    }
  }

  update() {
    const { player } = this;
    element("play").textContent = player.playing ? "Pause" : "Play";
    element("time").value = player.time;
    element("clock").textContent = `${clock(player.time)} / ${clock(about.duration)} s`;
    element("speed").value = player.speed;
    const one = player.follows ? ALL_PHASES : (player.shown[0] || {}).title;
    element("motion").value = player.shown.length > 1 ? SIDE_BY_SIDE : one;
    for (const box of element("items").querySelectorAll("input")) {
      box.checked = !player.hidden.has(box.name);
      box.parentElement.hidden = !player.has(box.name);
    }
    element("states").classList.toggle("several", player.shown.length > 1);
    element("states").replaceChildren(...player.shown.map(scene => this.state(scene)));
    this.placeLabels();
    if (this.picker) this.picker.mark();
  }

  state(scene) {
    const section = document.createElement("section"), title = document.createElement("h2");
    title.textContent = scene.title;
    section.append(title);
    for (const line of this.player.lines(scene)) {
      const row = document.createElement("p");
      row.textContent = plainLine(line);
      row.style.color = lineColour(line);
      section.append(row);
    }
    return section;
  }

  // Puts each label beside its point where it covers nothing, or leaves it out.
  placeLabels() {
    const pane = element("meshcat-pane").getBoundingClientRect(), { width, height } = pane;
    const points = this.player.labels(width, height);
    const labels = points.map(({ text, colour }) => {
      const label = document.createElement("div");
      label.className = "label";
      label.textContent = text;
      label.style.color = colour;
      return label;
    });
    element("labels").replaceChildren(...labels);
    const sizes = labels.map(label => [label.offsetWidth, label.offsetHeight]);
    const taken = [...document.querySelectorAll("#pane .panel, .handle")].map(part => {
      const { left, top, right, bottom } = part.getBoundingClientRect();
      return box(left - pane.left, top - pane.top, right - left, bottom - top);
    });
    points.forEach(({ x, y }, number) => {
      const [across, down] = sizes[number], rows = [0, 1, -1, 2, -2].map(row => y + (row - 0.5) * down);
      const beside = rows.flatMap(top => [x + GAP, x - GAP - across].map(left => box(left, top, across, down)));
      const place = beside.find(one => one.left >= 0 && one.top >= 0 && one.right <= width && one.bottom <= height
        && !taken.some(other => overlap(one, other)));
      labels[number].hidden = !place;
      if (!place) return;
      taken.push(place);
      Object.assign(labels[number].style, { left: `${place.left}px`, top: `${place.top}px` });
    });
  }
}

function box(left, top, across, down) { return { left, top, right: left + across, bottom: top + down }; }

function overlap(a, b) { return a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom; }

// The 3D view as a PNG.
function picture(player) {
  player.viewer.render();
  return player.viewer.renderer.domElement.toDataURL("image/png");
}

function savePicture(player) {
  const link = document.createElement("a");
  link.href = picture(player);
  link.download = `${about.title.replaceAll(/[^\w.-]+/g, "_")}_${clock(player.time)}s.png`;
  link.click();
}

// The viewer of a page, without a scene.
function makeViewer() {
  const pane = element("meshcat-pane"), viewer = new MeshCat.Viewer(pane, false);
  viewer.fit = viewer.set_3d_pane_size; // its default is the window's size
  viewer.set_3d_pane_size = () => viewer.fit(pane.clientWidth, pane.clientHeight);
  return viewer;
}

// Runs the commands of the scene that about describes; returns its player.
async function loadScene(viewer, scene, tracks) {
  const run = async packed => {
    for (const command of packed ? commands(await unpacked(packed)) : []) viewer.handle_command_bytearray(command);
  };
  await run(scene);
  for (const [source, target] of about.copies) {
    const [original, copy] = [source, target].map(path => viewer.scene_tree.find([...path.split("/"), "<object>"]));
    copy.set_object(original.object.clone());
  }
  await run(tracks); // tracks need existing objects
  const { animator } = viewer;
  animator.play(); // required before the first seek
  animator.pause();
  return new Player(viewer);
}

async function begin() {
  const viewer = makeViewer(), pane = element("meshcat-pane");
  const player = await loadScene(viewer, element("scene").textContent, element("tracks").textContent);
  const picker = about.samples && await SamplePicker.of(player, element("samples").textContent);
  const panels = new Panels(player, picker);
  const frame = now => {
    requestAnimationFrame(frame);
    player.tick(now);
    if (!viewer.needs_render) return;
    viewer.render();
    panels.update();
  };
  viewer.set_3d_pane_size();
  player.arrange();
  player.look();
  if (about.opens) {
    player.show(about.opens);
    element("motion").value = about.opens;
  }
  let moved = false; // whether the user has changed the view
  viewer.controls.addEventListener("start", () => { moved = true; });
  new ResizeObserver(() => {
    viewer.set_3d_pane_size();
    if (!moved) player.look();
  }).observe(pane);
  requestAnimationFrame(frame);
  window.freefloat = api(player, panels);
}

// Interface for pictures, videos and tests.
function api(player, panels) {
  const placed = path => {
    const node = player.node(path);
    if (!node) throw new Error(`there is no ${path}`);
    node.object.updateWorldMatrix(true, false);
    return node.object;
  };
  const position = path => { // in the frame of the scene, z up
    const point = new MeshCat.THREE.Vector3().setFromMatrixPosition(placed(path).matrixWorld);
    return player.viewer.scene.worldToLocal(point).toArray();
  };
  return {
    about,
    state: () => ({ time: player.time, shown: player.shown.map(scene => scene.title) }),
    seek: time => { player.pause(); player.seek(time); player.viewer.render(); panels.update(); },
    show: title => player.show(title),
    toggle: (name, visible) => player.toggle(name, visible),
    position,
    visible: path => placed(path).visible,
    capture: title => { // hides the controls
      document.body.classList.add("capturing");
      player.viewer.set_3d_pane_size();
      if (title !== null) player.show(title);
      player.look();
    },
    picture: () => picture(player),
  };
}
