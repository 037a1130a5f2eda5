"""Panels with buttons and sliders, where imgui-bundle is installed; keys do the same without it."""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING, Any

import numpy as np

from crowd_viewer.bindings import LAYER_KEYS, MIX_KEY
from crowd_viewer.controls import SPEEDS
from crowd_viewer.inset import layer_bars

if TYPE_CHECKING:
    from crowd_viewer.overlays import Seen
    from crowd_viewer.window import Window

WIDTH = 250.0
LEVEL_NAMES = ("fine", "middle", "coarse", "limbs", "far", "tiny")


def imgui_module() -> Any:
    """The module that draws panels; None where it is not installed."""
    try:
        # It brings a glfw of its own, which must be loaded before any other.
        from imgui_bundle import imgui
    except ImportError:
        return None
    return imgui


class Panels:
    """One panel at the right of a window.

    Parameters
    ----------
    imgui : module
    window : Window
        Its own callbacks are set already: imgui passes on what it does not take.
    """

    def __init__(self, imgui: Any, window: Window) -> None:
        self.imgui = imgui
        self.is_shown = True
        self._context = imgui.create_context()
        imgui.get_io().set_ini_filename("")
        imgui.style_colors_dark()
        address = ctypes.cast(window.handle, ctypes.c_void_p).value
        imgui.backends.glfw_init_for_opengl(address, True)
        imgui.backends.opengl3_init("#version 330")

    @property
    def takes_mouse(self) -> bool:
        """The mouse is over a panel."""
        return self.is_shown and bool(self.imgui.get_io().want_capture_mouse)

    @property
    def takes_keys(self) -> bool:
        """Somebody writes into a field."""
        return self.is_shown and bool(self.imgui.get_io().want_text_input)

    def draw(self, window: Window, seen: Seen) -> None:
        """Draw the panels into the framebuffer in use."""
        if not self.is_shown:
            return
        imgui = self.imgui
        imgui.backends.opengl3_new_frame()
        imgui.backends.glfw_new_frame()
        imgui.new_frame()
        imgui.set_next_window_pos((max(window.size[0] - WIDTH - 10.0, 0.0), 10.0), imgui.Cond_.always)
        imgui.set_next_window_size((WIDTH, 0.0), imgui.Cond_.always)
        flags = imgui.WindowFlags_.no_resize | imgui.WindowFlags_.no_move
        imgui.begin("crowd", None, flags)
        self._time(window)
        self._camera(window)
        self._layers(window)
        self._person(seen)
        self._drawn(window)
        imgui.end()
        imgui.render()
        imgui.backends.opengl3_render_draw_data(imgui.get_draw_data())

    def close(self) -> None:
        """Give everything back."""
        self.imgui.backends.opengl3_shutdown()
        self.imgui.backends.glfw_shutdown()
        self.imgui.destroy_context(self._context)

    def _time(self, window: Window) -> None:
        imgui, playback = self.imgui, window.playback
        imgui.separator_text("time")
        if imgui.button("play" if playback.is_paused else "pause", (70.0, 0.0)):
            playback.toggle()
        imgui.same_line()
        if imgui.button("step"):
            playback.single_step(1)
        imgui.same_line()
        imgui.set_next_item_width(-1.0)
        names = [f"{speed:g} x" for speed in SPEEDS]
        present = int(np.argmin(np.abs(np.array(SPEEDS) - playback.speed)))
        changed, chosen = imgui.combo("##speed", present, names)
        if changed:
            playback.speed = SPEEDS[chosen]
        if window.simulation is None:
            imgui.set_next_item_width(-1.0)
            changed, time = imgui.slider_float(
                "##time", playback.time, playback.first, playback.last, "%.2f s"
            )
            if changed:
                playback.jump(time)

    def _camera(self, window: Window) -> None:
        imgui = self.imgui
        imgui.separator_text("camera")
        for name, action in (
            ("all", window.see_all),
            ("above", window.toggle_top),
            ("follow", lambda: window.controls.toggle_follow(window.picked)),
        ):
            if imgui.button(name):
                action()
            imgui.same_line()
        if imgui.button("copy"):
            imgui.set_clipboard_text(window.controls.camera.to_json())
        imgui.set_item_tooltip("as --camera takes it")

    def _layers(self, window: Window) -> None:
        imgui, overlays = self.imgui, window.overlays
        imgui.separator_text("layers")
        imgui.columns(2, "layers", False)
        for key, name in (LAYER_KEYS | {MIX_KEY: "mix"}).items():
            changed, _ = imgui.checkbox(f"{name}##{key}", name in overlays.shown)
            if changed:
                overlays.toggle(name)
            imgui.next_column()
        imgui.columns(1)

    def _person(self, seen: Seen) -> None:
        imgui, row = self.imgui, seen.picked
        imgui.separator_text("person")
        if row < 0:
            imgui.text_disabled("click to pick somebody")
            return
        x, _, z = seen.frame.position_world[row]
        imgui.text(f"number {seen.frame.identity[row]}, slot {row}")
        imgui.text(f"x {x:.2f}  z {z:.2f} m")
        imgui.text(f"height {seen.scene.stature[row]:.2f} m")
        velocity = seen.quantity("velocity_world")
        if velocity is not None:
            imgui.text(f"speed {np.hypot(velocity[row, 0], velocity[row, 2]):.2f} m/s")
        for bar in layer_bars(seen):
            imgui.progress_bar(min(max(bar.share, 0.0), 1.0), (-1.0, 16.0), f"{bar.name} {bar.share:.2f}")

    def _drawn(self, window: Window) -> None:
        imgui, people = self.imgui, window.renderer.people
        imgui.separator_text("drawn")
        told = [f"{count} {name}" for count, name in zip(people.counts(), LEVEL_NAMES, strict=False) if count]
        imgui.text_wrapped(", ".join(told) or "nobody")
        imgui.text(f"{people.upload_bytes / 1e6:.2f} MB a picture")
