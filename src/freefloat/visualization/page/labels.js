// Labels of points of the scene, over the 3D view.

const GAP = 12; // between a label and its point, or a panel and the scenes [pixels]

// Visible labels with their positions on a canvas [pixels].
function visibleLabels(player, width, height) {
  const { camera } = player.viewer, placed = [];
  for (const scene of player.shown) {
    for (const label of scene.labels) {
      if (player.time < label.since || player.hidden.has(label.item)) continue;
      const { object } = player.node(`${ROOT}/${scene.node}/${label.node}`);
      const point = new MeshCat.THREE.Vector3(...label.position);
      object.localToWorld(point).project(camera); // the viewer's world has y up
      if (Math.abs(point.z) > 1) continue;
      placed.push({ text: label.text, colour: label.colour, x: (1 + point.x) * width / 2, y: (1 - point.y) * height / 2 });
    }
  }
  return placed;
}

// Puts each label beside its point where it covers nothing, or leaves it out.
function placeLabels(player) {
  const pane = element("meshcat-pane").getBoundingClientRect(), { width, height } = pane;
  const points = visibleLabels(player, width, height);
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

function box(left, top, across, down) { return { left, top, right: left + across, bottom: top + down }; }

function overlap(a, b) { return a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom; }
