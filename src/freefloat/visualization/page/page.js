// A page of its own: what begins it, and its interface for pictures, videos and tests.

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

async function begin() {
  const viewer = makeViewer(), pane = element("meshcat-pane");
  const player = await loadScene(viewer, element("scene").textContent, element("tracks").textContent);
  const picker = about.samples && await SamplePicker.of(player, element("samples").textContent);
  const panels = new Panels(player, picker);
  let drawn = false;
  const frame = now => {
    requestAnimationFrame(frame);
    player.tick(now);
    if (!viewer.needs_render) return;
    viewer.render();
    panels.update();
    if (!drawn) performance.mark("first frame");
    drawn = true;
  };
  viewer.set_3d_pane_size();
  player.arrange();
  panels.update(); // the view depends on their sizes
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
    eye: () => player.viewer.camera.position.clone().sub(player.viewer.controls.target).toArray(), // y up
    picture: () => picture(player),
  };
}
