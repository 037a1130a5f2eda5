"""Shader programs: texts put together from files, compiled, with errors that show the line."""

from __future__ import annotations

from functools import cache
from importlib import resources
from typing import TYPE_CHECKING, Any

from crowd_viewer.context import ViewerError

if TYPE_CHECKING:
    import moderngl

ROWS = 2048
"""Rows of tables with a row for each person; further people are to the right of them."""
MOST_JOINTS = 64
VIEW_BINDING = 0
PALETTE_UNIT, ROOTS_UNIT, LOOKS_UNIT, LIMBS_UNIT, SHADOW_UNIT = range(5)


@cache
def text(name: str) -> str:
    """Content of a shader file."""
    return (resources.files("crowd_viewer") / "shaders" / name).read_text(encoding="utf-8")


def compile_program(
    context: moderngl.Context, vertex: tuple[str, ...], fragment: tuple[str, ...], **constants: object
) -> moderngl.Program:
    """Compile files put one after the other, with constants defined before them.

    Raises
    ------
    ViewerError
        The driver refuses them; the message holds its log.
    """
    defined = {"ROWS": ROWS, "MOST_JOINTS": MOST_JOINTS} | constants
    head = "#version 330 core\n" + "".join(f"#define {name} {value}\n" for name, value in defined.items())
    try:
        program = context.program(
            vertex_shader=head + "\n".join(text(name) for name in vertex),
            fragment_shader=head + "\n".join(text(name) for name in fragment),
        )
    except Exception as error:
        where = f"shaders {', '.join((*vertex, *fragment))}"
        # The rest of the log is headings; lines count through all files put together.
        log = [line.strip() for line in str(error).splitlines() if "error" in line.lower()]
        told = "; ".join(log) or str(error).strip()
        raise ViewerError(f"{where}: the driver cannot compile them: {told}") from error
    if "View" in program:
        program["View"].binding = VIEW_BINDING  # type: ignore[union-attr]
    return program


def set_units(program: Any) -> None:
    """Tell a program where its textures are."""
    units = {
        "palette": PALETTE_UNIT,
        "roots": ROOTS_UNIT,
        "looks": LOOKS_UNIT,
        "limbs": LIMBS_UNIT,
        "shadow_map": SHADOW_UNIT,
    }
    for name, unit in units.items():
        if name in program:
            program[name] = unit
