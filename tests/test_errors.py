"""Errors keep their attributes between processes."""

import importlib
import pickle
import pkgutil
from collections.abc import Iterator

import pytest

import freefloat
import freefloat as ff
from freefloat.errors import FreeFloatError, IntegrationError, ModelError, UnreachableError

INPUT = ("path.line.from", "[1, nan, 0] was given", "3 finite numbers", "scenario.yaml")


def every_error_class() -> list[type[FreeFloatError]]:
    for module in pkgutil.iter_modules(freefloat.__path__):
        if module.name != "__main__":
            importlib.import_module(f"freefloat.{module.name}")
    return [FreeFloatError, *_below(FreeFloatError)]


def _below(kind: type[FreeFloatError]) -> Iterator[type[FreeFloatError]]:
    for child in kind.__subclasses__():
        yield child
        yield from _below(child)


def example(kind: type[FreeFloatError]) -> FreeFloatError:
    if issubclass(kind, ff.InputError):
        return kind(*INPUT)
    if issubclass(kind, IntegrationError):
        return kind(12.5, "the step became too small")
    return kind("what went wrong")


@pytest.mark.parametrize("protocol", range(2, pickle.HIGHEST_PROTOCOL + 1))
def test_errors_keep_their_attributes_when_pickled(protocol: int) -> None:
    for kind in every_error_class():
        error = example(kind)
        again = pickle.loads(pickle.dumps(error, protocol))
        assert type(again) is kind
        assert str(again) == str(error)
        assert vars(again) == vars(error)
        assert again.args == error.args


@pytest.mark.parametrize("kind", [ff.InputError, ModelError, UnreachableError])
def test_found_in_adds_the_file_and_keeps_the_class(kind: type[ff.InputError]) -> None:
    error = kind("line.from", "[1] was given", "3 finite numbers")
    located = error.found_in("scenario.yaml", "path.")
    assert type(located) is kind
    assert (located.key, located.source) == ("path.line.from", "scenario.yaml")
    assert located.found_in("other.yaml").source == "scenario.yaml"
