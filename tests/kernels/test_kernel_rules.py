"""House rules of the kernels, read from their source."""

import ast
import re
from dataclasses import dataclass
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]
PACKAGE = REPOSITORY / "kernels" / "crowd_kernels"
DECORATORS = {"kernel", "inlined_kernel", "parallel_kernel"}
ALLOCATORS = {
    "array", "arange", "asarray", "ascontiguousarray", "concatenate", "copy", "empty", "empty_like", "full",
    "full_like", "linspace", "ones", "ones_like", "stack", "zeros", "zeros_like",
}  # fmt: skip
CONTAINERS = (ast.List, ast.Dict, ast.Set, ast.ListComp, ast.DictComp, ast.SetComp, ast.GeneratorExp)
STATEMENTS = (ast.Raise, ast.Assert, ast.Try, ast.With, ast.Global, ast.Nonlocal, ast.Lambda)


@dataclass(frozen=True)
class Kernel:
    """A compiled function: its module, its syntax tree and the decorator it carries."""

    module: str
    tree: ast.FunctionDef
    decorator: str

    def __str__(self):
        return f"{self.module}.{self.tree.name}"

    @property
    def arguments(self):
        return [argument.arg for argument in self.tree.args.args]

    @property
    def docstring(self):
        return ast.get_docstring(self.tree) or ""

    @property
    def is_driver(self):
        return self.decorator == "parallel_kernel"


MODULES = {path.stem: path for path in sorted(PACKAGE.glob("*.py")) if not path.stem.startswith("_")}
TREES = {name: ast.parse(path.read_text(encoding="utf-8")) for name, path in MODULES.items()}


def decorator_names(function):
    return [ast.unparse(decorator) for decorator in function.decorator_list]


KERNELS = [
    Kernel(module, node, decorator_names(node)[0])
    for module, tree in TREES.items()
    for node in tree.body
    if isinstance(node, ast.FunctionDef) and set(decorator_names(node)) & DECORATORS
]
DRIVERS = [kernel for kernel in KERNELS if kernel.is_driver]
every_kernel = pytest.mark.parametrize("kernel", KERNELS, ids=str)
every_driver = pytest.mark.parametrize("kernel", DRIVERS, ids=str)


def calls(tree):
    """Names of what a tree calls, such as ``np.zeros``."""
    return [ast.unparse(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)]


def test_there_are_kernels_to_check():
    assert len(KERNELS) > 40
    assert len(DRIVERS) > 8


@pytest.mark.parametrize("module", MODULES)
def test_a_module_holds_functions_named_tuples_and_constants(module):
    for node in TREES[module].body:
        where = f"{module}.py:{node.lineno}"
        if isinstance(node, ast.FunctionDef):
            assert len(node.decorator_list) <= 1, f"{where}: {node.name} has several decorators"
            assert set(decorator_names(node)) <= DECORATORS, f"{where}: decorators come from _jit"
        elif isinstance(node, ast.ClassDef):
            assert [ast.unparse(base) for base in node.bases] == ["NamedTuple"], f"{where}: {node.name}"
        elif isinstance(node, (ast.Assign, ast.AnnAssign)):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            for name in [n.id for target in targets for n in ast.walk(target) if isinstance(n, ast.Name)]:
                is_type = name[0].isupper() and not name.isupper() and isinstance(node.value, ast.Subscript)
                assert name.isupper() or is_type or name == "__all__", f"{where}: {name} is no constant"


@every_kernel
def test_arguments_have_no_defaults_and_outputs_come_last(kernel):
    taken = kernel.tree.args
    assert taken.defaults == []
    assert taken.kwonlyargs == []
    assert taken.vararg is None
    assert taken.kwarg is None
    is_out = [name.startswith("out_") for name in kernel.arguments]
    assert is_out == sorted(is_out), "out_* come last"


@every_kernel
def test_bodies_are_plain(kernel):
    for node in ast.walk(kernel.tree):
        assert not isinstance(node, STATEMENTS), f"line {node.lineno}: {type(node).__name__}"
        assert not (isinstance(node, ast.BinOp) and isinstance(node.op, ast.MatMult)), (
            f"line {node.lineno}: @"
        )
    for called in calls(kernel.tree):
        assert called not in ("print", "np.dot", "np.matmul", "np.einsum"), called
        assert not called.startswith(("np.linalg.", "np.random.", "random.")), called


@every_kernel
def test_loops_allocate_nothing(kernel):
    for loop in ast.walk(kernel.tree):
        if not isinstance(loop, (ast.For, ast.While)):
            continue
        for node in [inner for statement in loop.body for inner in ast.walk(statement)]:
            assert not isinstance(node, CONTAINERS), f"line {node.lineno}: {ast.unparse(node)}"
            if isinstance(node, ast.Call):
                allocates = ast.unparse(node.func).rpartition(".")[2] in ALLOCATORS
                assert not allocates, f"line {node.lineno}: {ast.unparse(node)}"


@every_kernel
def test_only_drivers_run_in_parallel_and_none_knows_the_threads(kernel):
    assert ("prange" in calls(kernel.tree)) == kernel.is_driver
    names = {node.id for node in ast.walk(kernel.tree) if isinstance(node, ast.Name)}
    assert not [name for name in names if "thread" in name], "results may not depend on threads"


def documented_arguments(docstring):
    """Names in the Parameters section, in order."""
    found = re.search(r"^Parameters\n-+\n(.*?)(?=^\w[\w ]*\n-{3,}|\Z)", docstring, re.MULTILINE | re.DOTALL)
    lines = found.group(1).splitlines() if found else []
    heads = [line.split(" : ")[0] for line in lines if line and not line.startswith(" ")]
    return [name.strip() for head in heads for name in head.split(",")]


@every_kernel
def test_docstrings_begin_with_one_imperative_line(kernel):
    first = kernel.docstring.splitlines()[0] if kernel.docstring else ""
    assert first.endswith("."), "one line that ends with a full stop"
    assert not re.match(r"(The|A|An|This|Returns|Computes|Finds|It)\b", first), first


@every_kernel
def test_documented_arguments_are_those_of_the_signature(kernel):
    documented = documented_arguments(kernel.docstring)
    if kernel.is_driver:
        assert documented == kernel.arguments
    else:
        # A part of a driver may leave to it what they share, in the order of the signature.
        assert documented == [name for name in kernel.arguments if name in documented]


@every_driver
def test_drivers_state_their_source(kernel):
    assert "**Source:**" in kernel.docstring


def test_names_of_documented_arguments_are_read_as_they_are_written():
    text = """Do.

Parameters
----------
a, b : float
    Text : more.
c : (N,) int32

Notes
-----
d : no
"""
    assert documented_arguments(text) == ["a", "b", "c"]
    assert documented_arguments("Do.") == []


def texts(folder, pattern):
    return {path: path.read_text(encoding="utf-8") for path in sorted((REPOSITORY / folder).glob(pattern))}


TESTS = texts("tests/kernels", "test_*.py") | texts("tests/crowd", "test_*.py")
CASES = texts("benchmarks", "cases_*.py")


def engine_modules(text):
    """Texts of the engine's modules that a file imports: they own the scratch of some drivers."""
    for name in re.findall(r"^from (crowd(?:\.\w+)+) import", text, re.MULTILINE):
        path = REPOSITORY / (name.replace(".", "/") + ".py")
        if path.is_file():
            yield path.read_text(encoding="utf-8")


def reaches(text, driver):
    """A file names a driver, or imports from the engine what does."""
    pattern = re.compile(rf"\b{driver}\b")
    return any(pattern.search(part) for part in (text, *engine_modules(text)))


@every_driver
def test_every_driver_is_tested_beside_a_slow_twin(kernel):
    tests = [text for text in TESTS.values() if reaches(text, kernel.tree.name)]
    assert tests, "no test reaches it"
    assert any("tests.oracles" in text for text in tests), "no test that reaches it uses a slow twin"


@every_driver
def test_every_driver_has_a_benchmark_case(kernel):
    assert any(reaches(text, kernel.tree.name) for text in CASES.values())
