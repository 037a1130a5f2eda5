"""The model: everything a run reads and never changes, packed into arrays, and the world it happens in."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from crowd.blending.parameter_space import ParameterSpace
from crowd.characters import Cast
from crowd.errors import MotionError, describe
from crowd.motion.clip import ClipKind
from crowd.motion.clip_table import ClipTable
from crowd.motion.library import MotionLibrary
from crowd.motion.procedural import built_in_library
from crowd.motion.skeleton import Skeleton
from crowd.people import People
from crowd.scenario import PlacedCharacters, Scenario, place
from crowd.scenario.checks import check_clips
from crowd.scenario.furniture import place_furniture
from crowd.scenario.objects import place_objects
from crowd.scenario.reach import check_reachable
from crowd.scenario.worlds import TimedObstacles, build_world
from crowd.world import World
from crowd.world.furniture import Furniture
from crowd.world.objects import Objects

IntArray = npt.NDArray[np.int32]


@dataclass(frozen=True)
class Model:
    """What kernels and stages read.

    Attributes
    ----------
    library : MotionLibrary
    clip_table : ClipTable
        Its key frames, packed.
    space : ParameterSpace
        Its locomotion examples, tessellated.
    idle_clips : (I,) int32
        Table indices of the idle variations, the neutral one first.
    placed : PlacedCharacters
        Starts, traits, goals and plays.
    people : People
        Bodies.
    cast : Cast
        Skinned characters that people are drawn as.
    world : World
        Walls and walkable grid; obstacles may come and go.
    timetable : TimedObstacles
        Obstacles that come and go by the scenario.
    objects : Objects
        Things that people can grasp: names, shapes and where they are at the start.
    furniture : tuple of Furniture
        Shelves, tables and seats.
    """

    library: MotionLibrary
    clip_table: ClipTable
    space: ParameterSpace
    idle_clips: IntArray
    placed: PlacedCharacters
    people: People
    cast: Cast
    world: World
    timetable: TimedObstacles
    objects: Objects
    furniture: tuple[Furniture, ...]

    @classmethod
    def build(
        cls,
        scenario: Scenario,
        seed: int,
        motions: MotionLibrary | None = None,
        characters: int | None = None,
        character_files: Sequence[Path] = (),
    ) -> "Model":
        """Place people, build the world and pack the motion library.

        Raises
        ------
        ScenarioError
            The scenario asks for something impossible.
        MotionError
            The library lacks something that every run needs.
        """
        library = motions or built_in_library()
        table = ClipTable.build(library)
        idle = [table.index(clip.name) for clip in library.of_kind(ClipKind.IDLE)]
        if not idle:
            raise MotionError(
                describe(f'motion library "{library.name}"', "has no idle clip", allowed="at least one")
            )
        names = [table.names[clip] for clip in table.example_clip]
        check_clips(scenario, playable(library))
        placed = place(scenario, seed, characters)
        world, timetable = build_world(scenario)
        check_reachable(scenario, placed, world)
        return cls(
            library,
            table,
            ParameterSpace.build(table.parameters, table.cycle_duration, names),
            np.array(idle, np.int32),
            placed,
            People.build(library.skeleton, placed.radius, placed.preferred_speed, placed.stature, seed),
            Cast.build(scenario, placed, seed, character_files),
            world,
            timetable,
            place_objects(scenario),
            place_furniture(scenario),
        )

    def playable_clips(self) -> dict[str, int]:
        """Names of the clips that can be played, with their rows of the clip table."""
        return {name: self.clip_table.index(name) for name in playable(self.library)}

    @property
    def capacity(self) -> int:
        """Number of slots."""
        return self.placed.count

    @property
    def skeleton(self) -> Skeleton:
        """Skeleton of the library."""
        return self.library.skeleton

    @property
    def radius(self) -> npt.NDArray[np.float64]:
        """Body discs, m. (N,)"""
        return self.people.radius


def playable(library: MotionLibrary) -> list[str]:
    """Names of the clips that can be played: not single poses, nor locomotion examples, which are blended."""
    clips = [clip for clip in library.clips if clip.frame_count > 1]
    return [clip.name for clip in clips if clip.kind is not ClipKind.LOCOMOTION]
