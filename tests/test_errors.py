"""Errors carry their evidence, tell a way out, and travel between processes."""

from __future__ import annotations

import copy
import importlib
import pickle
import pkgutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import freefloat
from freefloat.errors import (
    FreeFloatError,
    InputError,
    IntegrationError,
    ModelError,
    UnreachableError,
)
from freefloat.io.scenario import load_scenario
from freefloat.planning.simulation import simulate

INPUT = ("path.line.from", "[1, nan, 0] was given", "3 finite numbers", "wish.yaml")


def every_error_class() -> list[type[FreeFloatError]]:
    """All of them, wherever they are defined."""
    for module in pkgutil.iter_modules(freefloat.__path__):
        if module.name != "__main__":
            importlib.import_module(f"freefloat.{module.name}")
    return [FreeFloatError, *_below(FreeFloatError)]


def _below(kind: type[FreeFloatError]) -> Iterator[type[FreeFloatError]]:
    for child in kind.__subclasses__():
        yield child
        yield from _below(child)


def example(kind: type[FreeFloatError]) -> FreeFloatError:
    """An error of a class, made as the package makes it."""
    if issubclass(kind, InputError):
        return kind(*INPUT)
    if issubclass(kind, IntegrationError):
        return kind(12.5, "the step became too small")
    return kind("what went wrong")


@pytest.mark.parametrize("protocol", range(2, pickle.HIGHEST_PROTOCOL + 1))
def test_every_error_survives_pickling_with_its_evidence(protocol: int) -> None:
    for kind in every_error_class():
        error = example(kind)
        again = pickle.loads(pickle.dumps(error, protocol))
        assert type(again) is kind
        assert str(again) == str(error)
        assert vars(again) == vars(error)
        assert again.args == error.args


def test_every_error_survives_copying() -> None:
    for kind in every_error_class():
        error = example(kind)
        for again in (copy.copy(error), copy.deepcopy(error)):
            assert type(again) is kind
            assert vars(again) == vars(error)


def test_one_name_catches_everything_raised_on_purpose() -> None:
    for kind in every_error_class():
        assert issubclass(kind, FreeFloatError)
        assert not issubclass(kind, ValueError | OSError)
    assert freefloat.FreeFloatError is FreeFloatError
    assert freefloat.InputError is InputError
    assert issubclass(ModelError, InputError)
    assert issubclass(UnreachableError, InputError)
    assert not issubclass(IntegrationError, InputError)


@pytest.mark.parametrize("kind", [InputError, ModelError, UnreachableError])
def test_a_message_names_file_key_problem_and_what_is_accepted(kind: type[InputError]) -> None:
    error = kind(*INPUT)
    assert str(error) == (
        "wish.yaml: path.line.from: [1, nan, 0] was given; accepted: 3 finite numbers"
    )
    assert (error.key, error.problem, error.accepted, error.source) == INPUT


def test_a_message_without_a_file_begins_with_the_key() -> None:
    error = InputError("momentum", "two numbers", "three")
    assert str(error) == "momentum: two numbers; accepted: three"
    assert error.source is None


def test_an_integration_error_tells_when_why_and_what_to_try() -> None:
    error = IntegrationError(12.3456789, "the step became too small")
    assert "t = 12.3457 s" in str(error)
    assert "the step became too small" in str(error)
    assert "try" in str(error)
    assert (error.time, error.reason) == (12.3456789, "the step became too small")


@pytest.mark.parametrize("kind", [InputError, ModelError, UnreachableError])
def test_an_error_can_be_told_again_with_the_file_it_was_found_in(kind: type[InputError]) -> None:
    error = kind("line.from", "[1] was given", "3 finite numbers")
    told = error.found_in("wish.yaml", "path.")
    assert type(told) is kind
    assert (told.key, told.source) == ("path.line.from", "wish.yaml")
    assert (told.problem, told.accepted) == (error.problem, error.accepted)
    assert (error.key, error.source) == ("line.from", None)


def test_an_error_that_names_a_file_keeps_it() -> None:
    assert (
        InputError("link", "no mass", "a mass", "arm.urdf").found_in("a.yaml").source == "arm.urdf"
    )


def test_errors_of_a_file_survive_pickling_as_they_are_raised(tmp_path: Path) -> None:
    file = tmp_path / "wish.yaml"
    file.write_text("robot: [1]\n")
    with pytest.raises(InputError) as caught:
        load_scenario(file)
    again = pickle.loads(pickle.dumps(caught.value))
    assert str(again) == str(caught.value)
    assert again.source == str(file)


def test_an_unreachable_start_survives_pickling_as_it_is_raised(tmp_path: Path) -> None:
    file = tmp_path / "wish.yaml"
    file.write_text(
        "robot: {urdf: planar_3dof, end_effector: end_effector}\n"
        "task: planar-position\n"
        "path: {line: {from: [9, 0, 0], to: [8, 0, 0]}}\n"
        "timing: {duration: 10}\n"
    )
    with pytest.raises(UnreachableError) as caught:
        simulate(load_scenario(file).problem(), np.array([0.0, 0.0, 0.0, 1.0]))
    again = pickle.loads(pickle.dumps(caught.value))
    assert type(again) is UnreachableError
    assert vars(again) == vars(caught.value)
    assert "[9.0, 0.0, 0.0]" in again.problem
