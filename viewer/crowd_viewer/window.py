"""A window onto a running simulation or a recording."""

from __future__ import annotations

import sys
import time as clock
from collections.abc import Generator
from typing import TYPE_CHECKING, Any

import numpy as np

from crowd.errors import describe
from crowd.recording import Recording
from crowd.simulation import Frame, Simulation
from crowd_viewer.bindings import Bindings, help_lines, keys_of
from crowd_viewer.camera import Camera
from crowd_viewer.context import INSTALL, ViewerError, is_software, require_moderngl
from crowd_viewer.controls import CameraControls, Playback
from crowd_viewer.display import TIMELINE_TOP, Display, time_share
from crowd_viewer.frame import Shown, opened, source_of
from crowd_viewer.overlays import Overlays, Seen, nearest_people
from crowd_viewer.panels import Panels, imgui_module
from crowd_viewer.picture import default_camera
from crowd_viewer.quality import FAST, FINE, Quality
from crowd_viewer.renderer import Renderer

if TYPE_CHECKING:
    import moderngl

SIZE = (1280, 720)
LONGEST_CATCH_UP = 0.1
"""Simulated time that one picture may wait for, s; a slow machine shows slow motion instead of jumps."""
SMOOTHED_PICTURES = 10


def require_glfw() -> Any:
    """The module that opens windows.

    Raises
    ------
    ViewerError
        It is not installed, or there is no screen.
    """
    imgui_module()
    try:
        import glfw
    except ImportError as error:
        raise ViewerError(describe("--view", "glfw is not installed", allowed=INSTALL)) from error
    # Errors become ours, not warnings beside them.
    glfw.ERROR_REPORTING = "ignore"
    if not glfw.init():
        allowed = "--picture, --video or --record"
        raise ViewerError(describe("--view", "no screen to open a window on", allowed=allowed))
    return glfw


class Window:
    """Shows a simulation or a recording; use it in a ``with`` block, from the main thread.

    Parameters
    ----------
    shown : Simulation, Recording, Trajectories or path
    camera : Camera, optional
        One that sees the crowd when left out.
    size : tuple of int
    quality : Quality, optional
        By the driver when left out.
    has_panels : bool
        Show panels, where imgui-bundle is installed.

    Raises
    ------
    ViewerError
        There is no screen, or no OpenGL 3.3.
    """

    def __init__(
        self,
        shown: Shown,
        *,
        camera: Camera | None = None,
        size: tuple[int, int] = SIZE,
        quality: Quality | None = None,
        has_panels: bool = True,
    ) -> None:
        require_moderngl()
        imgui = imgui_module() if has_panels else None
        self._glfw = require_glfw()
        source = opened(shown)
        self.simulation = source if isinstance(source, Simulation) else None
        self._source = source_of(source)
        scene = self._source.scene
        self.handle, self.context = self._open(size, scene.name)
        self.size = size
        chosen = quality or (FAST if is_software(self.context) else FINE)
        self.renderer = Renderer(self.context, scene, size, chosen)
        self.playback = _playback(source)
        self._frame = self._source.frame(self.playback.time)
        self._everything = default_camera(scene, self._source.places(), size)
        self.controls = CameraControls(camera or self._everything)
        self.overlays = Overlays()
        self.picked = -1
        self._is_help_shown = False
        self._display = Display(self.context, self.renderer, self.overlays)
        if not self._display.text.is_on:
            print(describe("viewer", "no text in the window: no font", allowed=INSTALL), file=sys.stderr)
        self.keys = keys_of(self)
        self._bindings = Bindings(self, self._glfw)
        self._panels = Panels(imgui, self) if imgui is not None else None
        self._wall_time = clock.perf_counter()
        self._seconds_per_picture = 0.0

    # ---- what a program calls

    @property
    def is_open(self) -> bool:
        """Nobody has closed the window."""
        return self.handle is not None and not self._glfw.window_should_close(self.handle)

    def refresh(self) -> float:
        """Handle input and draw a picture; returns how much simulated time has gone by since, s."""
        self._glfw.make_context_current(self.handle)
        self._glfw.poll_events()
        now = clock.perf_counter()
        wall, self._wall_time = now - self._wall_time, now
        before = self._seconds_per_picture or wall
        self._seconds_per_picture = before + (wall - before) / SMOOTHED_PICTURES
        self.controls.fly(*self._bindings.flying(), min(wall, LONGEST_CATCH_UP))
        passed = self.playback.advance(min(wall, LONGEST_CATCH_UP))
        if self.simulation is None and self.playback.time >= self.playback.last:
            self.playback.is_paused = True
        if self.size[0] > 0 and self.size[1] > 0:
            self._draw()
        else:
            # Minimised: nothing to draw to, and no reason to keep a processor busy.
            self._glfw.wait_events_timeout(0.05)
        return passed

    def key(self, name: str) -> None:
        """Do what a key does; names as in the list of keys."""
        next(key for key in self.keys if key.name == name).action()

    def close(self) -> None:
        """Close the window."""
        if self.handle is not None:
            self._glfw.make_context_current(self.handle)
            if self._panels is not None:
                self._panels.close()
            self.renderer.release()
            self._glfw.destroy_window(self.handle)
            self.handle = None

    def __enter__(self) -> Window:
        return self

    def __exit__(self, *reason: object) -> None:
        self.close()

    # ---- drawing

    def _draw(self) -> None:
        self._frame = frame = self._source.frame(self.playback.time)
        self.controls.follow(frame.position_world)
        camera = self.controls.camera
        is_there = 0 <= self.picked < len(frame.is_active) and bool(frame.is_active[self.picked])
        self.renderer.people.picked = self.picked
        seen = Seen(
            frame,
            self._source.scene,
            nearest_people(frame, np.asarray(camera.target)),
            self.picked if is_there else -1,
            self._source.quantity,
            self.simulation,
        )
        self._display.prepare(seen)
        self.renderer.draw(frame, camera)
        self._display.draw(seen, self._status(seen), None if self.simulation is not None else self.playback)
        self.context.copy_framebuffer(self.context.screen, self.renderer.targets.picture)
        if self._panels is not None:
            self.context.screen.use()
            self._panels.draw(self, seen)
        self._glfw.swap_buffers(self.handle)

    def _status(self, seen: Seen) -> list[str]:
        """The line about what is seen, and the list of keys."""
        frame, rate = seen.frame, 1.0 / max(self._seconds_per_picture, 1e-3)
        people = int(frame.is_active.sum())
        line = f"{rate:5.1f} fps   {people} people   {frame.time:7.2f} s   {self.playback.speed:g} x"
        if self.playback.is_paused:
            line += "   paused"
        lines = [line]
        if seen.picked >= 0:
            x, _, z = frame.position_world[seen.picked]
            lines.append(f"person {frame.identity[seen.picked]} at {x:.2f}, {z:.2f} m")
        return lines + (help_lines(self.keys) if self._is_help_shown else ["h: keys"])

    # ---- what mouse, keys and panels call

    @property
    def takes_mouse(self) -> bool:
        """A panel has the mouse."""
        return self._panels is not None and self._panels.takes_mouse

    @property
    def takes_keys(self) -> bool:
        """A panel has the keys."""
        return self._panels is not None and self._panels.takes_keys

    def pick(self, x: float, y: float) -> int:
        """Pick whoever is seen at a pixel; returns the slot, or -1."""
        self._glfw.make_context_current(self.handle)
        identity, _ = self.renderer.identities(self._frame, self.controls.camera)
        height, width = identity.shape
        column, row = min(max(int(x), 0), width - 1), min(max(int(y), 0), height - 1)
        self.picked = int(identity[row, column]) - 1
        return self.picked

    def drag(self, button: str, across: float, down: float) -> None:
        """Move the camera with the mouse: ``"left"``, ``"right"`` or ``"middle"`` button, pixels."""
        if button == "left":
            self.controls.orbit(across, down)
        elif button == "right":
            self.controls.look_around(across, down)
        else:
            self.controls.pan(across, down, self.size[1])

    def is_on_timeline(self, pixel: tuple[float, float]) -> bool:
        """The pixel belongs to the bar that shows the time of a recording."""
        return self.simulation is None and pixel[1] >= self.size[1] - TIMELINE_TOP - 6

    def scrub(self, pixel: tuple[float, float], pressed_at: tuple[float, float]) -> bool:
        """Go to the time at a pixel, when the mouse was pressed on the timeline."""
        if not self.is_on_timeline(pressed_at):
            return False
        first, last = self.playback.first, self.playback.last
        self.playback.jump(first + time_share(pixel[0], self.size[0]) * (last - first))
        return True

    def resize(self, width: int, height: int) -> None:
        """Draw in another size; nothing is drawn while one side is 0."""
        self.size = (width, height)
        if width > 0 and height > 0:
            self._glfw.make_context_current(self.handle)
            self.renderer.resize(self.size)

    def step_back(self) -> None:
        """Show the frame before; a simulation knows none and only pauses."""
        self.playback.is_paused = True
        if self.simulation is None:
            self.playback.single_step(-1)

    def toggle_top(self) -> None:
        """Look straight down, and back."""
        low_x, high_x, low_z, high_z = self._source.scene.bounds
        width, height = max(self.size[0], 1), max(self.size[1], 1)
        self.controls.toggle_top(1.05 * max(high_z - low_z, (high_x - low_x) * height / width))

    def see_all(self) -> None:
        """See the whole crowd."""
        self.controls.frame_all(self._everything)

    def toggle_panels(self) -> None:
        """Show or hide the panels."""
        if self._panels is not None:
            self._panels.is_shown = not self._panels.is_shown

    def toggle_help(self) -> None:
        """Show or hide the list of keys."""
        self._is_help_shown = not self._is_help_shown

    def ask_to_close(self) -> None:
        """Close after this picture."""
        self._glfw.set_window_should_close(self.handle, True)

    # ---- opening

    def _open(self, size: tuple[int, int], name: str) -> tuple[Any, moderngl.Context]:
        glfw = self._glfw
        glfw.window_hint(glfw.CONTEXT_VERSION_MAJOR, 3)
        glfw.window_hint(glfw.CONTEXT_VERSION_MINOR, 3)
        glfw.window_hint(glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE)
        glfw.window_hint(glfw.OPENGL_FORWARD_COMPAT, True)
        handle = glfw.create_window(*size, f"crowd: {name}", None, None)
        if not handle:
            raise ViewerError(describe("--view", "the driver has no OpenGL 3.3 for windows"))
        glfw.make_context_current(handle)
        glfw.swap_interval(1)
        import moderngl

        loader: Any = Loader(glfw)
        return handle, moderngl.create_context(require=330, context=loader)


def _playback(shown: Simulation | Recording) -> Playback:
    if isinstance(shown, Simulation):
        return Playback(time=shown.time, step=shown.dt)
    first, last = float(shown.time[0]), float(shown.time[-1])
    return Playback(time=first, first=first, last=last, step=shown.frame_seconds)


class Loader:
    """Finds OpenGL's functions through glfw, whichever system it opened the window with."""

    def __init__(self, glfw: Any) -> None:
        self._glfw = glfw

    def load_opengl_function(self, name: str) -> int:
        """Address of a function, 0 where there is none."""
        return int(self._glfw.get_proc_address(name) or 0)

    def release(self) -> None:
        """Leave the context to its window."""

    def __enter__(self) -> Loader:
        return self

    def __exit__(self, *reason: object) -> None:
        pass


def shown_frames(
    simulation: Simulation, frame_count: int, *, camera: Camera | None = None
) -> Generator[Frame, None, None]:
    """Step a simulation in a window at the pace of the playback, until it is closed."""
    with Window(simulation, camera=camera) as window:
        begin, stepped = simulation.time, 0
        while window.is_open and stepped < frame_count:
            window.refresh()
            wanted = round((window.playback.time - begin) / simulation.dt)
            while stepped < min(wanted, frame_count):
                stepped += 1
                yield simulation.step()


def show(shown: Shown, *, camera: Camera | None = None) -> None:
    """Open a window and stay there until it is closed.

    Parameters
    ----------
    shown : Simulation, Recording, Trajectories or path
        A simulation runs on while it is shown.
    camera : Camera, optional

    Raises
    ------
    ViewerError
        There is no screen, or no OpenGL 3.3; the message says what to install.
    """
    source = opened(shown)
    if isinstance(source, Simulation):
        for _ in shown_frames(source, 1 << 62, camera=camera):
            pass
        return
    with Window(source, camera=camera) as window:
        while window.is_open:
            window.refresh()
