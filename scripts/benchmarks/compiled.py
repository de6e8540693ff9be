"""The plain loop in C++, compiled where the benchmark runs (needs ``g++`` and ``cmeel-eigen``)."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pinocchio as pin
from scipy.integrate import DOP853

import freefloat as ff
from benchmarks.motions import ATTITUDE, equal_tolerance
from benchmarks.result import Result, race
from freefloat.attitude_grids import attitude_grid
from freefloat.ensemble.endings import COMPLETED
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.ensemble.integrators import precise_motion
from freefloat.ensemble.result import is_regular
from freefloat.motion.problem import Problem

_PREFIX = Path(pin.__file__).parents[4]
"""Where the wheels of Pinocchio and Eigen put headers and libraries."""
_SOURCE = Path(__file__).with_name("compiled_loop.cpp")
_DEGREE = 4  # of the twist of a line with the quintic time law


def _header() -> str:
    """SciPy's coefficients of DOP853 as C++ arrays."""
    arrays = {"A": DOP853.A, "B": DOP853.B, "C": DOP853.C, "E3": DOP853.E3, "E5": DOP853.E5}
    lines = [f"constexpr int N_STAGES = {DOP853.n_stages};"]
    for name, values in arrays.items():
        shape = "".join(f"[{size}]" for size in values.shape)
        text = str(values.tolist()).replace("[", "{").replace("]", "}")
        lines.append(f"static const double {name}{shape} = {text};")
    return "\n".join(lines)


def _compiled() -> ctypes.CDLL:
    """The loop as a library, with the compiler's usual options for speed."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "dop853.h").write_text(_header(), encoding="utf-8")
        library = Path(folder, "loop.so")
        subprocess.run([
            "g++", "-w", "-std=c++17", "-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS",
            "-DBOOST_MPL_LIMIT_LIST_SIZE=30", "-O3", "-march=native", "-DNDEBUG", "-shared",
            "-fPIC",
            f"-I{folder}", f"-I{_PREFIX}/include", f"-I{_PREFIX}/include/eigen3", str(_SOURCE),
            f"-L{_PREFIX}/lib", f"-Wl,-rpath,{_PREFIX}/lib", "-lpinocchio_default",
            "-lboost_serialization", "-o", str(library),
        ], check=True)  # fmt: skip
        return ctypes.CDLL(str(library))


class CompiledLoop:
    """The compiled loop on a problem whose end-effector moves along a line (Example 2)."""

    def __init__(self, problem: Problem) -> None:
        times = np.linspace(0.0, problem.path.duration, 20)
        twists = np.array([problem.path.twist(t) for t in times.tolist()])
        powers = np.linalg.lstsq(np.vander(times, _DEGREE + 1, increasing=True), twists)[0]
        self._library, self._duration = _compiled(), problem.path.duration
        self._library.prepare.restype = ctypes.c_void_p
        with tempfile.NamedTemporaryFile() as file:
            problem.model.pin_model.saveToText(file.name)
            self._loop = ctypes.c_void_p(self._library.prepare(
                file.name.encode(), int(problem.model.frame_id),
                _pointer(np.array(problem.momentum)), _pointer(powers.copy()), _DEGREE,
            ))  # fmt: skip

    def jacobians(self, joints: np.ndarray, times: int) -> np.ndarray:
        """The generalized Jacobian (6, n), computed as often as wanted."""
        result = np.empty((len(joints), 6))
        self._library.jacobian(self._loop, _pointer(joints), _pointer(result), times)
        return result.T

    def motions(self, starts: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
        """Last states of motions from states (K, 4 + n), and smallest determinants (K,)."""
        states, minima = starts.copy(), np.empty(len(starts))
        self._library.motions(
            self._loop, _pointer(states), _pointer(minima), len(states),
            ctypes.c_double(self._duration), ctypes.c_double(tolerance),
        )  # fmt: skip
        return states, minima


def _pointer(array: np.ndarray) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def compiled_results(quick: bool) -> list[Result]:
    """A Jacobian, a precise motion and an ensemble's motion of Example 2 beside the C++ loop.

    The ensemble chooses the motions, the same for both: at a singularity the loop's steps shrink.
    """
    if shutil.which("g++") is None or not (_PREFIX / "include" / "eigen3").is_dir():
        print("no g++ or no cmeel-eigen: comparisons with C++ are left out", file=sys.stderr)
        return []
    problem = ff.load_scenario("spatial_6dof/line").problem()
    loop, model = CompiledLoop(problem), problem.model
    joints = np.array(problem.branches(ATTITUDE)[0].joints)
    attitudes = attitude_grid(64 if quick else 4096, seed=1)
    branches = problem.many_branches(attitudes)
    starts, many = attitudes[np.nonzero(branches.exist)[0]], branches.joints[branches.exist]
    integrator, times = FeasibilityEvaluator(problem).integrator, 1000
    found = integrator.integrate(starts, many)
    (regular,) = np.nonzero((found.endings == COMPLETED) & is_regular(found.determinant_ratios))
    few = np.random.default_rng(0).choice(regular, 8 if quick else 1024, replace=False)
    starts, many = starts[few], many[few]
    states = np.hstack([starts, many])
    off = np.abs(loop.jacobians(joints, 1) - ff.generalized_jacobian(model, joints)).max()
    exact = ff.integrate_motion(problem, ATTITUDE, joints, tolerance=1e-13).final.attitude
    start = np.append(ATTITUDE, joints)[None]
    if off > 1e-12 or np.linalg.norm(loop.motions(start, 1e-8)[0][0, :4] - exact) > 1e-8:
        raise SystemExit("the C++ loop finds another Jacobian or another motion")
    error = np.linalg.norm(precise_motion(problem, ATTITUDE, joints).final.attitude - exact)
    equal = equal_tolerance(lambda t: loop.motions(start, t)[0][0], exact, float(error))
    seconds = race(
        lambda: [ff.generalized_jacobian(model, joints) for _ in range(times)],
        lambda: loop.jacobians(joints, times),
        lambda: precise_motion(problem, ATTITUDE, joints),
        lambda: loop.motions(start, equal),
        lambda: integrator.integrate(starts, many),
        lambda: loop.motions(states, 1e-6),
        rounds=2 if quick else 15,
    )  # fmt: skip
    counts = times, times, 1, 1, len(states), len(states)
    each = [best / count for best, count in zip(seconds, counts, strict=True)]
    return [
        Result("a generalized Jacobian, six joints", each[0], "C++ with Pinocchio", each[1]),
        Result(
            "one precise motion of Example 2 with its trajectory", each[2],
            f"a C++ loop, DOP853, tolerance {equal:.0e}", each[3], remark="at equal error",
        ),
        Result(
            "one motion of an ensemble, Example 2", each[4], "a C++ loop at 1e-6", each[5], 50.0,
            remark="regular motions",
        ),
    ]  # fmt: skip
