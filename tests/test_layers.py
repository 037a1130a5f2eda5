"""The direction of imports: crowd_kernels <- crowd <- its command line, the viewer and the benchmarks."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[1]
PACKAGES = {
    "crowd_kernels": REPOSITORY / "kernels" / "crowd_kernels",
    "crowd": REPOSITORY / "crowd",
    "crowd_viewer": REPOSITORY / "viewer" / "crowd_viewer",
    "benchmarks": REPOSITORY / "benchmarks",
}
# What the command line needs may not be needed by anything else.
COMMAND_LINE = ("crowd.cli", "crowd.bench")
FORBIDDEN = {
    "crowd_kernels": ("crowd", "crowd_viewer", "benchmarks", "tests"),
    "crowd": ("crowd_viewer", "benchmarks", "tests", *COMMAND_LINE),
    "command line": ("tests",),
    "crowd_viewer": ("benchmarks", "tests", *COMMAND_LINE),
    "benchmarks": ("crowd_viewer", "tests"),
}
KERNEL_IMPORTS = {"crowd_kernels", "numpy", "math", "typing", "collections"}
JIT_IMPORTS = KERNEL_IMPORTS | {"numba", "ast", "functools", "hashlib", "os", "pathlib", "threading", "types"}


def module_name(path, package):
    relative = path.relative_to(PACKAGES[package]).with_suffix("")
    return ".".join([package, *(part for part in relative.parts if part != "__init__")])


def imported_paths(source, module, is_package=False):
    """Dotted paths that a text imports, with what is imported from them: `a.b` and `a.b.c`."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = module.split(".") + ([""] if is_package else [])
            parts = (
                [*above[: len(above) - node.level], node.module or ""] if node.level else [node.module or ""]
            )
            origin = ".".join(part for part in parts if part)
            found.update({origin, *(f"{origin}.{alias.name}" for alias in node.names)})
    return found


def is_below(path, package):
    return path == package or path.startswith(package + ".")


def sources():
    for package, folder in PACKAGES.items():
        for path in sorted(folder.rglob("*.py")):
            yield package, module_name(path, package), path


@pytest.mark.parametrize("package", PACKAGES)
def test_imports_point_down(package):
    offences, count = [], 0
    for own, module, path in sources():
        if own != package:
            continue
        count += 1
        layer = "command line" if any(is_below(module, top) for top in COMMAND_LINE) else own
        imports = imported_paths(path.read_text(encoding="utf-8"), module, path.name == "__init__.py")
        offences += [
            f"{module} imports {imported}"
            for imported in sorted(imports)
            if any(is_below(imported, forbidden) for forbidden in FORBIDDEN[layer])
        ]
    assert count > 0
    assert offences == []


def test_kernels_import_numpy_and_each_other_and_one_file_names_numba():
    offences = []
    for own, module, path in sources():
        if own == "crowd_kernels":
            allowed = JIT_IMPORTS if module.endswith("._jit") else KERNEL_IMPORTS
            imports = imported_paths(path.read_text(encoding="utf-8"), module)
            offences += [f"{module} imports {name}" for name in imports if name.split(".")[0] not in allowed]
    assert offences == []


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ("import crowd_viewer.window", "crowd_viewer.window"),
        ("def f():\n    from crowd import cli", "crowd.cli"),
        ("from ..cli import run", "crowd.cli.run"),
        ("from . import clip", "crowd.motion.clip"),
    ],
)
def test_every_form_of_import_is_found(source, found):
    assert found in imported_paths(source, "crowd.motion.library")


HEAVY = ("moderngl", "glfw", "imgui_bundle", "matplotlib", "crowd_viewer", "benchmarks", "typer", "pyastar2d")


def loaded_after(statement):
    """Top-level packages in a fresh process after a statement."""
    code = f"{statement}\nimport sys\nprint(*sorted({{name.split('.')[0] for name in sys.modules}}))"
    path = [str(REPOSITORY), str(REPOSITORY / "kernels"), str(REPOSITORY / "viewer")]
    done = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path[:0] = {path}\n{code}"],
        capture_output=True,
        text=True,
        check=True,
    )
    return set(done.stdout.split())


def test_import_crowd_loads_neither_windows_nor_plots():
    loaded = loaded_after("import crowd\ncrowd.Simulation\ncrowd.load_scenario")
    assert "crowd_kernels" in loaded
    assert loaded.isdisjoint(HEAVY)


def test_kernels_load_without_the_engine():
    modules = [f"crowd_kernels.{path.stem}" for path in sorted(PACKAGES["crowd_kernels"].glob("[a-z]*.py"))]
    loaded = loaded_after("import " + ", ".join(modules))
    assert loaded.isdisjoint({"crowd", "pydantic", "h5py", "shapely", *HEAVY})
