"""Numbers of eight motions in lanes of a processor; knows no robot.

Its import raises a MissingNumbaError where Numba cannot be imported.
"""

from freefloat.errors import MissingNumbaError

try:
    import numba as numba
except Exception as error:  # whatever its libraries and its configuration file lead to
    raise MissingNumbaError(
        "numba",
        f"it cannot be imported ({str(error).rstrip('.')}), but spatial plans and maps, studies, "
        "goals, other arms than elbow arms and several arms on paths need kernels that it compiles",
        "pip install --upgrade numba",
    ) from error
