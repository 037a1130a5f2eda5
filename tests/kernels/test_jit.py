"""The cache on disk: never a stale kernel, never one build in place of another, and no needless compilation.

Each test copies the decorators into a small package of its own with a cache of its own, and runs it in
processes of its own, as users do between edits.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from crowd_kernels import _jit

CONSTANTS = "FACTOR = {factor}\n"
LEAF = """
from crowd_kernels._jit import kernel
from crowd_kernels import constants

@kernel
def scaled(x):
    return constants.FACTOR * x{plus}
"""
DRIVER = """
from numba import get_thread_id
from crowd_kernels._jit import parallel_kernel, prange
from crowd_kernels.leaf import scaled

@parallel_kernel
def fill(out_value, out_thread):
    for chunk in prange(64):
        out_value[chunk] = scaled(1.0)
        out_thread[chunk] = get_thread_id()
"""
RUN = """
import json, sys
import numpy as np
from numba.np.ufunc.parallel import _launch_threads
from crowd_kernels.driver import fill

_launch_threads()  # what tells the thread crashes in a process that has none

report = {}
for name in sys.argv[1:]:
    build, value, thread = getattr(fill, name), np.zeros(64), np.zeros(64, np.int64)
    build(value, thread)
    report[name] = {
        "value": float(value[0]),
        "threads": len(set(thread.tolist())),
        "was_cached": sum(build.stats.cache_hits.values()) > 0,
    }
print(json.dumps(report))
"""


class Package:
    """A copy of the decorators with three small modules."""

    def __init__(self, folder):
        self.folder = folder
        self.modules = folder / "crowd_kernels"
        self.modules.mkdir(parents=True)
        source = Path(_jit.__file__).read_text(encoding="utf-8")
        for name, text in {"__init__": "", "_jit": source, "driver": DRIVER, "unrelated": "x = 1\n"}.items():
            self.write(name, text)
        self.write("leaf", LEAF.format(plus=""))
        self.write("constants", CONSTANTS.format(factor=2.0))

    def write(self, name, text):
        (self.modules / f"{name}.py").write_text(text, encoding="utf-8")

    def run(self, *builds, **variables):
        environment = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
        environment |= {
            "PYTHONPATH": str(self.folder),
            "NUMBA_CACHE_DIR": str(self.folder / "cache"),
            "NUMBA_NUM_THREADS": "2",
            **variables,
        }
        done = subprocess.run(
            [sys.executable, "-c", RUN, *builds], env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)


@pytest.fixture
def package(tmp_path):
    return Package(tmp_path)


def test_an_edit_in_another_file_is_seen_and_only_then_is_compiled_again(package):
    assert package.run("serial")["serial"] == {"value": 2.0, "threads": 1, "was_cached": False}
    assert package.run("serial")["serial"] == {"value": 2.0, "threads": 1, "was_cached": True}

    package.write("leaf", LEAF.format(plus=" + 0.25"))
    assert package.run("serial")["serial"]["value"] == 2.25, "an edit in the callee's file"

    package.write("constants", CONSTANTS.format(factor=5.0))
    assert package.run("serial")["serial"]["value"] == 5.25, "an edit in a file that the callee's imports"

    package.write("unrelated", "x = 2\n")
    assert package.run("serial")["serial"] == {"value": 5.25, "threads": 1, "was_cached": True}


@pytest.mark.parametrize("order", [("serial", "threaded"), ("threaded", "serial")])
def test_serial_and_threaded_builds_do_not_take_each_others_place(package, order):
    threads = {"serial": 1, "threaded": 2}
    for build in order:
        assert package.run(build)[build] == {"value": 2.0, "threads": threads[build], "was_cached": False}
    again = package.run(*order)
    for build in order:
        assert again[build] == {"value": 2.0, "threads": threads[build], "was_cached": True}


def test_a_build_that_checks_bounds_is_kept_apart(package):
    assert not package.run("serial")["serial"]["was_cached"]
    assert not package.run("serial", NUMBA_BOUNDSCHECK="1")["serial"]["was_cached"]
    assert package.run("serial")["serial"]["was_cached"]


@pytest.mark.parametrize(
    "text",
    [
        "from crowd_kernels.vector import add",
        "from crowd_kernels import vector",
        "from crowd_kernels import vector as v, quaternion",
        "import crowd_kernels.vector",
        "import crowd_kernels.vector as v",
        "from .vector import add",
        "from . import vector",
        "def f():\n    from crowd_kernels.vector import add",
    ],
)
def test_every_form_of_import_is_followed(text, monkeypatch, tmp_path):
    for name in ("vector", "quaternion"):
        (tmp_path / f"{name}.py").write_text("", encoding="utf-8")
    monkeypatch.setattr(_jit, "PACKAGE_FOLDER", tmp_path)
    assert "vector" in _jit.imported_modules(text)


@pytest.mark.parametrize("text", ["import numpy as np", "from math import sqrt", "from numpy import vector"])
def test_other_packages_are_not_followed(text):
    assert _jit.imported_modules(text) == set()


def test_numbers_of_threads_are_reported_and_set():
    before = _jit.thread_count()
    assert 1 <= before <= _jit.maximum_thread_count()
    _jit.set_thread_count(1)
    assert _jit.thread_count() == 1
    _jit.set_thread_count(before)
