"""An example set from imported clips: duplicates left out, missing sides mirrored, gaps filled and named."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from crowd.motion.clip import Clip, ClipKind
from crowd.motion.library import MotionLibrary
from crowd.motion.mirror import mirrored
from crowd.motion.procedural import built_in_library
from crowd.motion.skeleton import Skeleton

Parameters = tuple[float, float, float]

AXIS_SCALE = (4.0, math.radians(340.0), 4.0)
"""What counts as a whole range when examples are compared: m/s, rad/s, m/s."""
SAME, MIRRORED = 0.03, 0.10
"""Distance, in ranges, below which two examples are one, and below which a side is not missing."""
ASIDE = 0.25
"""A jump farther than this from straight ahead goes to a side, rad."""
BUILT_IN = "built-in library"
ALWAYS_FILLED = (ClipKind.GESTURE, ClipKind.START, ClipKind.STOP, ClipKind.SIT, ClipKind.POSTURE)
"""Kinds that the built-in library adds by name, because scenarios ask for them."""
SAME_TURN, SAME_WAY = math.radians(1.0), 0.005
"""Clips whose joints and pelvis are nowhere farther apart hold one motion, rad and m."""


@dataclass(frozen=True)
class Need:
    """A region of the parameter space that a crowd uses.

    Attributes
    ----------
    name : str
        In words.
    holds : callable
        Whether parameters (forward m/s, turn rad/s, side m/s) lie in it.
    fillers : tuple of str
        Built-in clips that fill it.
    """

    name: str
    holds: Callable[[float, float, float], bool]
    fillers: tuple[str, ...]


def _straight(turn: float, side: float) -> bool:
    return abs(turn) < 0.2 and abs(side) < 0.1


NEEDS = (
    Need("stepping in place", lambda v, w, s: abs(v) < 0.1 and _straight(w, s), ("in_place",)),
    Need("walking", lambda v, w, s: 0.3 < v < 2.2 and _straight(w, s), ("walk_slow", "walk", "walk_fast")),
    Need("running", lambda v, w, s: v >= 1.9 and _straight(w, s), ("jog", "run")),
    Need("walking backward", lambda v, w, s: v < -0.2, ("walk_back_slow", "walk_back")),
    *(
        need
        for word, sign in (("left", 1.0), ("right", -1.0))
        for need in (
            Need(
                f"turning {word} on the spot",
                lambda v, w, s, sign=sign: abs(v) < 0.2 and sign * w > 1.0,  # type: ignore[misc]
                (f"turn_{word}",),
            ),
            Need(
                f"walking in a circle to the {word}",
                lambda v, w, s, sign=sign: 0.2 <= v < 2.0 and sign * w > 0.3,  # type: ignore[misc]
                (f"walk_circle_{word}", f"walk_slow_circle_{word}", f"walk_tight_circle_{word}"),
            ),
            Need(
                f"running in a circle to the {word}",
                lambda v, w, s, sign=sign: v >= 1.5 and sign * w > 0.3,  # type: ignore[misc]
                (f"run_circle_{word}", f"run_tight_circle_{word}"),
            ),
            Need(
                f"sidestep to the {word}",
                lambda v, w, s, sign=sign: sign * s > 0.1,  # type: ignore[misc]
                (f"sidestep_slow_{word}", f"sidestep_fast_{word}"),
            ),
        )
    ),
)


@dataclass(frozen=True)
class OtherNeed:
    """What a crowd does besides locomotion.

    Attributes
    ----------
    name : str
        In words.
    holds : callable
        Whether a clip serves it.
    is_built_in : bool
        The engine has motion of its own for it, whatever a library holds.
    """

    name: str
    holds: Callable[[Clip], bool]
    is_built_in: bool = False


OTHER_NEEDS = (
    OtherNeed("standing idle", lambda clip: clip.kind is ClipKind.IDLE),
    OtherNeed("starting to walk", lambda clip: clip.kind is ClipKind.START),
    OtherNeed("stopping", lambda clip: clip.kind is ClipKind.STOP),
    OtherNeed("gestures", lambda clip: clip.kind is ClipKind.GESTURE),
    OtherNeed("reaching with the right hand", lambda clip: _reaches(clip, "right"), True),
    OtherNeed("reaching with the left hand", lambda clip: _reaches(clip, "left"), True),
    OtherNeed("jumping", lambda clip: clip.jump is not None),
)


def _reaches(clip: Clip, side: str) -> bool:
    return clip.reach is not None and clip.reach.side == side


@dataclass(frozen=True)
class Coverage:
    """Where the examples of one need come from.

    Attributes
    ----------
    need : str
    origin : str
        ``"captured"``, ``"mirrored"``, ``"built-in library"`` or ``"missing"``.
    clips : tuple of str
        Names of the examples.
    """

    need: str
    origin: str
    clips: tuple[str, ...]


@dataclass(frozen=True)
class ExampleSet:
    """A library made of imported clips, and what was done to make it whole.

    Attributes
    ----------
    library : MotionLibrary
    coverage : tuple of Coverage
    duplicates : tuple of (str, str)
        Clips that say the same as another one and are left out, with that one: examples of locomotion with
        the same parameters, others with the same motion.
    """

    library: MotionLibrary
    coverage: tuple[Coverage, ...]
    duplicates: tuple[tuple[str, str], ...]


def assemble(
    clips: Sequence[Clip],
    name: str,
    source: str,
    licence: str,
    unmirrored: Iterable[str] = (),
    fills: bool = True,
) -> ExampleSet:
    """Make a library that a crowd can run on.

    Parameters
    ----------
    clips : sequence of Clip
        Imported ones, on the project's skeleton.
    name, source, licence : str
        Of the library; the licence is the whole text.
    unmirrored : iterable of str
        Clips whose mirror image is not wanted.
    fills : bool
        Whether gaps are filled from the built-in library.
    """
    built_in = built_in_library()
    skeleton = built_in.skeleton
    kept, duplicates = without_duplicates([clip for clip in clips if clip.kind is ClipKind.LOCOMOTION])
    refused = set(unmirrored)
    images = [
        mirrored(clip, skeleton, mirror_name(clip.name))
        for clip in kept
        if clip.name not in refused
        and distance(clip.parameters, image_of(clip.parameters)) > MIRRORED
        and all(distance(image_of(clip.parameters), other.parameters) > MIRRORED for other in kept)
    ]
    examples = kept + images
    if fills:
        examples += fillers(examples, built_in)
    others, twins = without_twins([clip for clip in clips if clip.kind is not ClipKind.LOCOMOTION])
    duplicates += twins
    others += side_images(others, skeleton, refused)
    if fills:
        others += missing_others(others, built_in)
    library = MotionLibrary(name, skeleton, (*examples, *idle_first(others)), source, licence)
    return ExampleSet(library, coverage_of(library), tuple(duplicates))


def distance(first: Parameters, second: Parameters) -> float:
    """Distance of two examples, in ranges of `AXIS_SCALE`."""
    return float(np.linalg.norm((np.array(first) - np.array(second)) / AXIS_SCALE))


def image_of(parameters: Parameters) -> Parameters:
    """Parameters of the mirror image."""
    forward, turn, side = parameters
    return forward, -turn, -side


def mirror_name(name: str) -> str:
    """Name of the mirror image of a clip."""
    return f"{name}_mirrored"


def without_duplicates(clips: Sequence[Clip]) -> tuple[list[Clip], list[tuple[str, str]]]:
    """Keep one of each group of examples with the same parameters: the one whose ends agree best."""

    def fault(clip: Clip) -> float:
        quality = clip.quality
        return 0.0 if quality is None else quality.seam + 10.0 * quality.stance_drift

    kept: list[Clip] = []
    duplicates = []
    for clip in sorted(clips, key=fault):
        twin = next((other for other in kept if distance(clip.parameters, other.parameters) < SAME), None)
        if twin is None:
            kept.append(clip)
        else:
            duplicates.append((clip.name, twin.name))
    order = {clip.name: number for number, clip in enumerate(clips)}
    return sorted(kept, key=lambda clip: order[clip.name]), duplicates


def without_twins(clips: Sequence[Clip]) -> tuple[list[Clip], list[tuple[str, str]]]:
    """Keep one of the clips that hold one motion, such as a clip and its copy in another format."""
    kept: list[Clip] = []
    twins = []
    for clip in clips:
        twin = next((other for other in kept if is_twin(clip, other)), None)
        if twin is None:
            kept.append(clip)
        else:
            twins.append((clip.name, twin.name))
    return kept, twins


def is_twin(first: Clip, second: Clip) -> bool:
    """Whether two clips hold one motion."""
    if first.kind is not second.kind or first.rotation_local.shape != second.rotation_local.shape:
        return False
    if np.abs(first.pelvis_position_root - second.pelvis_position_root).max() > SAME_WAY:
        return False
    cosine = np.abs((first.rotation_local * second.rotation_local).sum(axis=-1)).min()
    return bool(cosine > math.cos(0.5 * SAME_TURN))


def fillers(examples: Sequence[Clip], built_in: MotionLibrary) -> list[Clip]:
    """Built-in examples for every need that no example meets."""
    added: list[Clip] = []
    for need in NEEDS:
        if any(need.holds(*clip.parameters) for clip in examples):
            continue
        for name in need.fillers:
            clip = replace(built_in.clip(name), source=BUILT_IN)
            taken = [*examples, *added]
            if all(distance(clip.parameters, other.parameters) >= SAME for other in taken):
                added.append(clip)
    return added


def side_images(clips: Sequence[Clip], skeleton: Skeleton, refused: set[str]) -> list[Clip]:
    """Mirror images of reaches, jumps and turns that are there for one side only."""
    images = []
    for clip in clips:
        if clip.name in refused:
            continue
        if clip.reach is not None:
            alone = not any(
                other.reach is not None and other.reach.side != clip.reach.side for other in clips
            )
        elif clip.jump is not None:
            aside = clip.jump.direction
            alone = abs(aside) > 0.25 and not any(
                other.jump is not None
                and other.jump.direction * aside < 0.0
                and abs(other.jump.direction) > 0.25
                for other in clips
            )
        else:
            alone = False
        if alone:
            images.append(mirrored(clip, skeleton, mirror_name(clip.name)))
    return images


def missing_others(clips: Sequence[Clip], built_in: MotionLibrary) -> list[Clip]:
    """Built-in clips that are no locomotion: those that scenarios ask for, and those for unmet needs."""
    names = {clip.name for clip in clips}
    unmet = [need for need in OTHER_NEEDS if not any(need.holds(clip) for clip in clips)]
    return [
        replace(clip, source=BUILT_IN)
        for clip in built_in.clips
        if clip.name not in names
        and clip.kind is not ClipKind.LOCOMOTION
        and (clip.kind in ALWAYS_FILLED or any(need.holds(clip) for need in unmet))
    ]


def idle_first(clips: Sequence[Clip]) -> list[Clip]:
    """Order clips so that the idle with the longest rest comes before the other idles."""
    return sorted(clips, key=lambda clip: (clip.kind is not ClipKind.IDLE, "idle" not in clip.name.lower()))


def coverage_of(library: MotionLibrary) -> tuple[Coverage, ...]:
    """Tell for every need where its examples come from."""
    found = []
    for need in NEEDS:
        clips = [clip for clip in library.of_kind(ClipKind.LOCOMOTION) if need.holds(*clip.parameters)]
        found.append(Coverage(need.name, origin_of(clips), tuple(clip.name for clip in clips)))
    for other in OTHER_NEEDS:
        clips = [clip for clip in library.clips if other.holds(clip)]
        origin = BUILT_IN if not clips and other.is_built_in else origin_of(clips)
        found.append(Coverage(other.name, origin, tuple(clip.name for clip in clips)))
    return tuple(found)


def origin_of(clips: Sequence[Clip]) -> str:
    """The best origin among examples."""
    if not clips:
        return "missing"
    if all(clip.source in (BUILT_IN, "") for clip in clips):
        return BUILT_IN
    if all(clip.name.endswith(mirror_name("")) or clip.source == BUILT_IN for clip in clips):
        return "mirrored"
    return "captured"


__all__ = ["NEEDS", "OTHER_NEEDS", "Coverage", "ExampleSet", "assemble", "coverage_of"]
