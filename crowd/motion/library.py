"""A motion library: one skeleton, its clips by kind, their source and licence."""

from dataclasses import dataclass, field

from crowd.errors import MotionError, describe, nearest_first
from crowd.motion.clip import Clip, ClipKind
from crowd.motion.skeleton import Skeleton


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
    """

    name: str
    skeleton: Skeleton
    clips: tuple[Clip, ...]
    source: str
    licence: str
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
