"""How much work goes into a picture."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Quality:
    """Settings of the renderer.

    Attributes
    ----------
    least_height : tuple of float
        Least height on the screen in pixels for the finest, middle and coarse mesh, for whole and for few
        capsules; smaller people get few strokes that are lit at their corners.
    mesh_count : int
        Most people drawn as meshes, the tallest on the screen first.
    samples : int
        Multisampling; 0 without.
    shadow_size : int
        Texels along each side of the shadow map; 0 without shadows.
    shadow_taps : int
        Places at which the rim of a shadow is looked up, 1 to 12.
    shadow_reach : float
        Half of the side of the ground on which shadows fall where people are near, m.
    has_far_shadows : bool
        People drawn with few capsules or strokes cast shadows too.
    """

    least_height: tuple[float, float, float, float, float]
    mesh_count: int
    samples: int
    shadow_size: int
    shadow_taps: int
    shadow_reach: float
    has_far_shadows: bool


FINE = Quality((150.0, 70.0, 34.0, 14.0, 5.0), 2000, 4, 4096, 12, 45.0, True)
"""For pictures, videos and graphics cards."""
FAST = Quality((300.0, 170.0, 70.0, 34.0, 20.0), 40, 0, 1024, 4, 25.0, False)
"""For windows where the processor draws."""
