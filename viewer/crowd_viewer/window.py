"""A window onto a running simulation or a recording."""

from __future__ import annotations

import time as clock
from collections.abc import Generator
from typing import TYPE_CHECKING, Any

import numpy as np

from crowd.errors import describe
from crowd.recording import Recording
from crowd.simulation import Frame, Simulation
from crowd_viewer.camera import Camera
from crowd_viewer.context import INSTALL, ViewerError, is_software, require_moderngl
from crowd_viewer.controls import CameraControls, Playback
from crowd_viewer.frame import LiveSource, ReplaySource
from crowd_viewer.lines import Lines
from crowd_viewer.overlays import Overlays
from crowd_viewer.picture import default_camera
from crowd_viewer.quality import FAST, FINE, Quality
from crowd_viewer.renderer import Renderer
from crowd_viewer.text import Text

if TYPE_CHECKING:
    import moderngl

SIZE = (1280, 720)
LONGEST_CATCH_UP = 0.1
"""Simulated time that one picture may wait for, s; a slow machine shows slow motion instead of jumps."""
CLICK_DISTANCE = 4.0
HELP = (
    "left drag: orbit   right drag: look around   middle or shift drag: move   wheel: nearer",
    "click: pick a person   F: follow   Home: see all   T: from above   W A S D Q E: fly",
    "space: pause   . ,: single frames   [ ]: speed   drag below: time of a recording",
    "1 velocity  2 way  3 disc  4 neighbours  5 feet  6 skeleton   H: this list   Esc: close",
)


def require_glfw() -> Any:
    """The module that opens windows.

    Raises
    ------
    ViewerError
        It is not installed, or there is no screen.
    """
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
    shown : Simulation or Recording
    camera : Camera, optional
        One that sees the crowd when left out.
    size : tuple of int
    quality : Quality, optional
        By the driver when left out.

    Raises
    ------
    ViewerError
        There is no screen, or no OpenGL 3.3.
    """

    def __init__(
        self,
        shown: Simulation | Recording,
        *,
        camera: Camera | None = None,
        size: tuple[int, int] = SIZE,
        quality: Quality | None = None,
    ) -> None:
        require_moderngl()
        self._glfw = require_glfw()
        self.simulation = shown if isinstance(shown, Simulation) else None
        self._source = LiveSource(shown) if isinstance(shown, Simulation) else ReplaySource(shown)
        self.handle, self.context = self._open(size, self._source.scene.name)
        self.size = size
        chosen = quality or (FAST if is_software(self.context) else FINE)
        self.renderer = Renderer(self.context, self._source.scene, size, chosen)
        self.playback = self._playback(shown)
        self._frame = self._source.frame(self.playback.time)
        self._everything = default_camera(self._source.scene, self._frame, size)
        self.controls = CameraControls(camera or self._everything)
        self.overlays = Overlays(self.simulation)
        self.picked = -1
        self.is_help_shown = False
        self._text = Text(self.context)
        self._lines = Lines(self.context, self.renderer.origin)
        self._wall_time = clock.perf_counter()
        self._mouse = (0.0, 0.0)
        self._pressed_at: tuple[float, float] | None = None
        self._seconds_per_picture = 0.0
        self._listen()

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
        self._seconds_per_picture += 0.1 * (wall - self._seconds_per_picture)
        self._fly(wall)
        passed = self.playback.advance(min(wall, LONGEST_CATCH_UP))
        if self.simulation is None and self.playback.time >= self.playback.last:
            self.playback.is_paused = True
        if self.size[0] > 0 and self.size[1] > 0:
            self._draw()
        else:
            # Minimised: nothing to draw to, and no reason to keep a processor busy.
            self._glfw.wait_events_timeout(0.05)
        return passed

    def close(self) -> None:
        """Close the window."""
        if self.handle is not None:
            self._glfw.make_context_current(self.handle)
            self.renderer.release()
            self._glfw.destroy_window(self.handle)
            self.handle = None

    def __enter__(self) -> Window:
        return self

    def __exit__(self, *reason: object) -> None:
        self.close()

    # ---- drawing

    def _draw(self) -> None:
        self._frame = self._source.frame(self.playback.time)
        self.controls.follow(self._frame.position_world)
        self.renderer.people.picked = self.picked
        self.renderer.draw(self._frame, self.controls.camera)
        target = np.asarray(self.controls.camera.target)
        self.overlays.draw(self._lines, self._frame, self._source.scene, target, self.picked)
        self.renderer.targets.picture.use()
        self._lines.draw(self.size)
        self._text.draw(self._status(), self.size)
        if self.simulation is None:
            self._draw_timeline()
        self.context.copy_framebuffer(self.context.screen, self.renderer.targets.picture)
        self._glfw.swap_buffers(self.handle)

    def _status(self) -> list[str]:
        """The line about what is seen, and the list of keys."""
        frame, rate = self._frame, 1.0 / max(self._seconds_per_picture, 1e-3)
        people = int(frame.is_active.sum())
        line = f"{rate:5.1f} fps   {people} people   {frame.time:7.2f} s   {self.playback.speed:g} x"
        if self.playback.is_paused:
            line += "   paused"
        lines = [line]
        if 0 <= self.picked < len(frame.is_active) and frame.is_active[self.picked]:
            x, _, z = frame.position_world[self.picked]
            lines.append(f"person {frame.identity[self.picked]} at {x:.2f}, {z:.2f} m")
        return lines + (list(HELP) if self.is_help_shown else ["H: keys"])

    def _draw_timeline(self) -> None:
        playback = self.playback
        length = max(playback.last - playback.first, 1e-9)
        columns = max((self.size[0] - 24) // 10, 2)
        place = round((playback.time - playback.first) / length * (columns - 1))
        bar = "-" * place + "O" + "-" * (columns - 1 - place)
        self._text.draw([bar], self.size, top=self.size[1] - 28)

    # ---- input

    def key(self, name: str) -> None:
        """Do what a key asks for; names as in `HELP`."""
        playback, controls = self.playback, self.controls
        number = "123456".find(name) if len(name) == 1 else -1
        if number >= 0:
            self.overlays.toggle(Overlays.NAMES[number])
        elif name == "space":
            playback.is_paused = not playback.is_paused
        elif name in ".,":
            playback.single_step(1 if name == "." else -1)
        elif name in "[]":
            playback.change_speed(1 if name == "]" else -1)
        elif name == "f":
            controls.toggle_follow(self.picked)
        elif name == "t":
            low_x, high_x, low_z, high_z = self._source.scene.bounds
            controls.toggle_top(1.05 * max(high_z - low_z, (high_x - low_x) * self.size[1] / self.size[0]))
        elif name == "home":
            controls.frame_all(self._everything)
        elif name == "h":
            self.is_help_shown = not self.is_help_shown
        elif name == "escape":
            self._glfw.set_window_should_close(self.handle, True)

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

    def resize(self, width: int, height: int) -> None:
        """Draw in another size; nothing is drawn while one side is 0."""
        self.size = (width, height)
        if width > 0 and height > 0:
            self._glfw.make_context_current(self.handle)
            self.renderer.resize(self.size)

    def _fly(self, wall_seconds: float) -> None:
        glfw = self._glfw

        def held(key: int) -> float:
            return float(glfw.get_key(self.handle, key) == glfw.PRESS)

        right = held(glfw.KEY_D) - held(glfw.KEY_A)
        up = held(glfw.KEY_E) - held(glfw.KEY_Q)
        ahead = held(glfw.KEY_W) - held(glfw.KEY_S)
        self.controls.fly(right, up, ahead, min(wall_seconds, LONGEST_CATCH_UP))

    def _listen(self) -> None:
        glfw, handle = self._glfw, self.handle
        names = {
            glfw.KEY_SPACE: "space",
            glfw.KEY_HOME: "home",
            glfw.KEY_ESCAPE: "escape",
            glfw.KEY_PERIOD: ".",
            glfw.KEY_COMMA: ",",
            glfw.KEY_LEFT_BRACKET: "[",
            glfw.KEY_RIGHT_BRACKET: "]",
        }
        names |= {getattr(glfw, f"KEY_{letter.upper()}"): letter for letter in "fth123456"}

        def on_key(_: Any, key: int, code: int, action: int, mods: int) -> None:
            if action != glfw.RELEASE and key in names:
                self.key(names[key])

        glfw.set_key_callback(handle, on_key)
        glfw.set_mouse_button_callback(handle, self._on_button)
        glfw.set_cursor_pos_callback(handle, self._on_move)
        glfw.set_scroll_callback(handle, lambda _, x, y: self.controls.zoom(y))
        glfw.set_framebuffer_size_callback(handle, lambda _, width, height: self.resize(width, height))

    def _on_button(self, _: Any, button: int, action: int, mods: int) -> None:
        glfw = self._glfw
        if button != glfw.MOUSE_BUTTON_LEFT:
            return
        if action == glfw.PRESS:
            self._pressed_at = self._mouse
            self._scrub()
        elif self._pressed_at is not None:
            if np.hypot(*np.subtract(self._mouse, self._pressed_at)) < CLICK_DISTANCE:
                self.pick(*self._mouse)
            self._pressed_at = None

    def _on_move(self, _: Any, x: float, y: float) -> None:
        glfw, handle = self._glfw, self.handle
        across, down = x - self._mouse[0], y - self._mouse[1]
        self._mouse = (x, y)

        def held(button: int) -> bool:
            return bool(glfw.get_mouse_button(handle, button) == glfw.PRESS)

        is_shifted = glfw.get_key(handle, glfw.KEY_LEFT_SHIFT) == glfw.PRESS
        if held(glfw.MOUSE_BUTTON_LEFT) and not self._scrub():
            self.drag("middle" if is_shifted else "left", across, down)
        elif held(glfw.MOUSE_BUTTON_RIGHT):
            self.drag("right", across, down)
        elif held(glfw.MOUSE_BUTTON_MIDDLE):
            self.drag("middle", across, down)

    def _scrub(self) -> bool:
        """Go to the time below the mouse, when it was pressed on the line of a recording's times."""
        at = self._pressed_at
        if self.simulation is not None or at is None or at[1] < self.size[1] - 30:
            return False
        share = (self._mouse[0] - 12.0) / max(self.size[0] - 24.0, 1.0)
        self.playback.jump(self.playback.first + share * (self.playback.last - self.playback.first))
        return True

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

    def _playback(self, shown: Simulation | Recording) -> Playback:
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


def show(shown: Simulation | Recording, *, camera: Camera | None = None) -> None:
    """Open a window and stay there until it is closed.

    Parameters
    ----------
    shown : Simulation or Recording
        A simulation runs on while it is shown.
    camera : Camera, optional

    Raises
    ------
    ViewerError
        There is no screen, or no OpenGL 3.3; the message says what to install.
    """
    if isinstance(shown, Simulation):
        for _ in shown_frames(shown, 1 << 62, camera=camera):
            pass
        return
    with Window(shown, camera=camera) as window:
        while window.is_open:
            window.refresh()
