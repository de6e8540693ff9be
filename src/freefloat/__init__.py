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

The same from a scenario file: ``problem = ff.load_scenario("spatial_6dof/line").problem()``.

Positions are relative to the system's centre of mass. Units are SI and radians, quaternions
x, y, z, w. Invalid input raises :class:`InputError`, which names the key, the value given and what
is accepted. Results are frozen records with read-only arrays. The names are listed in
``__init__.pyi`` and loaded on first use.
"""

import lazy_loader

__version__ = "0.2.0"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
