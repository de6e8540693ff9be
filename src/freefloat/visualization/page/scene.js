// The scene of a page: MeshCat's commands, run in its viewer.

const ROOT = "meshcat";
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

// The viewer of a page, without a scene.
function makeViewer() {
  const pane = element("meshcat-pane"), viewer = new MeshCat.Viewer(pane, false);
  const { THREE } = MeshCat, light = new THREE.DirectionalLight(0xffffff, 0.27);
  viewer.set_property(["Lights", "SpotLight"], "visible", false); // it is inside large scenes
  viewer.scene.add(light, light.target);
  viewer.draw = viewer.render;
  viewer.render = () => { // the light is over the left shoulder of the eye
    light.position.copy(viewer.scene.worldToLocal(new THREE.Vector3(-0.7, 0.9, 1).applyQuaternion(viewer.camera.quaternion)));
    viewer.draw();
  };
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
