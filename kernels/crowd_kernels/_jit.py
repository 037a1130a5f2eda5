"""The only file that names Numba's decorators.

Numba's on-disk cache knows the content of a kernel's own file and nothing else: an edit in a callee's file
goes unseen, and the serial and the parallel build of one function share a cache file. Both are cured here by
folding a digest into the name under which a kernel is cached: the sources of the kernel's module and of
every module of this package that it imports, directly or not, and the build flags.

Kernels borrow their arrays: who calls the outermost one owns them until it returns. So all but threaded
drivers are compiled without Numba's reference counting, which would count every array, slice and field of a
tuple up and down atomically, and take longer than the arithmetic of a row. In turn a kernel that allocates,
copies one array into another as a whole, or returns a part of one, does not compile: Numba says that it needs
its runtime.
"""

import ast
import hashlib
import os
import threading
from collections.abc import Callable
from functools import cache, cached_property
from pathlib import Path
from types import FunctionType
from typing import Any, Generic, ParamSpec, TypeVar, cast

import numba

P = ParamSpec("P")
R = TypeVar("R")

PACKAGE_FOLDER = Path(__file__).parent
PACKAGE_NAME = PACKAGE_FOLDER.name
IS_THREADED = True
"""Chunks of a parallel kernel run at the same time, so that each needs its own scratch row. In the serial
build all take the first row, which stays in the cache."""
CHECKS_BOUNDS = os.environ.get("NUMBA_BOUNDSCHECK", "0") != "0"

# Numba falls back to a threading layer that aborts when two threads launch at once.
_launch_lock = threading.Lock()


def imported_modules(source: str) -> set[str]:
    """Names of this package's modules that a source text imports, such as ``{"quaternion"}``."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            paths = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            origin = node.module or ""
            if node.level > 0:
                origin = f"{PACKAGE_NAME}.{origin}".rstrip(".")
            paths = [origin, *(f"{origin}.{alias.name}" for alias in node.names)]
        else:
            continue
        found.update(path.split(".")[1] for path in paths if path.startswith(PACKAGE_NAME + "."))
    return {name for name in found if (PACKAGE_FOLDER / f"{name}.py").is_file()}


@cache
def source_digest(module: str) -> str:
    """Digest of a kernel module's source together with all it imports from this package.

    Parameters
    ----------
    module : str
        Module name inside the package, for example ``"steering"``.

    Returns
    -------
    str
        Eight hexadecimal digits that change whenever compiled code could change.
    """
    seen: set[str] = set()
    open_modules = {module, "_jit"}
    while open_modules:
        name = open_modules.pop()
        seen.add(name)
        source = (PACKAGE_FOLDER / f"{name}.py").read_text(encoding="utf-8")
        open_modules |= imported_modules(source) - seen
    digest = hashlib.blake2s(digest_size=4)
    for name in sorted(seen):
        digest.update((PACKAGE_FOLDER / f"{name}.py").read_bytes())
    return digest.hexdigest()


def _compile(function: Callable[P, R], *, parallel: bool = False, is_inlined: bool = False) -> Callable[P, R]:
    flags = ("-parallel" if parallel else "") + ("-bounds" if CHECKS_BOUNDS else "")
    digest = source_digest(function.__module__.rpartition(".")[2])
    name = function.__qualname__
    function.__qualname__ = f"{name}-{digest}{flags}"
    try:
        compiled = numba.njit(
            cache=True,
            error_model="numpy",
            parallel=parallel,
            nogil=True,
            forceinline=is_inlined,
            _nrt=parallel,
        )(function)
    finally:
        function.__qualname__ = name
    return cast("Callable[P, R]", compiled)


def _with_globals(function: Callable[P, R], **values: bool) -> Callable[P, R]:
    """Copy a function that sees other values of some globals of its module."""
    assert isinstance(function, FunctionType)
    copy = FunctionType(
        function.__code__,
        function.__globals__ | values,
        function.__name__,
        function.__defaults__,
        function.__closure__,
    )
    copy.__module__, copy.__qualname__, copy.__doc__ = (
        function.__module__,
        function.__qualname__,
        function.__doc__,
    )
    return cast("Callable[P, R]", copy)


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a serial kernel: strict arithmetic, NumPy's error model, cached on disk."""
    return _compile(function)


def inlined_kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a row leaf that LLVM merges into its callers.

    Rows stay rows, unlike with Numba's own ``inline="always"``, so that loops over lanes are vectorised.
    """
    return _compile(function, is_inlined=True)


class ParallelKernel(Generic[P, R]):
    """A driver with a loop over chunks, in a serial and a threaded build that give equal bits.

    Calling it runs the threaded build, or the serial one when Numba is set to a single thread. Each build is
    compiled when it is first called, with its own value of the global `IS_THREADED`.
    """

    def __init__(self, function: Callable[P, R]) -> None:
        self.__doc__ = function.__doc__
        self.__name__ = function.__name__
        self.__module__ = function.__module__
        self.__wrapped__ = function

    @cached_property
    def serial(self) -> Callable[P, R]:
        """The build in which one chunk follows another."""
        return _compile(_with_globals(self.__wrapped__, IS_THREADED=False))

    @cached_property
    def threaded(self) -> Callable[P, R]:
        """The build in which chunks run at the same time."""
        return _compile(_with_globals(self.__wrapped__, IS_THREADED=True), parallel=True)

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> R:
        if numba.get_num_threads() == 1:
            return self.serial(*args, **kwargs)
        with _launch_lock:
            return self.threaded(*args, **kwargs)


def parallel_kernel(function: Callable[P, R]) -> ParallelKernel[P, R]:
    """Compile a driver whose chunks may run on several threads."""
    return ParallelKernel(function)


def thread_count() -> int:
    """Threads that parallel kernels use now."""
    return int(numba.get_num_threads())


def set_thread_count(count: int) -> None:
    """Set the threads that parallel kernels use, from 1 to `maximum_thread_count`."""
    numba.set_num_threads(count)


def maximum_thread_count() -> int:
    """Largest number of threads that this process can use."""
    return int(numba.config.NUMBA_NUM_THREADS)


prange: Any = numba.prange
