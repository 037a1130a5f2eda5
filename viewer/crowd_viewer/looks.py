"""What each person looks like: skin, hair and clothes, drawn once from the person's stable number."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Float32Array = npt.NDArray[np.float32]
FloatArray = npt.NDArray[np.float64]
LOOK_COLUMNS = 8

# Colours as seen on a screen, 0 to 255; how often each occurs stands in front.
SKIN = (
    (5, 206, 160, 132), (5, 192, 144, 114), (4, 176, 128, 98), (3, 156, 110, 82), (3, 132, 90, 66),
    (2, 118, 80, 58), (2, 88, 58, 42),
)  # fmt: skip
HAIR = (
    (8, 28, 22, 20), (7, 52, 36, 26), (5, 84, 58, 38), (3, 128, 92, 56), (2, 184, 146, 92),
    (1, 122, 58, 34), (3, 128, 124, 120), (2, 196, 192, 186),
)  # fmt: skip
TOPS = (
    (7, 36, 40, 48), (5, 66, 72, 82), (5, 40, 56, 88), (4, 232, 230, 224), (3, 190, 192, 194),
    (2, 128, 44, 46), (2, 70, 92, 72), (2, 178, 160, 132), (2, 92, 122, 160), (1, 208, 162, 60),
    (1, 186, 92, 74), (1, 104, 80, 120), (1, 60, 118, 124), (2, 138, 136, 128), (1, 222, 186, 180),
)  # fmt: skip
BOTTOMS = (
    (8, 44, 54, 78), (5, 74, 90, 120), (6, 34, 35, 40), (3, 96, 94, 92), (3, 150, 134, 108),
    (2, 82, 72, 58), (1, 190, 184, 172), (1, 66, 74, 58),
)  # fmt: skip
SHOES = ((6, 32, 30, 30), (3, 92, 64, 44), (3, 214, 212, 206), (1, 130, 44, 40), (2, 84, 90, 100))


def mixed(value: npt.NDArray[np.uint32]) -> npt.NDArray[np.uint32]:
    """Hash whole numbers: every bit of the result depends on every bit of the number."""
    value = value ^ (value >> np.uint32(16))
    value = value * np.uint32(0x7FEB352D)
    value = value ^ (value >> np.uint32(15))
    value = value * np.uint32(0x846CA68B)
    return value ^ (value >> np.uint32(16))


def chance(identity: npt.NDArray[np.int64], purpose: int) -> FloatArray:
    """A number in [0, 1) for each person and purpose."""
    key = mixed(identity.astype(np.uint32) + np.uint32(0x9E3779B9))
    return np.asarray(mixed(key ^ np.uint32(purpose * 0x85EBCA6B & 0xFFFFFFFF)) / 4294967296.0, np.float64)


def _pick(colours: tuple[tuple[int, int, int, int], ...], share: FloatArray) -> FloatArray:
    """Linear colours by a share in [0, 1). (P, 3)."""
    table = np.array(colours, np.float64)
    bounds = np.cumsum(table[:, 0]) / table[:, 0].sum()
    chosen = np.minimum(np.searchsorted(bounds, share, side="right"), len(table) - 1)
    return np.asarray((table[chosen, 1:] / 255.0) ** 2.2)


def _varied(colour: FloatArray, identity: npt.NDArray[np.int64], purpose: int, spread: float) -> FloatArray:
    """Colours made a little lighter, darker and of another hue."""
    light = 1.0 + spread * (2.0 * chance(identity, purpose) - 1.0)
    tint = 1.0 + 0.35 * spread * (
        2.0 * np.stack([chance(identity, purpose + k) for k in (1, 2, 3)], axis=1) - 1.0
    )
    return np.clip(colour * light[:, None] * tint, 0.003, 0.9)


def draw_looks(identity: npt.NDArray[np.int64], stature: float) -> Float32Array:
    """Draw looks.

    Parameters
    ----------
    identity : (P,) int64
        Stable number of each person.
    stature : float
        Height of the body in rest pose, m; cuts are places on it.

    Returns
    -------
    (P, 8, 4) float32
        Columns: skin and nape, top and sleeve end, bottom and its hem, hair and whether there is any, shoes
        and their kind, accent and pattern, (belt, neck depth, stripes per metre, long hair), then
        the waist.
    """
    count = len(identity)
    look = np.zeros((count, LOOK_COLUMNS, 4))

    def share(purpose: int) -> FloatArray:
        return chance(identity, purpose)

    look[:, 0, :3] = _varied(_pick(SKIN, share(1)), identity, 11, 0.10)
    look[:, 0, 3] = share(2) < 0.7
    look[:, 1, :3] = _varied(_pick(TOPS, share(3)), identity, 21, 0.28)
    sleeve = share(4)
    look[:, 1, 3] = stature * np.where(sleeve < 0.62, 0.488, np.where(sleeve < 0.74, 0.60, 0.705))
    look[:, 2, :3] = _varied(_pick(BOTTOMS, share(5)), identity, 31, 0.25)
    hem = share(6)
    look[:, 2, 3] = stature * np.where(hem < 0.86, 0.045, np.where(hem < 0.93, 0.125, 0.29))
    look[:, 3, :3] = _varied(_pick(HAIR, share(7)), identity, 41, 0.2)
    look[:, 3, 3] = share(8) > 0.06
    look[:, 4, :3] = _varied(_pick(SHOES, share(9)), identity, 51, 0.2)
    look[:, 4, 3] = share(10) < 0.4
    look[:, 5, :3] = _varied(_pick(TOPS, share(61)), identity, 62, 0.3)
    pattern = share(63)
    look[:, 5, 3] = np.digitize(pattern, (0.60, 0.71, 0.83, 0.90)) % 5
    look[:, 6, 0] = share(64) < 0.4
    look[:, 6, 1] = np.where(share(65) < 0.35, 0.9, 0.25)
    look[:, 6, 2] = 9.0 + 14.0 * share(66)
    look[:, 6, 3] = share(67) < 0.42
    look[:, 7, 0] = stature * np.where(share(68) < 0.35, 0.590, 0.535)
    return look.astype(np.float32)
