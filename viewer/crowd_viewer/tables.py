"""Textures that shaders read as tables: one row for each person, a few texels wide."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from crowd.errors import describe
from crowd_viewer.context import ViewerError
from crowd_viewer.programs import ROWS

if TYPE_CHECKING:
    import moderngl


# moderngl's own choice for signed steps, GL_RGBA16, has no negative values: RGBA32F, RGBA16_SNORM.
INTERNAL_FORMATS = {"f4": 0x8814, "ni2": 0x8F9B}


class Table:
    """Rows of texels; rows beyond `ROWS` go to the right, since textures are of limited height.

    Parameters
    ----------
    context : moderngl.Context
    capacity : int
        Rows.
    width : int
        Texels of a row, of four components.
    dtype : str
        moderngl's name of the components' type: ``"f4"``, or ``"ni2"`` for 16-bit steps in [-1, 1].

    Raises
    ------
    ViewerError
        The driver's textures are too small.
    """

    def __init__(self, context: moderngl.Context, capacity: int, width: int, dtype: str) -> None:
        blocks = max(1, -(-capacity // ROWS))
        largest = int(context.info["GL_MAX_TEXTURE_SIZE"])
        if blocks * width > largest or largest < ROWS:
            most = largest // width * ROWS
            raise ViewerError(
                describe("viewer", "too many characters for the driver", capacity, f"up to {most}")
            )
        self.width = width
        size = (blocks * width, min(ROWS, max(capacity, 1)))
        self.texture = context.texture(size, 4, dtype=dtype, internal_format=INTERNAL_FORMATS[dtype])
        self.texture.filter = (context.NEAREST, context.NEAREST)

    def write(self, rows: npt.NDArray[np.generic]) -> int:
        """Upload rows from the first on; returns the bytes."""
        for begin in range(0, len(rows), ROWS):
            block = rows[begin : begin + ROWS]
            place = (begin // ROWS * self.width, 0, self.width, len(block))
            self.texture.write(np.ascontiguousarray(block), viewport=place)
        return rows.nbytes

    def release(self) -> None:
        """Give the memory back."""
        self.texture.release()
