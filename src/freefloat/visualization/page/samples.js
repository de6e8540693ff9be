// The samples of a map: the pointer shows one, a click keeps it.

const REACH = 8; // from the pointer to a sample that it shows [pixels]

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
