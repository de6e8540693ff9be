"""What the commands of a page's scene contain."""

from typing import Any

import numpy as np
import umsgpack

from freefloat.visualization.scenes.scene_builder import PageScene


def commands(scene: PageScene, kind: str) -> dict[str, Any]:
    found = map(umsgpack.unpackb, scene.objects)
    return {command["path"]: command for command in found if command["type"] == kind}


def tracks(scene: PageScene) -> dict[str, tuple[np.ndarray, ...]]:
    """Times and values of the tracks by path and property."""
    return {
        clip["path"] + track["name"]: tuple(
            np.frombuffer(track[name].data, dtype="<f4").astype(float)
            for name in ("times", "values")
        )
        for clip in umsgpack.unpackb(scene.animation)["animations"]
        for track in clip["clip"]["tracks"]
        if track["type"] != "boolean"
    }


def vertices(scene: PageScene, path: str, name: str = "position") -> np.ndarray:
    """Vertices of the surface at a path, or their colours, shape (V, 3)."""
    item = commands(scene, "set_object")[path]["object"]
    packed = item["geometries"][0]["data"]["attributes"][name]["array"]
    return np.frombuffer(packed.data, dtype="<f4").reshape(-1, 3).astype(float)
