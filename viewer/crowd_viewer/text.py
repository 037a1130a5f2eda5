"""Text in the picture, drawn from a small table of glyphs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crowd_viewer.programs import compile_program

if TYPE_CHECKING:
    import moderngl

FIRST, LAST = 32, 126
CELL = (10, 18)
FONT_SIZE = 15


class Text:
    """Lines of text over a picture; without Pillow or its font there is none."""

    def __init__(self, context: moderngl.Context) -> None:
        self.context = context
        atlas = glyphs()
        self.is_on = atlas is not None
        if atlas is None:
            return
        count = LAST - FIRST + 1
        self._atlas = context.texture((CELL[0] * count, CELL[1]), 1, atlas.tobytes(), alignment=1)
        self._program = compile_program(context, ("text.vert",), ("text.frag",))
        self._program["atlas"] = 0
        self._buffer = context.buffer(reserve=4096 * 16, dynamic=True)
        self._array = context.vertex_array(
            self._program, [(self._buffer, "2f4 1f4 1f4/i", "place", "glyph", "shade")]
        )

    def draw(self, lines: list[str], size: tuple[int, int], left: int = 12, top: int = 10) -> None:
        """Draw lines with their first one's upper left corner at a pixel."""
        if not self.is_on:
            return
        rows = []
        for number, line in enumerate(lines):
            for column, letter in enumerate(line):
                code = ord(letter) if FIRST <= ord(letter) <= LAST else ord("?")
                if letter != " ":
                    x, y = left + column * CELL[0], top + number * (CELL[1] + 2)
                    rows += [(x + 1, y + 1, code - FIRST, 0.0), (x, y, code - FIRST, 1.0)]
        rows = rows[: self._buffer.size // 16]
        if not rows:
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


def glyphs() -> np.ndarray[tuple[int, int], np.dtype[np.uint8]] | None:
    """Coverage of the printable characters side by side; None where there is no font."""
    try:
        from PIL import Image, ImageDraw, ImageFont

        font = ImageFont.load_default(FONT_SIZE)
    except (ImportError, OSError):
        return None
    atlas = Image.new("L", (CELL[0] * (LAST - FIRST + 1), CELL[1]))
    draw = ImageDraw.Draw(atlas)
    for code in range(FIRST, LAST + 1):
        letter = chr(code)
        width = draw.textlength(letter, font)
        draw.text(((code - FIRST + 0.5) * CELL[0] - 0.5 * width, 0), letter, 255, font)
    return np.asarray(atlas, np.uint8)
