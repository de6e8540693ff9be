// Handles of the path over the 3D view: they move in the plane parallel to the picture or, for
// planar tasks, in the plane of motion.

class Handles {
  // The callback gets the number of a handle, its position and whether the gesture is done.
  constructor(viewer, moved) {
    Object.assign(this, { viewer, moved, outline: null, buttons: [], held: null });
    this.raycaster = new MeshCat.THREE.Raycaster();
    const geometry = new MeshCat.THREE.BufferGeometry();
    const material = new MeshCat.THREE.LineBasicMaterial({ color: 0xffd97a, depthTest: false, transparent: true });
    this.line = new MeshCat.THREE.LineSegments(geometry, material);
    this.line.frustumCulled = false;
    this.line.renderOrder = 1; // over the robot
    viewer.scene.add(this.line);
  }

  show(outline) {
    this.outline = outline;
    const segments = outline.lines.flatMap(line => line.slice(1).flatMap((point, k) => [line[k], point]));
    const points = new Float32Array(segments.flat());
    this.line.geometry.setAttribute("position", new MeshCat.THREE.BufferAttribute(points, 3));
    if (this.buttons.length !== outline.handles.length) {
      this.buttons = outline.handles.map((handle, number) => this.button(number));
      element("handles").replaceChildren(...this.buttons);
    }
    outline.handles.forEach(({ name, position, is_target }, number) => {
      const button = this.buttons[number];
      if (this.held !== number) button.position = position;
      button.title = `${name}: drag, or use the arrow keys`;
      button.setAttribute("aria-label", `Handle ${name}`);
      button.classList.toggle("target", Boolean(is_target));
    });
    this.viewer.set_dirty();
  }

  button(number) {
    const button = document.createElement("button");
    let offset = [0, 0];
    button.className = "handle";
    button.addEventListener("pointerdown", event => {
      const { x, y } = this.pixel(button.position);
      offset = [event.clientX - x, event.clientY - y];
      this.held = number;
      button.setPointerCapture(event.pointerId);
      button.focus();
      event.preventDefault();
    });
    button.addEventListener("pointermove", event => {
      if (this.held === number) this.drag(number, event.clientX - offset[0], event.clientY - offset[1], false);
    });
    const release = event => {
      if (this.held !== number) return;
      this.drag(number, event.clientX - offset[0], event.clientY - offset[1], true);
      this.held = null;
    };
    button.addEventListener("pointerup", release);
    button.addEventListener("lostpointercapture", release);
    button.addEventListener("keydown", event => {
      const steps = { ArrowLeft: [-6, 0], ArrowRight: [6, 0], ArrowUp: [0, -6], ArrowDown: [0, 6] };
      if (!(event.key in steps)) return;
      const { x, y } = this.pixel(button.position), [dx, dy] = steps[event.key];
      this.drag(number, x + dx, y + dy, true);
      event.preventDefault();
      event.stopPropagation();
    });
    return button;
  }

  world(position) {
    return this.viewer.scene.localToWorld(new MeshCat.THREE.Vector3(...position));
  }

  // Place on the screen of a position.
  pixel(position) {
    const { left, top, width, height } = element("meshcat-pane").getBoundingClientRect();
    const point = this.world(position).project(this.viewer.camera);
    return { x: left + (1 + point.x) * width / 2, y: top + (1 - point.y) * height / 2, seen: Math.abs(point.z) <= 1 };
  }

  drag(number, x, y, done) {
    const { THREE } = MeshCat, { camera, scene } = this.viewer, button = this.buttons[number];
    const { left, top, width, height } = element("meshcat-pane").getBoundingClientRect();
    const ends = this.outline.planar ? [[0, 0, 0], this.outline.normal].map(end => this.world(end)) : null;
    const normal = ends ? ends[1].sub(ends[0]) : camera.getWorldDirection(new THREE.Vector3());
    const plane = new THREE.Plane().setFromNormalAndCoplanarPoint(normal, this.world(button.position));
    this.raycaster.setFromCamera({ x: 2 * (x - left) / width - 1, y: 1 - 2 * (y - top) / height }, camera);
    const point = this.raycaster.ray.intersectPlane(plane, new THREE.Vector3());
    if (point) button.position = scene.worldToLocal(point).toArray().map(part => +part.toFixed(6));
    this.moved(number, button.position, done);
    this.viewer.set_dirty();
  }

  // Places the handles after the view was drawn.
  place() {
    const { left, top } = element("meshcat-pane").getBoundingClientRect();
    for (const button of this.buttons) {
      const { x, y, seen } = this.pixel(button.position);
      button.hidden = !seen;
      button.style.left = `${x - left}px`;
      button.style.top = `${y - top}px`;
    }
  }
}
