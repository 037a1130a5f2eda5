"""Pictures, videos and windows of simulations and recordings."""

from crowd_viewer.camera import Camera
from crowd_viewer.context import ViewerError
from crowd_viewer.picture import render, render_identities, write_picture
from crowd_viewer.quality import FAST, FINE, Quality

__all__ = ["FAST", "FINE", "Camera", "Quality", "ViewerError", "render", "render_identities", "write_picture"]
