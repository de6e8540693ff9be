// The measure of the motions over time: the margin, the closest approach, a singular end, and the
// present time, which the pointer drags.

const CURVES = ["#6ec1ff", "#f5a3c7", "#b8e986", "#ffd97a", "#c9b3ff", "#7fe0d0"]; // of motions side by side
const FAINT = "#4d6a88"; // of phases that are not shown
const MUTED = "#9fb0c8";
const THRESHOLD = "#ff9a4d";
const HEAD = 17; // height of the name of the measure above the curves [pixels]
const FOOT = 15; // that of the times below them
const EDGE = 8; // between the curves and the edges [pixels]
const BESIDE = 9; // between the cursor at the beginning and texts

// Colour of a motion in the plot and of its heading.
function curveColour(player, scene) {
  return player.shown.length < 2 ? CURVES[0] : CURVES[player.shown.indexOf(scene) % CURVES.length];
}

// A round step of at least a length: 1, 2 or 5 by a power of ten.
function roundStep(least) {
  const power = 10 ** Math.floor(Math.log10(least));
  return power * [1, 2, 5, 10].find(factor => factor * power >= least * 0.999);
}

class Plot {
  // The marks are of limits: times, and whether they are kept. The page sets seek.
  constructor(canvas) {
    Object.assign(this, { canvas, marks: [], seek: () => {} });
    const point = event => {
      if (event.buttons) this.seek((event.offsetX - EDGE) / (canvas.clientWidth - 2 * EDGE) * about.duration);
    };
    canvas.addEventListener("pointerdown", event => { canvas.setPointerCapture(event.pointerId); point(event); });
    canvas.addEventListener("pointermove", point);
  }

  // Curves of the motions shown, and of all phases of a sequence.
  draw(player) {
    const scenes = (about.sequence ? about.scenes : player.shown).filter(scene => scene.trail);
    this.canvas.hidden = about.duration === 0 || !scenes.length;
    if (this.canvas.hidden) return;
    const { canvas } = this, { clientWidth: width, clientHeight: height } = canvas, ratio = devicePixelRatio || 1;
    [canvas.width, canvas.height] = [width * ratio, height * ratio];
    const context = this.context = canvas.getContext("2d"), bottom = height - FOOT;
    context.scale(ratio, ratio);
    context.font = "12px system-ui, sans-serif";
    context.lineJoin = "round"; // else outlines of letters have spikes
    this.x = time => EDGE + time / about.duration * (width - 2 * EDGE);
    this.y = value => bottom - (bottom - HEAD) * value / (1.03 * about.scale.largest);
    this.drawTimes(width, bottom);
    for (const scene of scenes) this.drawCurve(player, scene);
    const [first] = player.shown, low = scenes.includes(first) ? this.closest(first) : null;
    const right = !low || this.x(low.time) < width / 2; // side of the margin's value
    if (first.margin > 0) this.drawMargin(first, right, width);
    this.text(`|${about.scale.measure}|${unit() && ` [${unit()}]`}`, EDGE + BESIDE, 12, MUTED, "left");
    for (const scene of scenes.filter(one => player.shown.includes(one))) this.drawClosest(player, scene, width);
    for (const scene of scenes) if (["singular", "margin"].includes(scene.ending)) this.drawEnd(scene);
    for (const { time, kept } of this.marks) this.line([[this.x(time), 0], [this.x(time), 8]], verdictColour(kept));
    this.drawCursor(this.x(player.time), bottom);
  }

  line(points, colour, width = 1.5, dash = []) {
    const { context } = this;
    Object.assign(context, { strokeStyle: colour, lineWidth: width });
    context.setLineDash(dash);
    context.beginPath();
    points.forEach(([x, y], i) => context[i ? "lineTo" : "moveTo"](x, y));
    context.stroke();
  }

  // A text with an outline that keeps it readable on curves.
  text(text, x, y, colour, align) {
    const { context } = this;
    context.setLineDash([]);
    Object.assign(context, { textAlign: align, fillStyle: colour, strokeStyle: "#0b101a", lineWidth: 4 });
    context.strokeText(text, x, y);
    context.fillText(text, x, y);
  }

  drawTimes(width, bottom) {
    const step = roundStep(about.duration * 90 / width);
    this.line([[EDGE, bottom], [width - EDGE, bottom]], "#3a4659", 1);
    for (let time = Math.ceil(about.start / step) * step; time <= about.start + about.duration * 1.0001; time += step) {
      const x = this.x(time - about.start), side = x < 20 ? "left" : x > width - 30 ? "right" : "center";
      this.line([[x, bottom], [x, bottom + 3]], "#3a4659", 1);
      this.text(`${+time.toPrecision(6)} s`, x, bottom + 13, MUTED, side);
    }
  }

  drawCurve(player, scene) {
    const { times, values } = scene.trail, colour = player.shown.includes(scene) ? curveColour(player, scene) : FAINT;
    this.line(times.map((time, i) => [this.x(time), this.y(values[i])]), colour);
    if (about.sequence) this.line([[this.x(scene.begin), HEAD], [this.x(scene.begin), this.y(0)]], "#3a4659", 1);
  }

  drawMargin(scene, right, width) {
    const [begin, end] = about.sequence ? [this.x(scene.begin), this.x(scene.end)] : [EDGE, width - EDGE];
    const y = this.y(scene.margin);
    this.line([[begin, y], [end, y]], THRESHOLD, 1.5, [5, 4]);
    this.text(`margin ${shortened(scene.margin)}`, right ? end : begin + BESIDE, y < HEAD + 14 ? y + 14 : y - 4, THRESHOLD, right ? "right" : "left");
  }

  // Smallest value of a motion and its time.
  closest({ trail: { times, values } }) {
    const least = values.reduce((best, value, i) => value < values[best] ? i : best, 0);
    return { time: times[least], value: values[least] };
  }

  drawClosest(player, scene, width) {
    if (scene.ending === "singular" || scene.margin === 0) return;
    const { time, value } = this.closest(scene), { context } = this, x = this.x(time), y = this.y(value);
    context.beginPath();
    context.arc(x, y, 3.5, 0, 2 * Math.PI);
    context.fillStyle = curveColour(player, scene);
    context.fill();
    if (player.shown.length > 2) return;
    const side = x < 60 ? "left" : x > width - 60 ? "right" : "center";
    this.text(`closest ${shortened(value)}`, x, y < HEAD + 18 ? y + 16 : y - 8, INK, side);
  }

  drawEnd({ trail, end, ending }) {
    const x = this.x(end), y = this.y(trail.values.at(-1)), colour = "#ff8a75";
    for (const sign of [-1, 1]) this.line([[x - 5, y - 5 * sign], [x + 5, y + 5 * sign]], colour, 2);
    if (ending === "singular") this.text("singular", x - 8, y - 6, colour, x < 70 ? "left" : "right");
  }

  drawCursor(x, bottom) {
    const { context } = this;
    this.line([[x, 0], [x, bottom]], "#fff");
    context.beginPath(); // what is dragged
    context.moveTo(x - 6, 0);
    context.lineTo(x + 6, 0);
    context.lineTo(x, 8);
    context.fillStyle = "#fff";
    context.fill();
  }
}
