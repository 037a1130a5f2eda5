"""Pictures per second of whole crowds, and what the processor and the bus do for one."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from crowd.bench.frames import scene
from crowd.simulation import Simulation

if TYPE_CHECKING:
    from crowd_viewer import Quality

SIZES = (100, 1000, 10_000)
PICTURE = (1280, 720)
LARGEST_UPLOAD_MB = 8.0
LEAST_SECONDS, LEAST_PICTURES = 1.5, 4
SCENE = "walking_open"


@dataclass(frozen=True)
class DrawingResult:
    """One row of the table.

    Attributes
    ----------
    case : str
        How much work goes into a picture, see `qualities`.
    characters : int
    fps : float
        Pictures per second: chosen, packed, uploaded and drawn, without the simulation.
    prepare_us_per_character : float
        The processor's side: who is seen at which level, poses, upload.
    upload_mb : float
        MB for one picture.
    levels : tuple of int
        People drawn at each level, the finest first.
    ok : bool
    problem : str
    """

    case: str
    characters: int
    fps: float
    prepare_us_per_character: float
    upload_mb: float
    levels: tuple[int, ...]
    ok: bool
    problem: str

    def as_dict(self) -> dict[str, Any]:
        """Form for JSON."""
        return asdict(self)


def qualities() -> dict[str, Quality]:
    """What is compared: rounded limbs alone, a window's quality where the processor draws, and the best."""
    from dataclasses import replace

    from crowd_viewer import FAST, FINE

    never = float("inf")
    limbs = replace(FAST, least_height=(never, never, never, *FAST.least_height[3:]), shadow_size=0)
    return {"limbs": limbs, "window": FAST, "best": FINE}


def measure_drawing(case: str, characters: int, seed: int = 1) -> DrawingResult:
    """Draw one crowd again and again from above its edge, everyone in view."""
    from crowd_viewer import Camera
    from crowd_viewer.context import headless_context
    from crowd_viewer.frame import source_of
    from crowd_viewer.renderer import Renderer

    simulation = Simulation(scene(SCENE, characters), seed=seed)
    for _ in range(30):
        simulation.step()
    source = source_of(simulation)
    frame = source.frame()
    camera = Camera.framing(frame.places, PICTURE[0] / PICTURE[1])
    context = headless_context()
    with Renderer(context, source.scene, PICTURE, qualities()[case]) as renderer:
        renderer.draw(frame, camera)
        context.finish()
        whole: list[float] = []
        prepare: list[float] = []
        begin = time.perf_counter()
        while len(whole) < LEAST_PICTURES or time.perf_counter() - begin < LEAST_SECONDS:
            start = time.perf_counter()
            renderer.prepare(frame, camera)
            prepare.append(time.perf_counter() - start)
            renderer.draw(frame, camera)
            context.finish()
            whole.append(time.perf_counter() - start - prepare[-1])
        levels, upload = renderer.people.counts(), renderer.people.upload_bytes / 1e6
        identity, _ = renderer.identities(frame, camera)
    seen = len(np.unique(identity[identity > 0]))
    problem = ""
    if sum(levels) < 0.99 * characters or seen < min(50, characters // 4):
        problem = f"{sum(levels)} people drawn, {seen} seen"
    elif upload > LARGEST_UPLOAD_MB:
        problem = f"{upload:.1f} MB to upload, allowed {LARGEST_UPLOAD_MB:g}"
    return DrawingResult(
        case,
        characters,
        1.0 / min(whole),
        min(prepare) / characters * 1e6,
        upload,
        levels,
        not problem,
        problem,
    )


def renderer_name() -> str:
    """Who draws: the name that the driver gives."""
    from crowd_viewer.context import headless_context

    return str(headless_context().info["GL_RENDERER"])
