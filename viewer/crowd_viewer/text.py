"""Text in the picture, drawn from a small table of glyphs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from crowd_viewer.programs import compile_program

if TYPE_CHECKING:
    import moderngl

FIRST, LAST = 32, 126
CELL = (18, 18)
LINE_HEIGHT = 19
FONT_SIZE = 15
CAPACITY = 8192
"""Letters of one picture, twice: with their shadows."""


class Text:
    """Lines of text over a picture; without Pillow or its font there is none."""

    def __init__(self, context: moderngl.Context) -> None:
        self.context = context
        self._rows: list[tuple[float, float, float, float]] = []
        self._advance: list[float] = []
        font = glyphs()
        self.is_on = font is not None
        if font is None:
            return
        atlas, self._advance = font
        count = LAST - FIRST + 1
        self._atlas = context.texture((CELL[0] * count, CELL[1]), 1, atlas.tobytes(), alignment=1)
        self._program = compile_program(context, ("text.vert",), ("text.frag",))
        self._program["atlas"] = 0
        self._buffer = context.buffer(reserve=CAPACITY * 16, dynamic=True)
        self._array = context.vertex_array(
            self._program, [(self._buffer, "2f4 1f4 1f4/i", "place", "glyph", "shade")]
        )

    def width(self, line: str) -> float:
        """Length of a line, pixels."""
        return sum(self._advance[number] for number in _numbers(line)) if self.is_on else 0.0

    def write(self, lines: list[str], left: float, top: float) -> None:
        """Add lines with their first one's upper left corner at a pixel."""
        if not self.is_on:
            return
        for number, line in enumerate(lines):
            x, y = float(round(left)), float(round(top) + number * LINE_HEIGHT)
            for glyph in _numbers(line):
                self._rows += [(round(x) + 1.0, y + 1.0, glyph, 0.0), (round(x), y, glyph, 1.0)]
                x += self._advance[glyph]

    def draw(self, size: tuple[int, int]) -> None:
        """Draw all lines over a picture of a size, and forget them."""
        rows, self._rows = self._rows[:CAPACITY], []
        if not rows or not self.is_on:
            return
        self._buffer.write(np.array(rows, np.float32).tobytes())
        context = self.context
        context.enable_only(context.BLEND)
        context.blend_func = context.SRC_ALPHA, context.ONE_MINUS_SRC_ALPHA
        self._program["size"] = size
        self._program["cell"] = CELL
        self._atlas.use(0)
        self._array.render(context.TRIANGLE_STRIP, vertices=4, instances=len(rows))
        context.disable(context.BLEND)


def _numbers(line: str) -> list[int]:
    """Places of letters in the table of glyphs."""
    return [(ord(letter) if FIRST <= ord(letter) <= LAST else ord("?")) - FIRST for letter in line]


def glyphs() -> tuple[npt.NDArray[np.uint8], list[float]] | None:
    """Coverage of the printable characters side by side, and their widths, pixels; None without a font."""
    try:
        from PIL import Image, ImageDraw, ImageFont

        font = ImageFont.load_default(FONT_SIZE)
    except (ImportError, OSError):
        return None
    atlas = Image.new("L", (CELL[0] * (LAST - FIRST + 1), CELL[1]))
    draw = ImageDraw.Draw(atlas)
    letters = [chr(code) for code in range(FIRST, LAST + 1)]
    for number, letter in enumerate(letters):
        draw.text((number * CELL[0] + 1, 0), letter, 255, font)
    return np.asarray(atlas, np.uint8), [float(draw.textlength(letter, font)) for letter in letters]
