// The set of initial attitudes: a ball of rotation vectors, or a dial of headings. A pointer asks
// why a sample is feasible or not, a click chooses.

const CLICK = 4; // largest movement of a click [pixels]
const RARE = 0.2; // fraction of samples below which they are drawn larger, over the others
const SVG = "http://www.w3.org/2000/svg";

function bytes(text) { return Uint8Array.from(atob(text), letter => letter.charCodeAt(0)); }

function rotationVector({ x, y, z, w }) {
  const sign = w < 0 ? -1 : 1, size = Math.hypot(x, y, z), scale = size > 1e-12 ? 2 * Math.atan2(size, sign * w) / size : 2;
  return [x, y, z].map(part => sign * scale * part);
}

function cssColours(text) {
  const colours = bytes(text);
  return Array.from({ length: colours.length / 3 }, (_, i) => `rgb(${colours.subarray(3 * i, 3 * i + 3).join()})`);
}

class Ball {
  // The callbacks get the index of a sample, and a rotation vector.
  constructor(canvas, hover, choose) {
    Object.assign(this, { canvas, hover, choose, yaw: 0.5, pitch: 0.4, set: null, mark: null, now: null, down: null, under: -1 });
    canvas.addEventListener("pointerdown", event => {
      canvas.setPointerCapture(event.pointerId);
      this.down = { x: event.clientX, y: event.clientY, yaw: this.yaw, pitch: this.pitch, moved: false };
    });
    canvas.addEventListener("pointermove", event => this.move(event));
    canvas.addEventListener("pointerup", event => this.up(event));
    canvas.addEventListener("pointercancel", () => { this.down = null; });
    canvas.addEventListener("keydown", event => {
      if (event.key === "Enter") this.chooseAt({ offsetX: canvas.clientWidth / 2, offsetY: canvas.clientHeight / 2 });
      const turns = { ArrowLeft: [-0.15, 0], ArrowRight: [0.15, 0], ArrowUp: [0, 0.15], ArrowDown: [0, -0.15] };
      if (!(event.key in turns)) return;
      this.turn(this.yaw + turns[event.key][0], this.pitch + turns[event.key][1]);
      event.preventDefault();
      event.stopPropagation();
    });
    new ResizeObserver(() => this.draw()).observe(canvas);
  }

  show(set) {
    const { buffer } = bytes(set.points);
    const states = bytes(set.states), feasible = states.filter(state => state === 2).length / states.length;
    this.set = { present: set.present, points: new Float32Array(buffer), colours: cssColours(set.colours), states, feasible, degrees: Math.round(set.extent_deg) };
    this.under = -1;
    this.draw();
  }

  turn(yaw, pitch) {
    this.yaw = yaw;
    this.pitch = Math.min(Math.max(pitch, -1.57), 1.57);
    this.draw();
  }

  move(event) {
    if (!this.down) { this.point(event); return; }
    const dx = event.clientX - this.down.x, dy = event.clientY - this.down.y;
    this.down.moved ||= Math.hypot(dx, dy) > CLICK;
    if (this.down.moved) this.turn(this.down.yaw + dx / 120, this.down.pitch + dy / 120);
  }

  up(event) {
    const clicked = this.down && !this.down.moved;
    this.down = null;
    if (clicked) this.chooseAt(event);
  }

  chooseAt(place) {
    this.point(place);
    if (this.under >= 0) this.choose([...this.set.points.subarray(3 * this.under, 3 * this.under + 3)]);
  }

  extent() { return (this.set ? this.set.degrees : 180) * Math.PI / 180; }

  // Pixel of a rotation vector, and its depth: larger is nearer.
  projection() {
    const { clientWidth, clientHeight } = this.canvas, radius = Math.min(clientWidth, clientHeight) / 2;
    const [cy, sy, cp, sp] = [Math.cos(this.yaw), Math.sin(this.yaw), Math.cos(this.pitch), Math.sin(this.pitch)];
    const scale = radius / (1.12 * this.extent());
    return (x, y, z) => {
      const across = cy * x + sy * y, away = -sy * x + cy * y;
      return [clientWidth / 2 + scale * across, clientHeight / 2 - scale * (cp * z + sp * away), sp * z - cp * away];
    };
  }

  // Asks about the foremost sample at a place of the canvas.
  point({ offsetX, offsetY }) {
    if (!this.set) return;
    const place = this.projection(), { points, states } = this.set;
    let best = -Infinity, found = -1;
    for (let i = 0; i < states.length; i++) {
      const [x, y, depth] = place(points[3 * i], points[3 * i + 1], points[3 * i + 2]);
      const near = Math.hypot(x - offsetX, y - offsetY) < this.size(states[i]) / 2 + 3;
      const rank = depth + (this.rare(states[i]) ? 10 : 0);
      if (near && rank > best) [best, found] = [rank, i];
    }
    if (found === this.under) return;
    this.under = found;
    this.hover(found);
    this.draw();
  }

  // Side of a square [pixels]: rare samples, feasible or not, are larger.
  size(state) {
    const spacing = this.canvas.clientWidth / Math.cbrt(this.set.states.length);
    return this.rare(state) ? Math.max(0.45 * spacing, 4) : state === 2 ? 3 : 2.5;
  }

  rare(state) { return (state === 2 ? this.set.feasible : 1 - this.set.feasible) < RARE; }

  draw() {
    const { canvas, set } = this, { clientWidth: width, clientHeight: height } = canvas, ratio = devicePixelRatio || 1;
    if (!width) return;
    if (canvas.width !== Math.round(width * ratio)) [canvas.width, canvas.height] = [width, height].map(side => Math.round(side * ratio));
    const context = canvas.getContext("2d"), place = this.projection();
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    context.strokeStyle = "#738099";
    context.beginPath();
    context.arc(width / 2, height / 2, Math.min(width, height) / 2.24, 0, 2 * Math.PI);
    context.stroke();
    if (set) this.drawSamples(context, place);
    this.drawAxes(context, place);
    const marks = [[this.mark, "#fff", 7], [this.now, "#fff", 3, Math.PI]].filter(([vector]) => vector);
    if (set && set.present) this.drawPresent(context, place(...set.present.rotation_vector));
    if (set && this.under >= 0) marks.push([set.points.subarray(3 * this.under, 3 * this.under + 3), "#6ec1ff", 5]);
    for (const [vector, colour, radius, filled] of marks) {
      const [x, y] = place(...vector);
      context.beginPath();
      context.arc(x, y, radius, 0, 2 * Math.PI);
      this.outlined(context, colour);
      if (filled) context.fill();
    }
    context.lineWidth = 1;
  }

  // Strokes a path so that it is seen on samples of any colour.
  outlined(context, colour) {
    for (const [strokeStyle, lineWidth] of [["#000", 5], [colour, 2]]) {
      Object.assign(context, { strokeStyle, lineWidth, fillStyle: colour });
      context.stroke();
    }
  }

  drawPresent(context, [x, y]) {
    context.beginPath();
    for (const [dx, dy] of [[0, -7], [7, 0], [0, 7], [-7, 0]]) context.lineTo(x + dx, y + dy);
    context.closePath();
    this.outlined(context, "#fff");
  }

  drawSamples(context, place) {
    const { points, colours, states } = this.set;
    const placed = colours.map((colour, i) => [...place(points[3 * i], points[3 * i + 1], points[3 * i + 2]), colour, states[i]]);
    placed.sort((a, b) => this.rare(a[4]) - this.rare(b[4]) || a[2] - b[2]);
    for (const [x, y, depth, colour, state] of placed) {
      const size = this.size(state);
      context.globalAlpha = (this.rare(state) ? 0.9 : 0.7) * (0.55 + 0.45 * (depth / this.extent() + 1) / 2);
      context.fillStyle = colour;
      context.fillRect(x - size / 2, y - size / 2, size, size);
    }
    context.globalAlpha = 1;
  }

  drawAxes(context, place) {
    const end = this.extent();
    const axes = [["x", [end, 0, 0], "#e64033"], ["y", [0, end, 0], "#40bf4d"], ["z", [0, 0, end], "#4d80ff"]];
    context.font = "12px system-ui, sans-serif";
    for (const [name, tip, colour] of axes) {
      const [x, y] = place(...tip);
      context.strokeStyle = context.fillStyle = colour;
      context.beginPath();
      context.moveTo(...place(0, 0, 0).slice(0, 2));
      context.lineTo(x, y);
      context.stroke();
      context.textAlign = x > this.canvas.clientWidth / 2 ? "right" : "left";
      const text = `${name} ${Math.round(end * 180 / Math.PI)}°`;
      Object.assign(context, { strokeStyle: "#0b101a", fillStyle: INK, lineWidth: 4, lineJoin: "round" });
      context.strokeText(text, x, y - 4); // readable over the samples
      context.fillText(text, x, y - 4);
      context.lineWidth = 1;
    }
  }
}

class Dial {
  // The callbacks get the index of a sample, and a heading [deg].
  constructor(svg, hover, choose) {
    Object.assign(this, { svg, hover, choose, set: null, mark: null, now: null, under: -1 });
    svg.addEventListener("pointermove", event => this.point(event));
    svg.addEventListener("click", event => {
      if (this.set) this.choose(Math.round(10 * this.heading(event)) / 10);
    });
    svg.addEventListener("keydown", event => {
      const steps = { ArrowLeft: 1, ArrowRight: -1 };
      if (!(event.key in steps) || this.mark === null) return;
      this.choose(Math.round(this.mark) + steps[event.key]);
      event.preventDefault();
      event.stopPropagation();
    });
  }

  show(set) {
    Object.assign(this, { set, under: -1 });
    this.draw();
  }

  place(event) {
    const { left, top, width, height } = this.svg.getBoundingClientRect(), side = Math.min(width, height);
    return [2.6 * (event.clientX - left - width / 2) / side, -2.6 * (event.clientY - top - height / 2) / side];
  }

  heading(event) {
    const [x, y] = this.place(event);
    return (Math.atan2(y, x) * 180 / Math.PI + 360) % 360;
  }

  // Outer and inner radius of an arm branch; all of them have room around the middle.
  ring(branch) {
    const width = Math.min(0.26, 0.9 / this.set.branches.length);
    return [1 - width * branch, 1 - width * (branch + 0.85)];
  }

  // Asks about the heading and the arm branch below the pointer.
  point(event) {
    if (!this.set) return;
    const { headings, branches } = this.set, heading = this.heading(event), radius = Math.hypot(...this.place(event));
    const branch = branches.findIndex((_, b) => radius <= this.ring(b)[0] && radius >= this.ring(b)[1]);
    const apart = headings.map(each => Math.abs((each - heading + 540) % 360 - 180));
    const under = branch < 0 ? -1 : branch * headings.length + apart.indexOf(Math.min(...apart));
    if (under === this.under) return;
    this.under = under;
    this.hover(under);
  }

  add(name, attributes, text) {
    const part = document.createElementNS(SVG, name);
    for (const [key, value] of Object.entries(attributes)) part.setAttribute(key, value);
    part.textContent = text || "";
    this.svg.append(part);
  }

  draw() {
    const { headings, branches } = this.set, step = headings.length > 1 ? headings[1] - headings[0] : 360;
    const at = (radius, heading) => {
      const angle = heading * Math.PI / 180;
      return `${(radius * Math.cos(angle)).toFixed(4)} ${(-radius * Math.sin(angle)).toFixed(4)}`;
    };
    const arc = (radius, low, high, sweep) => `A ${radius} ${radius} 0 ${Math.abs(high - low) > 180 ? 1 : 0} ${sweep} ${at(radius, high)}`;
    this.svg.replaceChildren();
    branches.forEach((branch, b) => {
      const [outer, inner] = this.ring(b);
      cssColours(branch.colours).forEach((colour, i) => {
        const [low, high] = [headings[i] - 0.5 * step, headings[i] + 0.9 * step]; // below the next one: no seams
        this.add("path", {
          d: `M ${at(outer, low)} ${arc(outer, low, high, 0)} L ${at(inner, high)} ${arc(inner, high, low, 1)} Z`,
          fill: colour,
        });
      });
      for (const [low, high] of branch.ranges || []) {
        const end = Math.min(high, low + 359.99);
        this.add("path", { d: `M ${at(outer + 0.02, low)} ${arc(outer + 0.02, low, end, 0)}`, fill: "none", stroke: "#fff", "stroke-width": 0.015 });
      }
      const few = branches.length <= 4, label = few ? branch.label : branch.label.replace(/([a-z])[a-z]*([+-])/g, "$1$2");
      const size = few ? "" : `; font-size: ${outer - inner}px`;
      this.add("text", { x: 0, y: -(inner + outer) / 2, style: `fill: #fff; paint-order: stroke; stroke: #000; stroke-width: 0.03px${size}` }, label);
    });
    for (const heading of [0, 90, 180, 270]) {
      const [x, y] = at(1.17, heading).split(" ");
      this.add("text", { x, y }, `${heading}°`);
    }
    const mark = (heading, text) => {
      const [x, y] = at(1.07, heading).split(" ");
      this.add("text", { x, y, style: "fill: #fff; paint-order: stroke; stroke: #000; stroke-width: 0.05px; font-size: 0.13px" }, text);
    };
    if (this.mark !== null) this.add("path", { d: `M 0 0 L ${at(1.02, this.mark)}`, stroke: "#fff", "stroke-width": 0.02 });
    if (this.set.present) mark(this.set.present.heading_deg, "◇");
    if (this.mark !== null) mark(this.mark, "○");
    if (this.now !== null) mark(this.now, "●");
  }
}
