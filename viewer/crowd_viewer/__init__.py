"""Pictures, videos and windows of simulations and recordings."""

from crowd_viewer.camera import Camera
from crowd_viewer.clips import Clip, clip
from crowd_viewer.context import ViewerError
from crowd_viewer.frame import Shown
from crowd_viewer.picture import Picture, render, render_identities, write_picture
from crowd_viewer.quality import FAST, FINE, Quality

__all__ = [
    "FAST",
    "FINE",
    "Camera",
    "Clip",
    "Picture",
    "Quality",
    "Shown",
    "ViewerError",
    "clip",
    "render",
    "render_identities",
    "show",
    "write_picture",
]


def show(shown: Shown, *, camera: Camera | None = None) -> None:
    """Open a window and stay there until it is closed, see `crowd_viewer.window.show`."""
    from crowd_viewer.window import show as open_window

    open_window(shown, camera=camera)
