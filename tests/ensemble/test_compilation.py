"""Compilation of kernels and their cache on disk."""

import grp
import json
import logging
import os
import pwd
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher

import freefloat as ff
from freefloat.beyond.engines.rate_commands import RateCommands
from freefloat.ensemble.ensemble import EnsembleIntegrator
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.lockstep.cache_files import CheckedCacheFile
from freefloat.lockstep.compilation import compiled
from freefloat.motion.motion import Motion
from freefloat.so3 import frozen
from tests.commands import without_progress

HELPER = """
from freefloat.lockstep.compilation import compiled

@compiled
def factor() -> float:
    return {value}
"""
KERNEL = """
from freefloat.lockstep.compilation import compiled
from helper import factor

@compiled
def scaled(x):
    '''Scale.'''
    return factor() * x
"""
RUN = """
from pathlib import Path
from freefloat.lockstep import compilation
compilation._PACKAGE = Path.cwd()
import kernel
print(kernel.scaled(3.0), sum(kernel.scaled.stats.cache_hits.values()), kernel.scaled.__doc__)
"""


def run(folder: Path, caches: Path | None = None, before: str = "") -> list[str]:
    """Result of the kernel in a new process, the number of cache hits, and warnings."""
    command = [sys.executable, "-c", before + RUN]
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(caches or folder / "cache")}
    done = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, check=True
    )
    return [*done.stdout.split(), *done.stderr.splitlines()]


@pytest.mark.slow
def test_cached_kernels_are_compiled_again_when_a_called_kernel_changes(tmp_path: Path) -> None:
    """Also when it is in another file, which Numba does not check; not in another checkout."""
    for name, value, found in (("a", 2.0, ["6.0", "0"]), ("b", 2.0, ["6.0", "1"]),
                               ("a", 5.0, ["15.0", "0"])):  # fmt: skip
        (folder := tmp_path / name).mkdir(exist_ok=True)
        (folder / "kernel.py").write_text(KERNEL)
        (folder / "helper.py").write_text(HELPER.format(value=value))
        assert run(folder, tmp_path / "cache") == [*found, "Scale."]


@pytest.mark.slow
def test_edits_of_kernels_and_of_their_constants_alone_have_another_cache(tmp_path: Path) -> None:
    """Studies name Numba among the software of their runs, and compile nothing."""
    package, caches = tmp_path / "freefloat", tmp_path / "cache"
    shutil.copytree(Path(ff.__file__).parent, package)
    environment = {**os.environ, "PYTHONPATH": str(tmp_path), "NUMBA_CACHE_DIR": str(caches)}
    command = [sys.executable, "-c", "import freefloat.ik.kernels"]
    counts = []
    for file in ("studies/database.py", "ensemble/kernels/flow.py", "ensemble/endings.py"):
        subprocess.run(command, env=environment, check=True)
        with (package / file).open("a") as source:
            source.write("# edited\n")
        subprocess.run(command, env=environment, check=True)
        counts.append(len([*caches.iterdir()]))
    assert counts == [1, 2, 3]


@pytest.mark.slow
def test_kernels_are_cached_by_a_numba_whose_cache_files_are_others(tmp_path: Path) -> None:
    """Digests are left out."""
    (tmp_path / "kernel.py").write_text(KERNEL)
    (tmp_path / "helper.py").write_text(HELPER.format(value=2.0))
    changed = (
        "import numba.core.caching as own, sys, types; other = types.ModuleType(own.__name__)\n"
        "vars(other).update(vars(own)); del other.IndexDataCacheFile\n"
        "sys.modules[own.__name__] = other"
    )
    assert run(tmp_path, before=changed) == ["6.0", "0", "Scale."]
    assert run(tmp_path, before=changed) == ["6.0", "1", "Scale."]


@pytest.mark.slow
def test_a_cache_folder_that_others_may_write_to_is_not_used(tmp_path: Path) -> None:
    """Numba unpickles its files; the folders above count, too."""
    (tmp_path / "kernel.py").write_text(KERNEL)
    (tmp_path / "helper.py").write_text(HELPER.format(value=2.0))
    (caches := tmp_path / "outer" / "caches").mkdir(parents=True)
    assert run(tmp_path, caches) == ["6.0", "0", "Scale."]
    for folder in (caches, caches.parent):
        folder.chmod(0o777)
        *result, sentence = run(tmp_path, caches)
        assert (result, str(caches) in sentence) == (["6.0", "0", "Scale."], True)
        folder.chmod(0o700)


@pytest.mark.slow
def test_a_configuration_file_of_the_current_folder_names_no_cache(tmp_path: Path) -> None:
    """Whoever sends a folder with one, and caches beside it, could run code."""
    (tmp_path / "kernel.py").write_text(KERNEL)
    (tmp_path / "helper.py").write_text(HELPER.format(value=2.0))
    (tmp_path / ".numba_config.yaml").write_text(f"cache_dir: {tmp_path / 'sent'}")
    environment = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"}
    environment["XDG_CACHE_HOME"] = str(tmp_path / "own")
    command = [sys.executable, "-c", RUN]
    subprocess.run(command, cwd=tmp_path, env=environment, umask=0, check=True)
    assert not (tmp_path / "sent").exists()
    (folder,) = (tmp_path / "own" / "freefloat").iterdir()
    files = [*folder.glob("*.nb?")]
    assert {file.suffix for file in files} == {".nbi", ".nbc"}
    for place in (folder, folder.parent, folder.parent.parent, *files):
        assert place.stat().st_mode & 0o022 == 0, "whatever the umask"


@pytest.mark.parametrize(("suffix", "damage"), [(".nbi", "empty"), (".nbc", "flipped")])
def test_a_damaged_cache_entry_is_deleted_and_reported_once(tmp_path, caplog, suffix, damage):
    files = CheckedCacheFile(str(tmp_path), "kernel", "stamp")
    files.save("signature", b"machine code")
    assert files.load("signature") == b"machine code"
    (path,) = tmp_path.glob(f"*{suffix}")
    content = path.read_bytes()
    middle = len(content) // 2
    changed = bytes([content[middle] ^ 1])
    path.write_bytes({
        "empty": b"",
        "flipped": content[:middle] + changed + content[middle + 1 :],
    }[damage])  # fmt: skip
    with caplog.at_level(logging.WARNING, "freefloat"):
        assert files.load("signature") is None
    assert [str(path) in record.getMessage() for record in caplog.records] == [True]
    assert not path.exists()
    files.save("signature", b"new machine code")
    assert files.load("signature") == b"new machine code"
    assert CheckedCacheFile(str(tmp_path), "kernel", "other stamp").load("signature") is None


@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
def test_cache_files_that_others_may_write_to_are_not_read(tmp_path: Path, suffix: str) -> None:
    """Whoever wrote them while the folder was open could run code."""
    files = CheckedCacheFile(str(tmp_path), "kernel", "stamp")
    files.save("signature", b"machine code")
    (path,) = tmp_path.glob(f"*{suffix}")
    path.chmod(0o666)
    assert files.load("signature") is None
    path.chmod(0o644)
    assert files.load("signature") == b"machine code"
    path.rename(tmp_path / "elsewhere")
    path.symlink_to(tmp_path / "elsewhere")
    assert files.load("signature") is None


@pytest.mark.parametrize(("name", "member", "primary", "read"), [
    ("me", "me", "me", True), ("staff", "me", "me", False), ("me", "you", "me", False),
    ("me", "me", "you", False),
])  # fmt: skip
def test_a_group_that_may_write_to_cache_files_is_the_users_own(
    name: str, member: str, primary: str, read: bool, tmp_path: Path, monkeypatch
) -> None:
    """It has the user's name, and nobody else belongs to it, also as to a primary group."""
    files = CheckedCacheFile(str(tmp_path), "kernel", "stamp")
    files.save("signature", b"machine code")
    for path in tmp_path.iterdir():
        path.chmod(0o660)
    number = path.stat().st_gid
    users = [pwd.struct_passwd((user, "x", 7, number, "", "", "")) for user in ("me", primary)]
    group = grp.struct_group((name, "x", number, [member]))
    monkeypatch.setattr(pwd, "getpwuid", lambda _: users[0])
    monkeypatch.setattr(pwd, "getpwall", lambda: users)
    monkeypatch.setattr(grp, "getgrgid", lambda _: group)
    assert (files.load("signature") is not None) == read


def test_a_cache_that_cannot_be_written_is_no_error(tmp_path: Path) -> None:
    files = CheckedCacheFile(str(tmp_path / "missing"), "kernel", "stamp")
    files.save("signature", b"machine code")
    assert files.load("signature") is None


OTHER_NUMBA = {
    "another place": "import numba.core.typed_passes as passes; del passes.NativeLowering",
    "other arguments": (
        "import numba, sys, types; changed = types.ModuleType('numba._dynfunc')\n"
        "changed.make_function = lambda module: None; sys.modules[changed.__name__] = changed"
    ),
}
SMALL_KERNEL = """
import numpy as np
from freefloat.lockstep.compilation import compiled, inlined, inner
from freefloat.lockstep.lanes import sine_cosine, sqrt
from freefloat.lockstep.tables import lanes

@inlined
def next_of(x):
    return x + 1.0

@inner
def length(x):
    sine, cosine = sine_cosine(next_of(x))
    return sqrt(sine * sine + 2.0 * cosine * cosine)

@compiled
def lengths(x, out):
    lanes(out, 1)[0] = length(lanes(x, 1)[0])

lengths(np.arange(8.0), out := np.empty(8))
print(out.tolist())
"""


@pytest.mark.slow
@pytest.mark.parametrize("difference", OTHER_NUMBA)
def test_kernels_run_with_a_numba_whose_private_classes_are_others(difference: str) -> None:
    """Numba promises nothing of those that its compiler is extended with."""
    command = [sys.executable, "-c", OTHER_NUMBA[difference] + SMALL_KERNEL]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    expected = np.sqrt(1.0 + np.cos(np.arange(8.0) + 1.0) ** 2)
    np.testing.assert_allclose(json.loads(done.stdout), expected, rtol=1e-14)


@pytest.mark.slow
def test_kernels_without_the_compiler_are_refused() -> None:
    command = [sys.executable, "-m", "freefloat", "plan", "planar_2dof/line"]
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert done.returncode == 2
    assert "NUMBA_DISABLE_JIT" in done.stderr
    assert len(without_progress(done.stderr).splitlines()) == 1


def test_kernels_run_without_a_cache_folder() -> None:
    """A function without a file has no folder for its cache."""
    scope = {"compiled": compiled}
    exec(compile("@compiled\ndef twice(x):\n    return 2.0 * x\n", "<nowhere>", "exec"), scope)
    assert scope["twice"](4.0) == 8.0
    assert not scope["twice"].stats.cache_path


def signatures() -> dict[str, int]:
    return {
        f"{name}.{kernel}": len(thing.signatures)
        for name in sys.modules if name.startswith("freefloat.")
        for kernel, thing in vars(sys.modules[name]).items() if isinstance(thing, Dispatcher)
    }  # fmt: skip


def test_integers_read_only_arrays_and_single_motions_need_no_further_compilation() -> None:
    """Compiling the kernels again would take a quarter of a minute."""
    problem = ff.load_scenario("spatial_6dof/line").problem()
    used(problem)
    before = signatures()
    path = ff.TimedPath(problem.path.path, ff.Timing(round(problem.path.duration)))
    margin = ff.Margin(problem.margin.measure, round(problem.margin.threshold))
    whole = ff.Problem(problem.model, path, problem.task, (0, 0, 1), margin)
    motion = used(whole)
    state = motion.attitudes[:1], motion.joints[:1]
    EnsembleIntegrator(whole, 1).integrate(*state)
    assert before["freefloat.ensemble.kernels.integration.integrate_many"] > 0
    assert signatures() == before
    states = [*state, whole.path.twist(0.0)[None]]
    RateCommands(whole).rates(*map(np.array, states), 0.1)
    before = signatures()
    RateCommands(whole).rates(*map(frozen, states), 0.1)
    assert signatures() == before


def used(problem: ff.Problem) -> Motion:
    attitude = np.array([0.0, 0.0, 0.0, 1.0])
    results = FeasibilityEvaluator(problem, 1).evaluate(attitude[None], stop_at_margin=True)
    assert (results.motions.endings >= 0).any()
    return ff.simulate(problem, attitude).chosen.motion
