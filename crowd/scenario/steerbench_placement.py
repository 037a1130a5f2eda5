"""Random placement exactly as the SteerBench reader does it, so that everybody starts where others do."""

import math
from collections import defaultdict

import numpy as np
import numpy.typing as npt

UintArray = npt.NDArray[np.uint32]

STATE_SIZE = 624
MIDDLE = 397
INITIAL_FACTOR = 1812433253
READER_SEED = 2
GIVE_UP_AFTER = 10_000
CELL = 2.0


class ReaderRandom:
    """The generator of the SteerBench reader: MT19937 with a twist that differs from the standard one.

    Where the standard XORs a constant matrix row when the low bit is set, this one XORs the low bit itself.
    Start and tempering are the usual ones.
    """

    def __init__(self, seed: int = READER_SEED) -> None:
        state = [seed & 0xFFFFFFFF]
        for index in range(1, STATE_SIZE):
            before = state[-1]
            state.append((INITIAL_FACTOR * (before ^ (before >> 30)) + index) & 0xFFFFFFFF)
        self._state: UintArray = np.array(state, np.uint32)
        self._ready: list[int] = []
        self._next = 0

    def integer(self) -> int:
        """Draw 32 bits."""
        if self._next == len(self._ready):
            self._ready = self._renew().tolist()
            self._next = 0
        value = self._ready[self._next]
        self._next += 1
        return value

    def below(self, limit: float) -> float:
        """Draw a number from 0 to `limit`, both included."""
        return self.integer() * (1.0 / 4294967295.0) * limit

    def _renew(self) -> UintArray:
        """Twist the whole state and temper it."""
        state = self._state
        first = STATE_SIZE - MIDDLE
        # Each block needs only values that the block before it has already twisted.
        for begin, end in (
            (0, first),
            (first, 2 * first),
            (2 * first, STATE_SIZE - 1),
            (STATE_SIZE - 1, STATE_SIZE),
        ):
            here = np.arange(begin, end)
            following = state[(here + 1) % STATE_SIZE]
            mixed = (state[here] & np.uint32(0x80000000)) | (following & np.uint32(0x7FFFFFFF))
            far = state[(here + MIDDLE) % STATE_SIZE]
            state[here] = far ^ (mixed >> np.uint32(1)) ^ (following & np.uint32(1))
        tempered = state ^ (state >> np.uint32(11))
        tempered ^= (tempered << np.uint32(7)) & np.uint32(0x9D2C5680)
        tempered ^= (tempered << np.uint32(15)) & np.uint32(0xEFC60000)
        return np.asarray(tempered ^ (tempered >> np.uint32(18)), np.uint32)


class ReaderPlacement:
    """Discs and boxes placed so far, and the reader's way to find a free place for the next one."""

    def __init__(self, rng: ReaderRandom) -> None:
        self.rng = rng
        self._discs: dict[tuple[int, int], list[tuple[float, float, float]]] = defaultdict(list)
        self._largest_radius = 0.0
        self._boxes = np.zeros((0, 4))

    def add_box(self, x_low: float, x_high: float, z_low: float, z_high: float) -> None:
        """Note a box."""
        self._boxes = np.vstack([self._boxes, [x_low, x_high, z_low, z_high]])

    def add_disc(self, x: float, z: float, radius: float) -> None:
        """Note a disc."""
        self._discs[math.floor(x / CELL), math.floor(z / CELL)].append((x, z, radius))
        self._largest_radius = max(self._largest_radius, radius)

    def direction(self) -> tuple[float, float]:
        """Draw a heading as x and z of a unit vector."""
        angle = self.rng.below(2.0 * math.pi)
        return math.cos(angle), math.sin(angle)

    def free_place(
        self, x_bounds: tuple[float, float], z_bounds: tuple[float, float], radius: float
    ) -> tuple[float, float] | None:
        """Draw places inside a box until nothing overlaps.

        Parameters
        ----------
        x_bounds, z_bounds : (float, float)
            Region, m.
        radius : float
            Clearance needed, m.

        Returns
        -------
        (float, float) or None
            x and z in single precision; None after 10,000 attempts.
        """
        single, r = np.float32, np.float32(radius)
        span_x = float(single(x_bounds[1]) - single(x_bounds[0]) - single(2.0) * r)
        span_z = float(single(z_bounds[1]) - single(z_bounds[0]) - single(2.0) * r)
        low_x, low_z = single(x_bounds[0]) + r, single(z_bounds[0]) + r
        for _ in range(GIVE_UP_AFTER):
            x = float(low_x + single(self.rng.below(span_x)))
            z = float(low_z + single(self.rng.below(span_z)))
            if self._is_free(x, z, radius):
                return x, z
        return None

    def _is_free(self, x: float, z: float, radius: float) -> bool:
        reach = radius + self._largest_radius
        for cell_x in range(math.floor((x - reach) / CELL), math.floor((x + reach) / CELL) + 1):
            for cell_z in range(math.floor((z - reach) / CELL), math.floor((z + reach) / CELL) + 1):
                for other_x, other_z, other_radius in self._discs.get((cell_x, cell_z), ()):
                    if (x - other_x) ** 2 + (z - other_z) ** 2 < (radius + other_radius) ** 2:
                        return False
        if not len(self._boxes):
            return True
        boxes = self._boxes
        gap_x = np.maximum(np.maximum(boxes[:, 0] - x, x - boxes[:, 1]), 0.0)
        gap_z = np.maximum(np.maximum(boxes[:, 2] - z, z - boxes[:, 3]), 0.0)
        return not bool((gap_x * gap_x + gap_z * gap_z < radius * radius).any())
