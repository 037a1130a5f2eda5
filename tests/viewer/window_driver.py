"""Use a window as a person does: real events of mouse and keys on a virtual screen, and pictures of it.

Run by `test_window_input.py` inside of xvfb-run; prints one line for each thing seen.
"""

import ctypes
import os
import subprocess
import sys
import time
from pathlib import Path

import glfw
import numpy as np
from PIL import ImageGrab

import crowd
import crowd_viewer

SIZE = (1280, 720)
CAMERA = crowd_viewer.Camera((7.0, 3.5, 9.0), (0.0, 0.8, 0.0))
SECONDS = 20.0


def xdotool(*command):
    """Send events, or ask for something; returns what is printed."""
    words = ["xdotool", *map(str, command)]
    return subprocess.run(words, capture_output=True, text=True, timeout=30).stdout.strip()


def screenshot():
    """The screen now, (H, W, 3) float."""
    return np.asarray(ImageGrab.grab(xdisplay=os.environ["DISPLAY"]).convert("RGB")).astype(float)


def until(condition):
    """Wait for something to come true; whether it did."""
    end = time.monotonic() + SECONDS
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.1)
    return False


def difference(first, second):
    """Mean difference below the lines of text and above the timeline."""
    return float(np.abs(first - second)[100:650].mean())


def settled():
    """A screenshot that does not change any more."""
    last = screenshot()
    for _ in range(50):
        time.sleep(0.15)
        now = screenshot()
        if difference(now, last) < 0.01:
            return now
        last = now
    return last


def start(*arguments):
    """Run the command line; returns the process and its window once that is there, with the focus."""
    code = "from crowd.cli import main; import sys; main(sys.argv[1:])"
    process = subprocess.Popen([sys.executable, "-c", code, *map(str, arguments)])
    window = xdotool("search", "--sync", "--onlyvisible", "--name", "crowd: ").splitlines()[-1]
    xdotool("windowmove", window, 0, 0, "windowfocus", "--sync", window)
    return process, window


def other_window():
    """A small window that can take the focus away."""
    glfw.init()
    glfw.window_hint(glfw.CLIENT_API, glfw.NO_API)
    return glfw.create_window(40, 20, "another program", None, None)


def ask_to_close(window):
    """Send what a window manager sends when somebody presses the cross."""
    long = ctypes.c_long

    class Message(ctypes.Structure):
        _fields_ = (
            ("type", ctypes.c_int), ("serial", ctypes.c_ulong), ("is_sent", ctypes.c_int),
            ("display", ctypes.c_void_p), ("window", ctypes.c_ulong), ("kind", ctypes.c_ulong),
            ("format", ctypes.c_int), ("data", long * 5), ("pad", long * 24),
        )  # fmt: skip

    x11 = ctypes.CDLL("libX11.so.6")
    x11.XOpenDisplay.restype = ctypes.c_void_p
    x11.XInternAtom.restype = ctypes.c_ulong
    x11.XInternAtom.argtypes = (ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int)
    x11.XSendEvent.argtypes = (
        ctypes.c_void_p, ctypes.c_ulong, ctypes.c_int, long, ctypes.POINTER(Message),
    )  # fmt: skip
    x11.XSync.argtypes = (ctypes.c_void_p, ctypes.c_int)
    display = x11.XOpenDisplay(None)
    protocols, delete = (x11.XInternAtom(display, name, 0) for name in (b"WM_PROTOCOLS", b"WM_DELETE_WINDOW"))
    client_message = 33
    data = (long * 5)(delete, 0, 0, 0, 0)
    message = Message(client_message, 0, 1, display, int(window), protocols, 32, data)
    x11.XSendEvent(display, int(window), 0, 0, ctypes.byref(message))
    x11.XSync(display, 0)


def replay(path):
    """Watch a recording: scrub, pick, switch layers, move the camera, resize, lose the focus, close."""
    process, window = start("view", path, "--camera", CAMERA.to_json())
    with crowd.Recording(path) as recording:
        first, last = float(recording.time[0]), float(recording.time[-1])
        xdotool("key", "p", "key", "space")
        x = 700
        xdotool("mousemove", x, SIZE[1] - 22, "click", 1)
        moment = first + (x - 14) / (SIZE[0] - 28) * (last - first)
        expected = crowd_viewer.render(
            recording, time=moment, camera=CAMERA, size=SIZE, quality=crowd_viewer.FAST
        ).astype(float)
        print("scrubbed to", until(lambda: difference(screenshot(), expected) < 0.2))
        identity, _ = crowd_viewer.render_identities(recording, time=moment, camera=CAMERA, size=SIZE)
    plain = settled()
    numbers, counts = np.unique(identity[identity > 0], return_counts=True)
    rows, columns = np.nonzero(identity == numbers[np.argmax(counts)])
    middle = len(rows) // 2
    xdotool("mousemove", columns[middle], rows[middle], "click", 1)
    is_them = identity == numbers[np.argmax(counts)]
    # The picked one is tinted, the others are not.
    print("picked", until(lambda: np.abs(screenshot() - plain)[is_them].mean() > 15))
    before = settled()
    xdotool("key", "7")
    print("layer", until(lambda: difference(screenshot(), before) > 0.1))
    xdotool("key", "7")
    print("layer off", until(lambda: difference(screenshot(), before) < 0.05))
    xdotool("mousemove", 300, 300, "mousedown", 1, "mousemove", 420, 330, "mouseup", 1)
    print("orbited", until(lambda: difference(screenshot(), before) > 5))
    before = settled()
    xdotool("click", 4)
    print("nearer", until(lambda: difference(screenshot(), before) > 2))
    before = settled()
    xdotool("keydown", "w")
    print("flies", until(lambda: difference(screenshot(), before) > 5))
    other = other_window()
    xdotool("windowfocus", "--sync", glfw.get_x11_window(other))
    time.sleep(0.5)
    first_look = screenshot()
    time.sleep(0.5)
    print("stops without the focus", difference(first_look, screenshot()) < 0.05)
    glfw.destroy_window(other)
    xdotool("keyup", "w", "windowfocus", "--sync", window)
    xdotool("windowsize", "--sync", window, 1, 1)
    time.sleep(0.5)
    print("lives at one pixel", process.poll() is None)
    xdotool("windowsize", "--sync", window, 640, 400)
    print("resized", until(lambda: screenshot()[:400, :640].std() > 15 and screenshot()[410:].std() < 1))
    xdotool("windowunmap", window)
    time.sleep(0.5)
    xdotool("windowmap", "--sync", window, "windowfocus", "--sync", window)
    print("back from the bar", until(lambda: screenshot()[:400, :640].std() > 15))
    xdotool("key", "Escape")
    print("closed", process.wait(timeout=SECONDS))


def live(folder):
    """Close the window of a run while it goes on."""
    path = folder / "live.h5"
    process, window = start(
        "run", "plaza", "--characters", 20, "--seconds", 60, "--threads", 1, "--view", "--record", path
    )
    before = screenshot()
    print("runs", until(lambda: difference(screenshot(), before) > 0.3))
    ask_to_close(window)
    print("closed", process.wait(timeout=SECONDS))
    with crowd.Recording(path) as recording:
        print("kept", 0 < recording.frame_count < 30 * 60)


if __name__ == "__main__":
    replay(Path(sys.argv[1]))
    live(Path(sys.argv[1]).parent)
