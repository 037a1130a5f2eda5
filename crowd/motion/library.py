"""A motion library: one skeleton, its clips by kind, their source and licence."""

from dataclasses import dataclass, field

from crowd.errors import MotionError, describe, nearest_first
from crowd.motion.clip import Clip, ClipKind
from crowd.motion.skeleton import Skeleton


@dataclass(frozen=True)
class Calibration:
    """How well a crowd on a library does what it is asked, measured over its whole locomotion space.

    Attributes
    ----------
    points : int
        Commands that were tried.
    speed_rms_relative : float
        Realised against asked speed.
    turn_rms_deg_s : float
        Realised against asked turn rate, deg/s.
    drift_mean_m, drift_p95_m : float
        Drift of planted feet in a stance, after foot locks, m.
    """

    points: int
    speed_rms_relative: float
    turn_rms_deg_s: float
    drift_mean_m: float
    drift_p95_m: float


@dataclass(frozen=True)
class MotionLibrary:
    """Clips on one skeleton.

    Attributes
    ----------
    name : str
    skeleton : Skeleton
    clips : tuple of Clip
        Names are unique.
    source, licence : str
        Where the motion comes from and the terms it may be used under.
    calibration : Calibration or None
        None while it has not been measured.
    """

    name: str
    skeleton: Skeleton
    clips: tuple[Clip, ...]
    source: str
    licence: str
    calibration: Calibration | None = None
    _by_name: dict[str, Clip] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_by_name", {clip.name: clip for clip in self.clips})

    def of_kind(self, kind: ClipKind) -> tuple[Clip, ...]:
        """All clips that serve one purpose, in library order."""
        return tuple(clip for clip in self.clips if clip.kind is kind)

    def clip(self, name: str) -> Clip:
        """The clip of this name.

        Raises
        ------
        MotionError
            No clip has this name; the nearest known names are listed.
        """
        if name not in self._by_name:
            known = nearest_first(name, self._by_name)
            raise MotionError(describe(f'motion library "{self.name}"', "no clip has this name", name, known))
        return self._by_name[name]
