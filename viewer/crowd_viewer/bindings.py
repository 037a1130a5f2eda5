"""Mouse and keys of a window: what each does, and the list of them that H shows."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from crowd_viewer.controls import Key
from crowd_viewer.overlays import LAYERS

if TYPE_CHECKING:
    from crowd_viewer.window import Window

CLICK_DISTANCE = 4.0
LAYER_KEYS = dict(zip("1234567890", (*LAYERS, "grid"), strict=True))
MIX_KEY = "b"
MOUSE = (
    "left drag: orbit   right drag: look around   middle or shift drag: move   wheel: nearer",
    "click: pick a person   W A S D Q E: fly   drag the bar below: time of a recording",
)
KEYS_PER_LINE = 6


def keys_of(window: Window) -> tuple[Key, ...]:
    """All keys of a window but those held down to fly."""
    playback, controls = window.playback, window.controls

    def layer(name: str) -> Key:
        return Key(name, LAYER_KEYS[name], lambda: window.overlays.toggle(LAYER_KEYS[name]))

    return (
        Key("space", "pause", playback.toggle),
        Key(".", "next frame", lambda: playback.single_step(1)),
        Key(",", "frame before", window.step_back),
        Key("[", "slower", lambda: playback.change_speed(-1)),
        Key("]", "faster", lambda: playback.change_speed(1)),
        Key("f", "follow", lambda: controls.toggle_follow(window.picked)),
        Key("t", "from above", window.toggle_top),
        Key("home", "see all", window.see_all),
        *map(layer, LAYER_KEYS),
        Key(MIX_KEY, "pose mix", lambda: window.overlays.toggle("mix")),
        Key("p", "panels", window.toggle_panels),
        Key("h", "this list", window.toggle_help),
        Key("escape", "close", window.ask_to_close),
    )


def help_lines(keys: tuple[Key, ...]) -> list[str]:
    """The list of keys, some to a line."""
    told = [f"{key.name} {key.meaning}" for key in keys]
    lines = ["   ".join(told[k : k + KEYS_PER_LINE]) for k in range(0, len(told), KEYS_PER_LINE)]
    return [*MOUSE, *lines]


class Bindings:
    """Turns events of a window into calls of it."""

    def __init__(self, window: Window, glfw: Any) -> None:
        self.window = window
        self._glfw = glfw
        self._mouse = (0.0, 0.0)
        self._pressed_at: tuple[float, float] | None = None
        handle = window.handle
        special = {"space": "SPACE", "home": "HOME", "escape": "ESCAPE", ".": "PERIOD", ",": "COMMA"}
        special |= {"[": "LEFT_BRACKET", "]": "RIGHT_BRACKET"}
        self._key_of = {
            getattr(glfw, f"KEY_{special.get(key.name, key.name.upper())}"): key for key in window.keys
        }
        glfw.set_key_callback(handle, self._on_key)
        glfw.set_mouse_button_callback(handle, self._on_button)
        glfw.set_cursor_pos_callback(handle, self._on_move)
        glfw.set_scroll_callback(handle, self._on_scroll)
        glfw.set_framebuffer_size_callback(handle, lambda _, width, height: window.resize(width, height))
        glfw.set_window_focus_callback(handle, self._on_focus)

    def flying(self) -> tuple[float, float, float]:
        """To the right, up and ahead, as the keys that are held ask for: -1, 0 or 1."""
        glfw, handle = self._glfw, self.window.handle
        if self.window.takes_keys:
            return 0.0, 0.0, 0.0

        def held(name: str) -> float:
            return float(glfw.get_key(handle, getattr(glfw, f"KEY_{name}")) == glfw.PRESS)

        return held("D") - held("A"), held("E") - held("Q"), held("W") - held("S")

    def _on_key(self, _: Any, key: int, code: int, action: int, mods: int) -> None:
        if action != self._glfw.RELEASE and key in self._key_of and not self.window.takes_keys:
            self._key_of[key].action()

    def _on_scroll(self, _: Any, x: float, y: float) -> None:
        if not self.window.takes_mouse:
            self.window.controls.zoom(y)

    def _on_focus(self, _: Any, has_focus: int) -> None:
        # What was held when the focus went is not held any more; the mouse may be anywhere when it returns.
        self._pressed_at = None
        if has_focus:
            self._mouse = self._in_pixels(*self._glfw.get_cursor_pos(self.window.handle))

    def _on_button(self, _: Any, button: int, action: int, mods: int) -> None:
        glfw = self._glfw
        if button != glfw.MOUSE_BUTTON_LEFT or (action == glfw.PRESS and self.window.takes_mouse):
            return
        if action == glfw.PRESS:
            self._pressed_at = self._mouse
            self.window.scrub(self._mouse, self._pressed_at)
        elif self._pressed_at is not None:
            is_click = np.hypot(*np.subtract(self._mouse, self._pressed_at)) < CLICK_DISTANCE
            if is_click and not self.window.is_on_timeline(self._pressed_at):
                self.window.pick(*self._mouse)
            self._pressed_at = None

    def _on_move(self, _: Any, x: float, y: float) -> None:
        glfw, handle = self._glfw, self.window.handle
        before, self._mouse = self._mouse, self._in_pixels(x, y)
        if self.window.takes_mouse:
            return

        def held(button: int) -> bool:
            return bool(glfw.get_mouse_button(handle, button) == glfw.PRESS)

        across, down = self._mouse[0] - before[0], self._mouse[1] - before[1]
        is_shifted = glfw.get_key(handle, glfw.KEY_LEFT_SHIFT) == glfw.PRESS
        if held(glfw.MOUSE_BUTTON_LEFT) and self._pressed_at is not None:
            if not self.window.scrub(self._mouse, self._pressed_at):
                self.window.drag("middle" if is_shifted else "left", across, down)
        elif held(glfw.MOUSE_BUTTON_RIGHT):
            self.window.drag("right", across, down)
        elif held(glfw.MOUSE_BUTTON_MIDDLE):
            self.window.drag("middle", across, down)

    def _in_pixels(self, x: float, y: float) -> tuple[float, float]:
        """Pixels of the picture, which are smaller than units of the screen on some displays."""
        width, height = self._glfw.get_window_size(self.window.handle)
        return x * self.window.size[0] / max(width, 1), y * self.window.size[1] / max(height, 1)
