// Views of the scene: where the camera stands, and at which distance all is in the picture.

const FIELD_OF_VIEW = 40; // degrees
const FRAME = 0.88; // fraction of the picture that the scene fills
const WIDE = 1.2; // width over height of views with panels beside the scenes, not above and below them
const NEAR_TIP = 0.25; // radius of the view of the end-effector over that of the scene
const VIEWS = [ // names and directions to the eye, inertial axes; keys 1 to 9
  { name: "first view" },
  { name: "from +x", direction: [1, 0, 0] }, { name: "from −x", direction: [-1, 0, 0] },
  { name: "from +y", direction: [0, 1, 0] }, { name: "from −y", direction: [0, -1, 0] },
  { name: "from +z", direction: [0, -0.001, 1] }, { name: "from −z", direction: [0, -0.001, -1] },
  { name: "from behind", behind: true }, { name: "end-effector", tip: true },
];

function along(axis, point) { return axis.reduce((sum, part, i) => sum + part * point[i], 0); }

// Points that a view must contain: those of all scenes shown, or the surroundings of an end-effector.
function viewPoints(player, tip) {
  const { centre, points, radius } = about.view, [scene] = player.shown;
  const axes = tip && scene && player.node(`${ROOT}/${scene.node}/End-effector axes`);
  if (axes) {
    const { object } = Object.values(axes.children).at(-1); // that of the path
    object.updateWorldMatrix(true, false);
    const place = new MeshCat.THREE.Vector3().setFromMatrixPosition(object.matrixWorld);
    const at = player.viewer.scene.worldToLocal(place).toArray(); // z up
    return [-1, 1].flatMap(sign => [0, 1, 2].map(axis => at.map((part, i) =>
      part - centre[i] + (i === axis) * sign * NEAR_TIP * radius)));
  }
  const shifts = player.shown.map(one => player.offset(one).map((part, i) => part - one.origin[i] - centre[i]));
  return shifts.flatMap(shift => points.map(point => point.map((part, i) => part + shift[i])));
}

// Takes the smallest distance at which the scenes fit in the picture: in a narrow one between the
// panels, several scenes below theirs. Panels leave at least two fifths of it.
function lookFrom(player, { direction = about.view.direction, behind, tip }) {
  const { camera, controls, renderer } = player.viewer, { centre } = about.view;
  const { clientWidth, clientHeight } = renderer.domElement;
  const narrow = clientWidth < WIDE * clientHeight, several = player.shown.length > 1;
  const taken = (id, shrinks) => shrinks ? (element(id).offsetHeight + GAP) / clientHeight : 0;
  const top = taken("states", narrow || several), bottom = taken("legend", narrow);
  const tangent = Math.tan(FIELD_OF_VIEW * Math.PI / 360), across = tangent * FRAME * clientWidth / clientHeight;
  const up = tangent * Math.min(FRAME, Math.max(1 - top - bottom, 0.4));
  const turned = behind ? [-direction[0], -direction[1], direction[2]] : direction;
  const length = Math.hypot(...turned), toEye = turned.map(part => part / length);
  const level = Math.hypot(toEye[0], toEye[1]);
  const right = [-toEye[1] / level, toEye[0] / level, 0];
  const above = [toEye[1] * right[2] - toEye[2] * right[1], toEye[2] * right[0] - toEye[0] * right[2],
    toEye[0] * right[1] - toEye[1] * right[0]];
  const points = viewPoints(player, tip);
  // Smallest distance at which the points fit between two edges, and the shift of the target.
  const fit = (axis, slope) => {
    const [first, second] = [-1, 1].map(sign => points.reduce((most, point) =>
      Math.max(most, sign * along(axis, point) / slope + along(toEye, point)), -Infinity));
    return [(first + second) / 2, slope * (second - first) / 2];
  };
  const [[wide, aside], [high, raised]] = [fit(right, across), fit(above, up)];
  const distance = Math.max(wide, high, 1e-3);
  // One scene that does not need the width of the picture stands beside the panel on its left.
  const panel = narrow || several ? 0 : element("states").offsetWidth / clientWidth;
  const shift = Math.min((distance - wide) * across, panel * distance * tangent * clientWidth / clientHeight);
  const target = centre.map((part, i) => part + (aside - shift) * right[i] + (raised + (top - bottom) * tangent * distance) * above[i]);
  const [x, y, z] = target.map((part, i) => part + toEye[i] * distance);
  camera.fov = FIELD_OF_VIEW;
  camera.near = distance / 500;
  camera.far = distance * 50;
  camera.position.set(x, z, -y);
  controls.target.set(target[0], target[2], -target[1]);
  camera.updateProjectionMatrix();
  controls.update();
  player.viewer.set_dirty();
}
