"""OpenGL contexts: without a screen for pictures, or that of a window."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

from crowd.errors import CrowdError, describe

if TYPE_CHECKING:
    import moderngl

SOFTWARE_RENDERERS = ("llvmpipe", "softpipe", "swiftshader", "microsoft basic")
INSTALL = 'pip install "crowd-engine[viewer]"'
SYSTEM_PACKAGES = "on Debian and Ubuntu: apt install libegl1 libgl1"


class ViewerError(CrowdError):
    """Nothing can be drawn here, or not what was asked for."""


def require_moderngl() -> None:
    """Check that the Python packages for drawing are there.

    Raises
    ------
    ViewerError
        Names what to install.
    """
    try:
        import moderngl  # noqa: F401
    except ImportError as error:
        raise ViewerError(describe("viewer", "moderngl is not installed", allowed=INSTALL)) from error


def headless_context() -> moderngl.Context:
    """The process's context that needs no screen, made current.

    Raises
    ------
    ViewerError
        There is no OpenGL 3.3; the simulation runs without.
    """
    context = _only_context()
    # A window may have taken its place since.
    context.__enter__()  # type: ignore[no-untyped-call,unused-ignore]
    return context


@cache
def _only_context() -> moderngl.Context:
    """Make the context; once, since drivers leak many contexts."""
    require_moderngl()
    import moderngl

    reasons: list[str] = []
    ways: tuple[dict[str, Any], ...] = ({"backend": "egl"}, {})
    for settings in ways:
        try:
            return moderngl.create_context(standalone=True, require=330, **settings)
        except Exception as error:
            # Loaders raise many kinds of errors; whichever it was, the other way may still work.
            reasons.append(str(error).splitlines()[0] if str(error) else type(error).__name__)
    raise ViewerError(
        describe(
            "viewer", "no OpenGL 3.3 can be had", "; ".join(reasons), f"system packages, {SYSTEM_PACKAGES}"
        )
    )


def is_software(context: moderngl.Context) -> bool:
    """Pictures are drawn by the processor."""
    name = str(context.info["GL_RENDERER"]).lower()
    return any(known in name for known in SOFTWARE_RENDERERS)
