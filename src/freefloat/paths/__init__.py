"""End-effector paths and their timing."""

from freefloat.paths.curves import ArcCurve as ArcCurve
from freefloat.paths.curves import Curve as Curve
from freefloat.paths.curves import PolynomialCurve as PolynomialCurve
from freefloat.paths.curves import SplineCurve as SplineCurve
from freefloat.paths.directed_orientation import DirectedOrientation as DirectedOrientation
from freefloat.paths.orientation import FixedOrientation as FixedOrientation
from freefloat.paths.orientation import OrientationLaw as OrientationLaw
from freefloat.paths.orientation import SlerpOrientation as SlerpOrientation
from freefloat.paths.path import EndEffectorPath as EndEffectorPath
from freefloat.paths.path import through as through
from freefloat.paths.relative_path import RelativePath as RelativePath
from freefloat.paths.timed_path import PathStack as PathStack
from freefloat.paths.timed_path import TimedPath as TimedPath
from freefloat.paths.timing import Stop as Stop
from freefloat.paths.timing import TimeLaw as TimeLaw
from freefloat.paths.timing import Timing as Timing
from freefloat.paths.transfer import PolynomialOrientation as PolynomialOrientation
from freefloat.paths.transfer import transfer as transfer
