"""Figures of certified maps of the joint space, and its sections, which they and scenes show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import combinations
from textwrap import fill
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from freefloat.attitude_grids import low_discrepancy
from freefloat.beyond.joint_space.singularity_map import Kind, SingularityMap
from freefloat.errors import finite_vector
from freefloat.singularities.joint_polynomial import JointPolynomial
from freefloat.so3 import Array
from freefloat.visualization import figure_style as style

_JOINT_SAMPLES = 4096
_STEP = np.radians(5.0)
"""Revolute joints of the reference configuration are multiples of this [rad]."""
_RASTER = 360
"""Cells of the raster, and intervals of the grid for det A = 0, across a panel."""
_SHIFT = -1e-3
"""Shift of the grid of revolute joints in revolutions: zeros at 180 degrees, which are also at -180
degrees, are a whole line at one of the edges."""
_COLOURS = ("#FBE3C0", "#7FB8DC", "#6E6E6E")
"""Det A positive, negative, undecided: light, medium and dark in grey tones."""
_LABELS = ("det A > 0", "det A < 0", "singular or undecided")
_PAIRED = 4
"""Joints of which all pairs are shown."""
_CAPTION_LENGTH = 110


@dataclass(frozen=True, eq=False)
class JointSection:
    """The joint space with all joints but a few at constant values."""

    found: SingularityMap
    joints: tuple[int, ...]  # indices of the joints that vary
    at: Array = field(repr=False)  # of all joints, of which the others count [rad or m], (n,)

    @cached_property
    def polynomial(self) -> JointPolynomial:
        """Det A by the joints that vary."""
        polynomial: JointPolynomial = self.found.polynomial
        for joint in set(polynomial.moving) - set(self.joints):
            polynomial = polynomial.fixed(joint, float(self.at[joint]))
        return polynomial

    @property
    def lower(self) -> Array:
        """Lower ends of the ranges of the joints that vary [rad or m]."""
        return np.array([self.found.polynomial.bases[joint].lower for joint in self.joints])

    @property
    def upper(self) -> Array:
        """Upper ends of the ranges of the joints that vary [rad or m]."""
        return np.array([self.found.polynomial.bases[joint].upper for joint in self.joints])

    def ticks(self, fractions: Array) -> tuple[Array, ...]:
        """Values of each joint that varies [rad or m] at fractions (K,) of its range."""
        ranges = zip(self.lower, self.upper, strict=True)
        return tuple(low + (high - low) * fractions for low, high in ranges)

    def configurations(self, values: Array) -> Array:
        """All joints (K, n) from those that vary (K, m)."""
        q = np.tile(self.at, (len(values), 1))
        q[:, self.joints] = values
        return q

    def grid(self, ticks: Sequence[Array]) -> Array:
        """Configurations of a grid over the joints that vary, the last one running fastest."""
        nodes = np.meshgrid(*ticks, indexing="ij")
        return self.configurations(np.stack(nodes, axis=-1).reshape(-1, len(ticks)))

    def signs_differ(self, values: Array) -> bool:
        """Whether values of det A have either sign, rounding errors aside."""
        rounding = self.found.polynomial.rounding
        return bool(values.min() < -rounding and values.max() > rounding)

    def constants(self) -> str:
        """The joints that do not vary but matter, with their values; empty if there are none."""
        found, names = self.found, self.found.model.joint_names
        fixed = {names.index(name): value for name, value in found.fixed.items()}
        values = {joint: float(self.at[joint]) for joint in found.joints} | fixed
        return ", ".join(
            f"{style.plain(names[joint])} = {joint_text(found, joint, values[joint])}"
            for joint in sorted(set(values) - set(self.joints))
        )


def section(
    found: SingularityMap, joints: Sequence[int], at: npt.ArrayLike | None = None
) -> JointSection:
    """The section over some joints; ``at`` is by default :func:`reference_configuration`.

    Raises an InputError if ``at`` is not a finite value for each joint.
    """
    at = reference_configuration(found) if at is None else at
    values = finite_vector("at", at, len(found.model.joint_names))
    return JointSection(found, tuple(joints), values)


def joint_unit(found: SingularityMap, joint: int) -> tuple[str, float]:
    """Unit in which a joint is shown, degrees or metres, and its number per rad or m."""
    return ("m", 1.0) if found.polynomial.bases[joint].prismatic else ("deg", 180.0 / np.pi)


def joint_text(found: SingularityMap, joint: int, value: float) -> str:
    """A joint's value with its unit, such as ``30°``."""
    unit, factor = joint_unit(found, joint)
    return style.digits(factor * value) + ("°" if unit == "deg" else " m")


def influential_joints(found: SingularityMap, count: int) -> list[int]:
    """The joints with the largest influence on det A, in order of the arm.

    A joint's influence is the mean square of the part of det A that depends on it. If det A depends
    on fewer joints, others are added.
    """
    polynomial = found.polynomial
    squares = polynomial.coefficients**2
    for axis, basis in enumerate(polynomial.bases):
        weights = np.where(np.arange(basis.size) > 0, 0.5, 1.0)
        shape = np.ones(squares.ndim, dtype=int)
        shape[axis] = basis.size
        squares = squares * weights.reshape(shape)
    influences = [
        squares.sum() - squares.take(0, joint).sum() if basis.degree else -np.inf
        for joint, basis in enumerate(polynomial.bases)
    ]
    return sorted(np.argsort(-np.array(influences), kind="stable")[:count].tolist())


def reference_configuration(found: SingularityMap) -> Array:
    """A configuration far from singularities, revolute joints at multiples of 5 degrees.

    It has the largest magnitude of det A of 4096 samples; joints on which det A does not depend are
    at zero, or in the middle of a prismatic joint's range; fixed joints keep their values.
    """
    bases = found.polynomial.bases
    lower, upper = (np.array([getattr(b, end) for b in bases]) for end in ("lower", "upper"))
    q = np.tile((lower + upper) / 2.0, (_JOINT_SAMPLES, 1))
    joints = found.joints
    samples = low_discrepancy(_JOINT_SAMPLES, len(joints))
    q[:, joints] = lower[joints] + (upper - lower)[joints] * samples
    revolute = [joint for joint in joints if not bases[joint].prismatic]
    q[:, revolute] = _STEP * np.round(q[:, revolute] / _STEP)
    best: Array = q[int(np.argmax(np.abs(found.polynomial.values(q))))]
    for name, value in found.fixed.items():
        best[found.model.joint_names.index(name)] = value
    return best


def map_figures(found: SingularityMap, *_: Any) -> style.Drawings:
    """The figures of a map of the joint space."""
    return singularity_figures(found).drawings


def singularity_figures(found: SingularityMap, at: npt.ArrayLike | None = None) -> style.Figures:
    """The figures of a map of the joint space by name.

    ``singularities`` if det A depends on two joints; else ``slices`` over pairs of the four most
    influential joints. Colours show the certified boxes, lines where det A vanishes.

    Args:
        found: Map of the joint space.
        at: Values of all joints [rad or m], shape (n,), through which slices pass; by default a
            configuration far from singularities.

    Raises:
        InputError: If ``at`` is not a finite value for each joint.

    Example:
        >>> model = ff.FreeFloatingModel.from_urdf("planar_2dof")
        >>> found = ff.singularity_map(model, "planar-position", np.radians(1.0))
        >>> list(ff.figures(found))
        ['singularities']
    """
    if len(found.joints) <= 2:
        plane = section(found, influential_joints(found, 2), at)
        return style.Figures({"singularities": partial(_plane_figure, plane)})
    joints = influential_joints(found, min(_PAIRED, len(found.joints)))
    planes = [section(found, pair, at) for pair in combinations(joints, 2)]
    return style.Figures({"slices": partial(_slices_figure, planes)})


@style.styled
def _plane_figure(plane: JointSection) -> Figure:
    """The figure of the two joints on which det A depends."""
    figure = style.new_figure(style.COLUMN, 3.8)
    handles = _draw_section(figure.subplots(), plane)
    figure.legend(handles=handles, loc="outside lower center", ncols=2)
    return figure


@style.styled
def _slices_figure(planes: Sequence[JointSection]) -> Figure:
    """The figure of sections over pairs of joints, with the other joints' values below."""
    rows = len(planes) // 3
    figure = style.new_figure(style.PAGE, 0.65 + 2.2 * rows)
    panels = figure.subplots(rows, 3, squeeze=False).ravel()
    handles: dict[str, Any] = {}
    for axes, plane in zip(panels, planes, strict=True):
        handles |= {str(handle.get_label()): handle for handle in _draw_section(axes, plane)}
    shown = JointSection(planes[0].found, (), planes[0].at).constants()
    caption = fill(f"The joints that are not on a panel's axes: {shown}.", _CAPTION_LENGTH)
    figure.legend(
        handles=list(handles.values()), title=caption, title_fontsize=7.0,
        loc="outside lower center", ncols=len(handles),
    )  # fmt: skip
    return figure


def _draw_section(axes: Any, plane: JointSection) -> list[Any]:
    """Draw a section over two joints, the first one to the right, and return its legend's entries.

    The zeros of det A are drawn where it changes its sign.
    """
    kinds = plane.found.kinds(plane.grid(plane.ticks((np.arange(_RASTER) + 0.5) / _RASTER)))
    classes = np.clip(kinds.astype(int) - Kind.POSITIVE, 0, len(_COLOURS) - 1)
    units = [joint_unit(plane.found, joint) for joint in plane.joints]
    factors = np.array([factor for _, factor in units])
    lower, upper = factors * plane.lower, factors * plane.upper
    axes.imshow(
        classes.reshape(_RASTER, _RASTER).T, cmap=ListedColormap(_COLOURS), origin="lower",
        extent=(lower[0], upper[0], lower[1], upper[1]), aspect="auto", interpolation="nearest",
        vmin=0, vmax=len(_COLOURS) - 1, zorder=0,
    )  # fmt: skip
    revolute = [unit == "deg" for unit, _ in units]
    shifts = _SHIFT * (plane.upper - plane.lower) * revolute
    lines = plane.ticks(np.linspace(0.0, 1.0, _RASTER + 1))
    ticks = [tick + shift for tick, shift in zip(lines, shifts, strict=True)]
    values = plane.polynomial.values(plane.grid(ticks)).reshape(_RASTER + 1, _RASTER + 1)
    hidden = (classes == len(_COLOURS) - 1) & _beneath_zeros(values).ravel()
    handles: list[Any] = [
        Patch(facecolor=_COLOURS[k], edgecolor=style.BLACK, linewidth=0.4, label=_LABELS[k])
        for k in np.unique(classes[~hidden])
    ]
    if plane.signs_differ(values):
        x, y = (factor * tick for factor, tick in zip(factors, ticks, strict=True))
        axes.contour(x, y, values.T, levels=[0.0], colors=[style.BLACK], linewidths=0.9)
        handles.append(Line2D([], [], color=style.BLACK, linewidth=0.9, label="det A = 0"))
    _frame(axes, plane, units)
    return handles


def _beneath_zeros(values: Array) -> npt.NDArray[np.bool_]:
    """Cells (K, K) that the line hides where values (K + 1, K + 1) at their corners change sign."""
    positive = values > 0.0
    corners = [positive[:-1, :-1], positive[1:, :-1], positive[:-1, 1:], positive[1:, 1:]]
    crossed = np.any(corners, axis=0) & ~np.all(corners, axis=0)
    return np.asarray(scipy.ndimage.binary_dilation(crossed))


def _frame(axes: Any, plane: JointSection, units: Sequence[tuple[str, float]]) -> None:
    """Name the axes, and put ticks at quarters of a revolution."""
    names = [style.plain(plane.found.model.joint_names[joint]) for joint in plane.joints]
    axes.set_xlabel(style.axis_label(names[0], units[0][0]))
    axes.set_ylabel(style.axis_label(names[1], units[1][0]), labelpad=0.0)
    quarters = np.arange(-180, 181, 90)
    if units[0][0] == "deg":
        axes.set_xticks(quarters)
    if units[1][0] == "deg":
        axes.set_yticks(quarters)
    axes.set_box_aspect(1.0)
    axes.grid(visible=False)
