"""Where the renderer draws to, and reads pictures from."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    import moderngl

Size = tuple[int, int]


class Targets:
    """Framebuffers of one size: multisampled colours, the finished picture, and who is seen where."""

    def __init__(self, context: moderngl.Context, size: Size, samples: int) -> None:
        self.context = context
        self.size = size
        samples = min(samples, context.max_samples)
        self._drawn = context.framebuffer(
            context.renderbuffer(size, 4, samples=samples), context.depth_renderbuffer(size, samples=samples)
        )
        self.picture = context.framebuffer(context.renderbuffer(size, 4))
        self._pixels = np.zeros((size[1], size[0], 3), np.uint8)

    @cached_property
    def _identity(self) -> moderngl.Framebuffer:
        context = self.context
        self._depth = context.depth_texture(self.size)
        return context.framebuffer(context.renderbuffer(self.size, 1, dtype="u4"), self._depth)

    def use_picture(self) -> None:
        """Draw colours, emptied."""
        self._drawn.use()
        self._drawn.clear(0.6, 0.7, 0.8, 1.0, depth=1.0)

    def use_identity(self) -> None:
        """Draw slots, emptied."""
        self._identity.use()
        self._identity.clear(depth=1.0)

    def resolve(self) -> None:
        """Average the samples into the picture."""
        self.context.copy_framebuffer(self.picture, self._drawn)

    def read_picture(self) -> npt.NDArray[np.uint8]:
        """The picture, the upper left pixel first. (H, W, 3)."""
        self.picture.read_into(self._pixels, components=3, alignment=1)
        return self._pixels[::-1].copy()

    def read_identity(self) -> npt.NDArray[np.uint32]:
        """Slot + 1 of whoever is seen, or 0. (H, W)."""
        data = self._identity.read(components=1, dtype="u4", alignment=1)
        return np.frombuffer(data, np.uint32).reshape(self.size[1], self.size[0])[::-1].copy()

    def read_depth(self) -> npt.NDArray[np.float32]:
        """Content of the depth buffer, 0 to 1. (H, W)."""
        data = self._depth.read(alignment=1)
        return np.frombuffer(data, np.float32).reshape(self.size[1], self.size[0])[::-1].copy()

    def release(self) -> None:
        """Give the memory back."""
        for framebuffer in (self._drawn, self.picture, self.__dict__.get("_identity")):
            if framebuffer is not None:
                for attachment in (*framebuffer.color_attachments, framebuffer.depth_attachment):
                    if attachment is not None:
                        attachment.release()
                framebuffer.release()
