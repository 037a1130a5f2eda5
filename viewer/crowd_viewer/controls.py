"""What mouse and keys do to the camera and to the course of time, apart from any window."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from crowd_viewer.camera import Camera

FloatArray = npt.NDArray[np.float64]
TURN_PER_PIXEL = 0.005
ZOOM_PER_STEP = 0.88
LEAST_DISTANCE, MOST_DISTANCE = 0.4, 2000.0
STEEPEST = math.radians(89.0)
FLYING_SPEED = 6.0
SPEEDS = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0)


@dataclass
class CameraControls:
    """A camera that orbits a point, flies, follows a person, or looks straight down.

    Attributes
    ----------
    camera : Camera
    followed : int
        Slot of the person that the camera goes along with, -1 for nobody.
    """

    camera: Camera
    followed: int = -1
    _followed_at: FloatArray | None = field(default=None, repr=False)
    _before_top: Camera | None = field(default=None, repr=False)

    def orbit(self, across: float, down: float) -> None:
        """Turn about the point that is looked at; pixels of mouse movement."""
        if self._before_top is not None:
            self.pan(across, down, 1.0)
            return
        away = np.subtract(self.camera.eye, self.camera.target)
        distance = float(np.linalg.norm(away))
        azimuth = math.atan2(away[0], away[2]) - TURN_PER_PIXEL * across
        elevation = math.asin(float(np.clip(away[1] / distance, -1.0, 1.0))) + TURN_PER_PIXEL * down
        elevation = min(max(elevation, -0.2), STEEPEST)
        turned = Camera.around(self.camera.target, distance, azimuth, elevation)
        self.camera = replace(self.camera, eye=turned.eye)

    def pan(self, across: float, down: float, picture_height: float) -> None:
        """Move along the picture, so that the scene follows the mouse."""
        right, up, _ = self.camera.axes()
        if self.camera.is_perspective:
            distance = math.dist(self.camera.eye, self.camera.target)
            metres = 2.0 * distance * math.tan(0.5 * self.camera.field_of_view) / max(picture_height, 1.0)
        else:
            metres = self.camera.height / max(picture_height, 1.0)
        self.camera = self.camera.moved(metres * (down * up - across * right))

    def zoom(self, steps: float) -> None:
        """Come nearer with positive steps of the wheel."""
        factor = ZOOM_PER_STEP**steps
        if not self.camera.is_perspective:
            height = min(max(self.camera.height * factor, LEAST_DISTANCE), MOST_DISTANCE)
            self.camera = replace(self.camera, height=height)
            return
        away = np.subtract(self.camera.eye, self.camera.target)
        distance = float(np.linalg.norm(away))
        wanted = min(max(distance * factor, LEAST_DISTANCE), MOST_DISTANCE)
        x, y, z = np.add(self.camera.target, away * (wanted / distance))
        self.camera = replace(self.camera, eye=(float(x), float(y), float(z)))

    def fly(self, right: float, up: float, ahead: float, seconds: float) -> None:
        """Move by shares of the flying speed along the camera's axes."""
        if right == up == ahead == 0.0:
            return
        axes = np.stack(self.camera.axes())
        self.camera = self.camera.moved(FLYING_SPEED * seconds * np.array([right, up, ahead]) @ axes)

    def look_around(self, across: float, down: float) -> None:
        """Turn the camera where it stands; pixels of mouse movement."""
        ahead = np.subtract(self.camera.target, self.camera.eye)
        distance = float(np.linalg.norm(ahead))
        azimuth = math.atan2(-ahead[0], -ahead[2]) - TURN_PER_PIXEL * across
        elevation = math.asin(float(np.clip(-ahead[1] / distance, -1.0, 1.0))) + TURN_PER_PIXEL * down
        elevation = min(max(elevation, -STEEPEST), STEEPEST)
        turned = Camera.around((0.0, 0.0, 0.0), distance, azimuth, elevation)
        x, y, z = np.subtract(self.camera.eye, turned.eye)
        self.camera = replace(self.camera, target=(float(x), float(y), float(z)))

    def toggle_top(self, height: float) -> None:
        """Look straight down without perspective over a height of the ground, m; and back."""
        if self._before_top is not None:
            self.camera, self._before_top = self._before_top, None
            return
        self._before_top = self.camera
        x, _, z = self.camera.target
        self.camera = Camera((x, 50.0, z), (x, 0.0, z), 0.0, height)

    def frame_all(self, camera: Camera) -> None:
        """Take a camera that sees everything, and follow nobody."""
        self._before_top = None
        self.followed = -1
        self.camera = camera

    def toggle_follow(self, slot: int) -> None:
        """Go along with a person, or stay."""
        self.followed = -1 if slot < 0 or self.followed == slot else slot
        self._followed_at = None

    def follow(self, position_world: FloatArray) -> None:
        """Keep the followed person where it was in the picture; call it for each frame."""
        if not 0 <= self.followed < len(position_world):
            return
        now = position_world[self.followed] + np.array([0.0, 1.0, 0.0])
        if self._followed_at is None:
            step = now - np.asarray(self.camera.target)
            self._followed_at = now
            self.camera = self.camera.moved(step)
            return
        self.camera = self.camera.moved(now - self._followed_at)
        self._followed_at = now


@dataclass
class Playback:
    """The course of time: pause, single steps, speed, and jumps within what is known.

    Attributes
    ----------
    time : float
        s.
    is_paused : bool
    speed : float
        Against real time.
    first, last : float
        What can be shown, s; infinite for a simulation that goes on.
    step : float
        Length of a single step, s.
    """

    time: float = 0.0
    is_paused: bool = False
    speed: float = 1.0
    first: float = 0.0
    last: float = math.inf
    step: float = 1.0 / 30.0

    def advance(self, wall_seconds: float) -> float:
        """Let time go on; returns by how much, s."""
        if self.is_paused:
            return 0.0
        before = self.time
        self.jump(self.time + self.speed * wall_seconds)
        return self.time - before

    @property
    def share(self) -> float:
        """Part of what can be shown that has passed, 0 to 1."""
        length = self.last - self.first
        return (self.time - self.first) / length if length > 0.0 else 0.0

    def toggle(self) -> None:
        """Pause, or go on; at the end of a recording, begin again."""
        self.is_paused = not self.is_paused
        if not self.is_paused and self.time >= self.last:
            self.time = self.first

    def jump(self, time: float) -> None:
        """Go to a time, as near as can be shown."""
        self.time = min(max(time, self.first), self.last)

    def single_step(self, direction: int) -> None:
        """Pause, and go on or back by one frame."""
        self.is_paused = True
        self.jump(self.time + direction * self.step)

    def change_speed(self, direction: int) -> None:
        """Take the next faster or slower speed."""
        index = int(np.argmin(np.abs(np.array(SPEEDS) - self.speed))) + direction
        self.speed = SPEEDS[min(max(index, 0), len(SPEEDS) - 1)]


@dataclass(frozen=True)
class Key:
    """A key, what it does, and a line about it for the list of keys."""

    name: str
    meaning: str
    action: Callable[[], None]
