// The panels around the 3D view: bar, keys, items, legend, states and joints.

// Text of an arm branch's name.
function named(title) {
  return title.replace(/^branch (\d+)(?= )/, "arm branch $1:").replace(/^start (\d+)/, "arm configuration $1 at the start");
}

function textElement(tag, text, colour = "") {
  const made = document.createElement(tag);
  made.textContent = text;
  made.style.color = colour;
  return made;
}

function colourKey(text, colour) {
  const key = textElement("div", text);
  key.className = "key";
  key.style.setProperty("--colour", colour);
  return key;
}

// The legend of a scale of colours: a bar with its ends, or colours and what they mean.
function legendOf({ entries, stops, below, margin, largest, measure, unit, limited }) {
  if (entries) return entries.map(([text, colour]) => colourKey(text, colour));
  const bar = document.createElement("div"), ends = document.createElement("div"), written = printed(unit);
  bar.className = "bar";
  bar.style.background = `linear-gradient(to right, ${stops.join(", ")})`;
  ends.className = "ends";
  ends.append(...[margin, largest].map(value => textElement("span", shortened(value))));
  return [
    `|${measure}|` + (written && ` [${written}]`), ...stops.length ? [bar, ends] : [],
    ...margin > 0 ? [colourKey(`below the margin ${shortened(margin)} ${written}${limited ? " or beyond a limit" : ""}`, below)] : [],
  ];
}

class Panels {
  constructor(player, picker, plot = new Plot(element("plot"))) {
    Object.assign(this, { picker, plot });
    plot.seek = time => this.seek(time);
    this.makeBar();
    this.show(player);
  }

  // Fills the panels for the scene of a player.
  show(player) {
    this.player = player;
    this.makeItems();
    this.makeChoices();
    element("legend").replaceChildren(...legendOf(about.scale));
    this.plot.draw(player); // it is hidden before the view gets its size where there is no motion
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
    const views = element("view");
    for (const speed of SPEEDS) element("speed").add(new Option(`${speed}×`, speed));
    VIEWS.forEach(({ name }, number) => views.add(new Option(`${number + 1} ${name}`, number)));
    element("play").addEventListener("click", () => this.playOrPause());
    element("time").addEventListener("input", event => this.seek(+event.target.value));
    element("speed").addEventListener("change", event => { this.player.speed = +event.target.value; });
    element("motion").addEventListener("change", event => this.player.show(event.target.value));
    views.addEventListener("change", () => {
      this.player.look(+views.value);
      views.selectedIndex = 0; // so that each can be chosen again
    });
    element("picture").addEventListener("click", () => savePicture(this.player));
    element("joints").addEventListener("toggle", () => this.player.viewer.set_dirty());
    document.addEventListener("keydown", event => this.key(event));
  }

  makeChoices() {
    const motions = element("motion"), still = about.duration === 0;
    for (const id of ["play", "time", "clock", "speed", "joints"]) element(id).hidden = still;
    element("time").max = about.duration;
    const options = about.scenes.map(scene => [scene.trail ? `${named(scene.title)}. ${sentence(scene)}` : scene.title, scene.title]);
    if (about.sequence) options.unshift([ALL_PHASES, ALL_PHASES]);
    else if (options.length > 1 && !still) options.push([SIDE_BY_SIDE, SIDE_BY_SIDE]);
    motions.replaceChildren(...options.map(texts => new Option(...texts)));
    motions.hidden = options.length < 2;
  }

  playOrPause() { if (this.player.playing) this.player.pause(); else this.player.play(); }

  seek(time) {
    this.player.pause();
    this.player.seek(time);
  }

  key(event) {
    const { player } = this, { tagName, id } = event.target;
    if (!about || event.ctrlKey || event.metaKey || event.altKey) return; // the studio may have no motion
    if (["INPUT", "SELECT", "BUTTON", "SUMMARY"].includes(tagName) && id !== "time" && event.key === " ") return;
    const step = about.duration / 100;
    const jumps = { ArrowLeft: player.time - step, ArrowRight: player.time + step, Home: 0, End: about.duration };
    if (event.key === " ") { this.playOrPause(); event.preventDefault(); }
    if (tagName === "SELECT") return;
    if (event.key in jumps) { this.seek(jumps[event.key]); event.preventDefault(); }
    if (VIEWS[event.key - 1]) player.look(event.key - 1);
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
    if (element("joints").open) element("joints").replaceChildren(element("joints").firstElementChild, ...player.shown.map(scene => this.joints(scene)));
    this.plot.draw(player);
    placeLabels(player);
    if (this.picker) this.picker.mark();
  }

  // What a motion is, and its values.
  state(scene) {
    const section = document.createElement("section"), several = this.player.shown.length > 1;
    section.append(textElement("h2", sentence(scene) || scene.title, several ? curveColour(this.player, scene) : ""));
    if (scene.trail && (scene.title !== "motion" || several)) section.append(textElement("small", named(scene.title)));
    for (const line of this.player.lines(scene, this.plot.marks)) section.append(textElement("p", plainLine(line), lineColour(line)));
    return section;
  }

  // Values of the joints at the present time.
  joints(scene) {
    const table = document.createElement("table");
    if (this.player.shown.length > 1) table.createCaption().textContent = named(scene.title);
    for (const [name, prismatic, values] of scene.trail.joints) {
      const row = table.insertRow(), value = interpolated(scene.trail.times, values, Math.min(this.player.time, scene.end));
      const texts = prismatic ? ["", `${value.toFixed(4)} m`] : [`${(value * 180 / Math.PI).toFixed(2)}°`, `${value.toFixed(4)} rad`];
      for (const text of [name, ...texts]) row.insertCell().textContent = text;
    }
    return table;
  }
}
