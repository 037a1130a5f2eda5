"""The reach space: which examples to blend so that a hand comes to a place.

Examples are points at their apex hand position. Between them stand pseudo-examples, blends whose true hand
position is known; they fill the space so densely that the nearest ones answer any question.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline
from scipy.spatial import Delaunay, cKDTree
from scipy.stats import qmc

from crowd.blending.reach_cubes import along_curve, divide_space
from crowd.errors import MotionError, describe
from crowd.motion.clip import Clip
from crowd.motion.clip_table import key_intervals, rows
from crowd.motion.rotation import multiply, rotate
from crowd.motion.skeleton import Segment, Skeleton
from crowd_kernels.aligned import aligned_copy, aligned_zeros
from crowd_kernels.clip import PADDED_JOINTS
from crowd_kernels.reach_blend import JOINTS, LEFT_ARM, LOWER, RIGHT_ARM, ROW, UPPER, ReachKeys, key_shares
from crowd_kernels.reach_space import (
    BLENDED,
    BLOCK,
    CHUNKS,
    MOST_SAMPLES,
    NUMBERS,
    SCRATCH,
    ReachArrays,
    find_examples_crowd,
)

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int32]

LARGEST_GAP = 0.05
"""No place between the examples is farther from a pseudo-example, m."""
SPACING = 0.041
"""Pseudo-examples keep at least this distance, m."""
BLENDS_PER_ROUND = 256
"""Blends that are tried in each tetrahedron in one round; a round without a hit ends its search."""
MOST_ROUNDS = 40
MARGIN = 1.0
"""How far beyond the examples places are looked up, m; those farther off are brought in."""
BODY_RADIUS = 0.17
"""Hands of blends closer to the trunk's axis than this would be inside the body, m."""
WIDEST_TURN = np.radians(75.0)
"""Examples farther apart than this about the body's axis are not blended, rad."""
SEED = 5
SIDES = ("right", "left")
KEY_RATE = 30.0
"""Keys per second of the smooth curves that go through the frames of examples."""
FEWEST_INTERVALS = 2
"""Curves have at least three keys."""
ARM_PARTS = ("clavicle", "upper_arm", "forearm", "hand")
LEG_PARTS = ("thigh", "shank", "foot", "toe")


@dataclass(frozen=True)
class ReachExamples:
    """Examples of one hand.

    Attributes
    ----------
    clips : tuple of Clip
    side : str
        ``"left"`` or ``"right"`` hand.
    position : (E, 3) float64
        Hand at the apex in the root frame, m.
    rotation : (E, C, 4) float64
        Local rotations of the joints from pelvis to hand at the apex, signs aligned.
    pelvis : (E, 3) float64
        Pelvis at the apex, m.
    """

    clips: tuple[Clip, ...]
    side: str
    position: FloatArray
    rotation: FloatArray
    pelvis: FloatArray


@dataclass(frozen=True)
class PseudoExamples:
    """Blends of one hand's examples, the examples themselves first.

    Attributes
    ----------
    point : (P, 3) float64
        True hand position, m.
    clip : (P, 4) int32
        Examples that are blended.
    weight : (P, 4) float64
    corners : (T, 4) int32
        Examples around the cells that were filled.
    """

    point: FloatArray
    clip: IntArray
    weight: FloatArray
    corners: IntArray


@dataclass(frozen=True)
class ReachSpace:
    """Sets of examples with what fills the space between them; one set for each hand and body.

    Attributes
    ----------
    examples : tuple of ReachExamples
        One for each set.
    pseudo : tuple of PseudoExamples
    arrays : ReachArrays
        What the look-up kernel reads; examples are numbered over all sets.
    keys : ReachKeys
        Key frames of all examples.
    """

    examples: tuple[ReachExamples, ...]
    pseudo: tuple[PseudoExamples, ...]
    arrays: ReachArrays
    keys: ReachKeys

    @classmethod
    def build(cls, skeleton: Skeleton, sets: Sequence[Sequence[Clip]]) -> "ReachSpace":
        """Fill the space between examples.

        Parameters
        ----------
        skeleton : Skeleton
        sets : sequence of sequences of Clip
            Examples of each set, all of one hand.

        Raises
        ------
        MotionError
            A set has too few examples, or they all lie in one plane.
        """
        keys = pack_keys(skeleton, sets)
        examples: list[ReachExamples] = []
        pseudo: list[PseudoExamples] = []
        starts = np.cumsum([0, *(len(part) for part in sets)])
        for part, begin in zip(sets, starts[:-1], strict=True):
            examples.append(apex_examples(skeleton, tuple(part), keys, np.arange(begin, begin + len(part))))
            image = mirrored(examples[-1], examples[-2], pseudo[-1]) if pseudo else None
            pseudo.append(image or fill(skeleton, examples[-1]))
        return cls(tuple(examples), tuple(pseudo), pack(pseudo, starts), keys)

    def locate(self, part: npt.ArrayLike, position: npt.ArrayLike) -> tuple[IntArray, FloatArray]:
        """Look up hand positions.

        Parameters
        ----------
        part : int or (N,) int array
            Set.
        position : (N, 3) array
            m.

        Returns
        -------
        clip : (N, 12) int32
        weight : (N, 12) float64
            0 after the last example.
        """
        points = np.ascontiguousarray(np.atleast_2d(np.asarray(position, np.float64)))
        sets = np.ascontiguousarray(np.broadcast_to(np.asarray(part, np.int32), len(points)))
        clip = np.zeros((len(points), MOST_SAMPLES), np.int32)
        weight, count = np.zeros((len(points), MOST_SAMPLES)), np.zeros(len(points), np.int32)
        number, real = self.scratch()
        find_examples_crowd(self.arrays, sets, points, number, real, clip, weight, count)
        weight[np.arange(MOST_SAMPLES) >= count[:, None]] = 0.0
        return clip, weight

    def scratch(self) -> tuple[IntArray, FloatArray]:
        """What look-ups of all chunks work in."""
        size = SCRATCH + len(self.keys.first_key)
        return aligned_zeros((CHUNKS, NUMBERS), np.int32), aligned_zeros((CHUNKS, size))


def group_of(name: str) -> int | None:
    """Group of a joint that reaches write; None for eyes, fingers and others."""
    for side, arm in (("right", RIGHT_ARM), ("left", LEFT_ARM)):
        if name in {f"{side}_{part}" for part in ARM_PARTS}:
            return arm
    if name.startswith(("spine", "neck")) or name == "head":
        return UPPER
    return LOWER if name == "pelvis" or name.endswith(LEG_PARTS) else None


def pack_keys(skeleton: Skeleton, sets: Sequence[Sequence[Clip]]) -> ReachKeys:
    """Sample all examples and keep the joints that reaches write."""
    groups = {joint: group_of(name) for joint, name in enumerate(skeleton.joint_names)}
    joints = [joint for joint, group in groups.items() if group is not None]
    if len(joints) > JOINTS:
        raise MotionError(describe("reach", "too many joints of the body", len(joints), f"at most {JOINTS}"))
    clips = [clip for part in sets for clip in part]
    frames = np.cumsum([clip.frame_count for clip in clips])[:-1]
    padded = rows(np.concatenate([clip.rotation_local[:, joints] for clip in clips]))
    compact = padded.reshape(-1, 4, PADDED_JOINTS)[:, :, :JOINTS].reshape(-1, ROW)
    curves = [control_points(part, clip) for part, clip in zip(np.split(compact, frames), clips, strict=True)]
    count = np.array([len(curve) for curve in curves], np.int32)
    first = np.concatenate([[0], np.cumsum(count)[:-1]]).astype(np.int32)
    rotation = np.concatenate(curves)
    pelvis = np.concatenate([control_points(clip.pelvis_position_root, clip) for clip in clips])
    apex_time = np.array([clip.reach.apex for clip in clips if clip.reach is not None])
    end_time = np.array([clip.duration for clip in clips])
    member = np.zeros((4, JOINTS), np.float32)
    for place, joint in enumerate(joints):
        member[groups[joint], place] = 1.0
    chains = np.array([arm_chain(skeleton, side) for side in SIDES])
    return ReachKeys(
        aligned_copy(rotation),
        np.ascontiguousarray(pelvis),
        first,
        count,
        apex_time / end_time * (count - 1),
        apex_time,
        end_time,
        np.array([part[0].pelvis_position_root[0] for part in sets], np.float64),
        int(sum(len(part) for part in sets[: len(SIDES)])),
        np.array(joints, np.int32),
        aligned_copy(member.ravel()),
        np.array([[joints.index(joint) for joint in chain] for chain in chains], np.int32),
        np.searchsorted(np.unique(chains), chains).astype(np.int32),
        np.ascontiguousarray(skeleton.offset[chains]),
        np.ascontiguousarray(skeleton.segment[chains], np.int32),
        int(Segment.LEG),
        np.array([rest_position(skeleton, skeleton.joint(f"{side}_upper_arm")) for side in SIDES]),
    )


def control_points(frames: npt.NDArray[np.float32], clip: Clip) -> npt.NDArray[np.float32]:
    """Control points (k, L) of a curve of `key_shares` that meets frames (F, L) of a clip at every key."""
    count = max(key_intervals(clip, KEY_RATE), FEWEST_INTERVALS) + 1
    curve = CubicSpline(np.linspace(0.0, 1.0, len(frames)), frames)
    shares = np.zeros((count, count))
    for key in range(count):
        first, *own = key_shares(float(key), count)
        shares[key, first : first + len(own)] = own
    return np.linalg.solve(shares, curve(np.linspace(0.0, 1.0, count))).astype(np.float32)


def rest_position(skeleton: Skeleton, joint: int) -> FloatArray:
    """Place of a joint in the rest pose, m."""
    place = np.zeros(3)
    while joint >= 0:
        place += skeleton.offset[joint]
        joint = int(skeleton.parent[joint])
    return place


def apex_examples(
    skeleton: Skeleton, clips: tuple[Clip, ...], keys: ReachKeys, members: npt.NDArray[np.integer]
) -> ReachExamples:
    """Poses of examples at their apex, interpolated between keys as the blend does, and where the hand is."""
    shares = [key_shares(keys.apex[number], keys.key_count[number]) for number in members]
    key = keys.first_key[members] + [first for first, *_ in shares]
    own = np.array([parts for _, *parts in shares])
    label = clips[0].reach
    side = label.side if label is not None else SIDES[0]
    row = sum(own[:, [k]] * keys.rotation[key + k] for k in range(3))
    rotation = row.reshape(-1, 4, JOINTS)[:, :, keys.chain[SIDES.index(side)]].transpose(0, 2, 1)
    rotation = rotation / np.linalg.norm(rotation, axis=2, keepdims=True)
    pelvis = sum(own[:, [k]] * keys.pelvis[key + k] for k in range(3))
    position = hand_position(skeleton, side, rotation, pelvis)
    return ReachExamples(clips, side, position, rotation, pelvis)


def arm_chain(skeleton: Skeleton, side: str) -> list[int]:
    """Joints from the pelvis to a hand."""
    chain = [skeleton.joint(f"{side}_hand")]
    while chain[0] > 0:
        chain.insert(0, int(skeleton.parent[chain[0]]))
    return chain


def hand_position(skeleton: Skeleton, side: str, rotation: FloatArray, pelvis: FloatArray) -> FloatArray:
    """Hand in the root frame, (F, 3), for rotations of its chain (F, C, 4) and pelvis positions (F, 3)."""
    place, turned = pelvis, rotation[:, 0]
    for number, joint in enumerate(arm_chain(skeleton, side)[1:], 1):
        place = place + rotate(turned, skeleton.offset[joint])
        turned = multiply(turned, rotation[:, number])
    return place


def blend_positions(
    skeleton: Skeleton, examples: ReachExamples, clip: IntArray, weight: FloatArray
) -> FloatArray:
    """Hand positions (P, 3) of blends of four examples each."""
    rotation = (weight[:, :, None, None] * examples.rotation[clip]).sum(axis=1)
    rotation /= np.linalg.norm(rotation, axis=2, keepdims=True)
    pelvis = (weight[:, :, None] * examples.pelvis[clip]).sum(axis=1)
    return hand_position(skeleton, examples.side, rotation, pelvis)


def fill(skeleton: Skeleton, examples: ReachExamples) -> PseudoExamples:
    """Fill the space between examples with blends.

    The examples are tessellated around the body: by angle about its axis, distance from it and height. Each
    tetrahedron is filled with blends of its corners, so that blends next to each other are alike; those too
    close to others are left out.

    Notes
    -----
    **Source:** pseudo-examples of Kovar, Gleicher 2004, section 5.2.
    **Differs from the source:** weights of a low-discrepancy sequence inside a tessellation instead of random
    weights of the nearest examples, so that neighbours have one style; spacing instead of a number of tries.
    """
    count = len(examples.clips)
    corners = cells_around(examples.position, 1.0 if examples.side == "left" else -1.0)
    if len(corners) == 0:
        raise MotionError(
            describe(
                "reach examples", "do not span a space", f"{count} examples", "at least four, well spread"
            )
        )
    clip = np.zeros((count, BLENDED), np.int32)
    clip[:, 0] = np.arange(count)
    weight = np.tile([1.0, 0.0, 0.0, 0.0], (count, 1))
    point = examples.position
    draws = qmc.Sobol(BLENDED - 1, seed=SEED)
    has_gaps = np.ones(len(corners), bool)
    for _ in range(MOST_ROUNDS):
        cells = np.flatnonzero(has_gaps)
        if not len(cells):
            break
        # Gaps between sorted uniform numbers are spread evenly over all weights of sum 1.
        ordered = np.sort(draws.random(BLENDS_PER_ROUND), axis=1)
        tried_weight = np.tile(np.diff(ordered, axis=1, prepend=0.0, append=1.0), (len(cells), 1))
        cell = np.repeat(cells, BLENDS_PER_ROUND)
        tried = blend_positions(skeleton, examples, corners[cell], tried_weight)
        is_outside = np.hypot(tried[:, 0], tried[:, 2]) > BODY_RADIUS
        distance, _ = cKDTree(point).query(tried, distance_upper_bound=SPACING)
        new = np.flatnonzero(np.isinf(distance) & is_outside)
        has_gaps[:] = False
        has_gaps[cell[new]] = True
        new = new[spaced(tried[new], SPACING)]
        point = np.concatenate([point, tried[new]])
        clip = np.concatenate([clip, corners[cell[new]]])
        weight = np.concatenate([weight, tried_weight[new]])
    return PseudoExamples(point, clip, weight, corners)


def mirrored(examples: ReachExamples, other: ReachExamples, pseudo: PseudoExamples) -> PseudoExamples | None:
    """Mirror the blends of another hand's examples, if these examples are mirror images; else None."""
    flip = np.array([-1.0, 1.0, 1.0])
    if len(examples.clips) != len(other.clips) or examples.side == other.side:
        return None
    if not np.allclose(examples.position, other.position * flip, atol=1e-5):
        return None
    return replace(pseudo, point=pseudo.point * flip)


def cells_around(position: FloatArray, side: float) -> IntArray:
    """Tessellate hand positions around the body's axis; (T, 4) examples at the corners.

    `side` is 1 for the left hand, -1 for the right one, which reaches behind by turning to its own side.
    """
    across, ahead = side * position[:, 0], position[:, 2]
    # The cut lies opposite to the middle of what a hand reaches, behind the other shoulder.
    angle = np.mod(np.arctan2(across, ahead) + np.radians(130.0), 2.0 * np.pi) - np.radians(130.0)
    radius = np.hypot(across, ahead)
    # An angle weighs like the arc at the middle of all distances.
    flat = np.stack([np.median(radius) * angle, position[:, 1], radius], axis=1)
    if len(flat) < BLENDED or np.linalg.matrix_rank(flat - flat.mean(axis=0), tol=1e-3) < 3:
        return np.zeros((0, BLENDED), np.int32)
    corners = Delaunay(flat, qhull_options="QJ Pp").simplices
    return np.asarray(corners[np.ptp(angle[corners], axis=1) < WIDEST_TURN], np.int32)


def spaced(point: FloatArray, spacing: float) -> npt.NDArray[np.intp]:
    """Choose points that keep a distance, first come first served; (P,) indices."""
    if not len(point):
        return np.zeros(0, np.intp)
    neighbours = cKDTree(point).query_ball_point(point, spacing)
    is_blocked = np.zeros(len(point), bool)
    kept = []
    for number, close in enumerate(neighbours):
        if not is_blocked[number]:
            kept.append(number)
            is_blocked[close] = True
    return np.array(kept, np.intp)


def pack(pseudo: Sequence[PseudoExamples], starts: npt.NDArray[np.integer]) -> ReachArrays:
    """Prepare sets for the look-up kernel; `starts` numbers the first example of each set."""
    orders = [along_curve(part.point, SPACING) for part in pseudo]
    sets = [
        replace(part, point=part.point[order], clip=part.clip[order], weight=part.weight[order])
        for part, order in zip(pseudo, orders, strict=True)
    ]
    low = np.array([part.point.min(axis=0) - MARGIN for part in sets])
    high = np.array([part.point.max(axis=0) + MARGIN for part in sets])
    spaces = [divide_space(part.point, *corners) for part, *corners in zip(sets, low, high, strict=True)]
    clip = [part.clip + start for part, start in zip(sets, starts[:-1], strict=True)]
    point = np.concatenate([part.point for part in sets])
    candidate = joined([part.candidate for part in spaces], [len(part.point) for part in sets])
    length = np.concatenate([np.diff(part.start) for part in spaces])
    return ReachArrays(
        aligned_copy(np.pad(point, ((0, 0), (0, 1)))),
        np.concatenate(clip).astype(np.int32),
        np.ascontiguousarray(np.concatenate([part.weight for part in sets])),
        low,
        high,
        np.array([part.along for part in spaces], np.int32),
        np.cumsum([0, *(len(part.shift) for part in spaces[:-1])]).astype(np.int32),
        np.stack(
            [
                joined([part.first for part in spaces], [len(part.start) - 1 for part in spaces]),
                np.concatenate([part.shift for part in spaces]),
            ],
            axis=1,
        ).astype(np.int32),
        np.concatenate([[0], np.cumsum(length)]).astype(np.int32),
        np.pad(candidate, (0, BLOCK)).astype(np.uint16 if len(point) <= 1 << 16 else np.uint32),
    )


def joined(numbers: Sequence[npt.NDArray[np.integer]], counts: Sequence[int]) -> npt.NDArray[np.int64]:
    """Join numbers of things of each set, so that they count the things of all sets."""
    starts = np.cumsum([0, *counts[:-1]])
    return np.concatenate([own + start for own, start in zip(numbers, starts, strict=True)])
