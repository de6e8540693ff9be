"""What all tests share: the bundled robots, a seeded generator, one hypothesis profile."""

import os
import signal
from collections import Counter
from collections.abc import Generator, Iterator
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command does; read with numpy

import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from playwright.sync_api import Browser, sync_playwright

from freefloat.attitude_grids import attitude_grid
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.io.scenario.loading import load_scenario
from freefloat.motion.problem import Problem
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.named_files import models_folder
from freefloat.so3 import heading_quaternion
from freefloat.visualization.page.pictures import find_browser
from tests.browser import FLAGS
from tests.motions import bundled
from tests.robots import ur5_on_spacecraft

settings.register_profile(
    "freefloat",
    derandomize=True,  # the same examples on every machine and every day
    deadline=None,
    max_examples=15,
    database=None,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("freefloat")


def pytest_configure(config: pytest.Config) -> None:
    """Commands that tests start hear Ctrl-C, also where tests run in a shell's background.

    Files are distributed in the order of :func:`pytest_collection_modifyitems`.
    """
    config.option.loadscopereorder = False
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


LONG = ("test_contributing.py", "test_documents.py", "test_tutorial.py", "test_mission.py")
"""Files whose few tests are the slowest ones."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files with slow tests begin, so that no worker waits for another in the end."""
    slow = Counter(item.path for item in items if item.get_closest_marker("slow"))
    items.sort(key=lambda item: (item.path.name not in LONG, -slow[item.path]))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport() -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Where ``CI`` is set everything must run: what is skipped fails with the reason."""
    report = yield
    if report.skipped and os.environ.get("CI"):
        report.outcome, report.longrepr = "failed", f"skipped: {report.longrepr}"
    return report


@pytest.fixture(scope="session")
def kernels() -> None:
    """Compiled kernels: tests that measure time or interrupt commands start with them."""
    kinds = ("planar_3dof/parabola", "spatial_6dof/line", "ur5_servicer/arc", "panda_servicer/line")
    for name in kinds:
        problem = load_scenario(name).problem()
        planar = heading_quaternion(np.arange(6))
        attitudes = planar if problem.task.planar else attitude_grid(8)
        FeasibilityEvaluator(problem).evaluate(attitudes)


@pytest.fixture(scope="session")
def planar_3dof() -> FreeFloatingModel:
    """Table I of the paper."""
    return FreeFloatingModel.from_urdf(models_folder() / "planar_3dof" / "planar_3dof.urdf")


@pytest.fixture(scope="session")
def spatial_6dof() -> FreeFloatingModel:
    """Table II of the paper."""
    return FreeFloatingModel.from_urdf(models_folder() / "spatial_6dof" / "spatial_6dof.urdf")


@pytest.fixture(scope="session")
def spatial() -> Problem:
    """Example 2 of the paper."""
    return bundled("spatial_6dof/line")


@pytest.fixture(scope="session")
def planar() -> Problem:
    """Example 1 of the paper, at rest at F on the way."""
    return bundled("planar_3dof/parabola")


@pytest.fixture(scope="session")
def ur5() -> FreeFloatingModel:
    """A stock arm whose wrist is not spherical, on a spacecraft of 200 kg."""
    return FreeFloatingModel.from_urdf(ur5_on_spacecraft(), "tool0")


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """Chromium without a window."""
    executable = find_browser()
    if executable is None:
        pytest.skip("no Chromium or Chrome on this machine")
    with sync_playwright() as playwright:
        launched = playwright.chromium.launch(executable_path=executable, args=FLAGS)
        yield launched
        launched.close()


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def rng() -> np.random.Generator:
    """Random numbers, the same in every test and every run."""
    return np.random.default_rng(20160804)
