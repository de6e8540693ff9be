"""Planning of end-effector paths for free-floating space manipulators.

From a URDF to a plan, and to MeshCat::

    import freefloat as ff
    import numpy as np

    task = ff.Task.POSE
    model = ff.FreeFloatingModel.from_urdf("robot.urdf", "end_effector")
    curve = ff.paths.PolynomialCurve.line([1, 0, 0], [-0.5, 0.8, 0.33])  # [m]
    path = ff.EndEffectorPath(curve, ff.paths.FixedOrientation(np.eye(3)))
    timed = ff.TimedPath(path, ff.Timing(duration=100))  # [s]
    margin = ff.Margin(ff.singularity_measure(model, task, "gjm"), 0.02)
    problem = ff.Problem(model, timed, task, np.array([0.5, 0.3, 0.1]), margin)  # [N m s]
    plan = ff.plan(problem, ff.Search(samples=1024))
    print(plan.reason, plan.chosen.motion.initial.attitude)
    ff.show(plan)  # in a browser, or in the cell of a notebook

A problem from a scenario file: ``problem = ff.load_scenario("spatial_6dof/line").problem()``.

Positions are relative to the system's centre of mass. Units are SI and radians, quaternions
x, y, z, w. Invalid input raises :class:`InputError`, which names the key, the value given and what
is accepted. Results are frozen records with read-only arrays. The names are listed in
``__init__.pyi`` and loaded on first use.
"""

import re
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from threading import RLock

__version__ = "0.4.0"

_LISTED = Path(__file__).with_suffix(".pyi").read_text("utf-8").partition("# Modules")[0]
_MODULES = {name: module for module, name in re.findall(r"^from (\S+) import (\w+)", _LISTED, re.M)}
__all__ = sorted(_MODULES)
_importing = RLock()
"""Threads that import packages in different orders would see some of them half imported."""


def __getattr__(name: str) -> object:
    """A public name or a module, imported when it is first used (PEP 562)."""
    if name not in _MODULES and not find_spec(f"{__name__}.{name}"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = _MODULES.get(name, ".")
    package = module == "."
    with _importing:
        value = import_module("." + name if package else module, __name__)
    globals()[name] = value if package else getattr(value, name)
    return globals()[name]


def __dir__() -> list[str]:
    return __all__
