"""Irises are drawn where the eyes look: aside, up and down, each eye by itself, whatever the head does."""

import math
from dataclasses import replace

import numpy as np
import pytest

import crowd

SIZE = (540, 180)
PICTURE_HEIGHT = 0.060
PIXELS = SIZE[1] / PICTURE_HEIGHT
"""Pixels of a metre of the average head."""
EYE_MIDDLE, EYEBALL, IRIS = 0.0315, 0.0125, 0.0057
"""Distance of painted eyes from the middle of the face, and radii, m."""
TOLERANCE = 1.5
"""Of places of irises, pixels: half a millimetre."""
PEOPLE = (0, 2, 5)
"""Those whose brows leave their eyes in an even light."""


@pytest.fixture(scope="module")
def scene(drawing):
    from crowd_viewer.frame import LiveSource

    simulation = crowd.Simulation(crowd.load_scenario("circle_swap"), seed=1, characters=8, threads=1)
    return LiveSource(simulation).scene


@pytest.fixture(scope="module")
def renderer(drawing, scene):
    from crowd_viewer.context import headless_context
    from crowd_viewer.renderer import Renderer

    with Renderer(headless_context(), scene, SIZE, replace(drawing.FINE, shadow_size=0)) as renderer:
        yield renderer


def looking(scene, turns):
    """People who stand 3 m apart, some of their joints turned about x (down) and y (left), degrees."""
    from crowd.joints import Joints
    from crowd.state import State
    from crowd_kernels.clip import PADDED_JOINTS
    from crowd_viewer.frame import CrowdFrame

    count, skeleton = len(scene.stature), scene.skeleton
    state, joints = State.create(count), Joints(skeleton, count)
    state.pose_rotation[:, :PADDED_JOINTS] = 1.0
    state.pose_pelvis[:] = skeleton.offset[0]
    pose = state.pose_rotation.reshape(count, 4, PADDED_JOINTS)
    for name, (down, left) in turns.items():
        x, y = 0.5 * math.radians(down), 0.5 * math.radians(left)
        turn = (math.cos(x) * math.cos(y), math.sin(x) * math.cos(y), math.cos(x) * math.sin(y))
        pose[:, :, skeleton.joint(name)] = (*turn, -math.sin(x) * math.sin(y))
    joints.compute_arrays(state, scene.segment_scale, np.arange(count, dtype=np.int32))
    position = np.zeros((count, 3))
    position[:, 0] = 3.0 * np.arange(count)
    return CrowdFrame(
        0.0,
        np.ones(count, bool),
        np.arange(count),
        position,
        np.zeros(count),
        joints.position_model.copy(),
        joints.rotation_model.copy(),
    )


def eyes(drawing, scene, renderer, person, head=(0.0, 0.0), left_eye=(0.0, 0.0), right_eye=None):
    """Pixels of the left and the right eye in a picture from straight ahead of the face.

    For each eye: how far columns are to the left of its middle and rows above it, m, and where the iris is.
    """
    from crowd.body.stance import flesh_segments, rest_positions

    skeleton, number = scene.skeleton, scene.skeleton.joint("head")
    turns = {"head": head, "left_eye": left_eye, "right_eye": left_eye if right_eye is None else right_eye}
    frame, rest = looking(scene, turns), rest_positions(skeleton)
    scale = float(scene.segment_scale[person, flesh_segments(skeleton)[number]])
    down, left = (math.radians(angle) for angle in head)
    ahead = np.array([math.cos(down) * math.sin(left), -math.sin(down), math.cos(down) * math.cos(left)])
    up = np.array([math.sin(down) * math.sin(left), math.cos(down), math.sin(down) * math.cos(left)])
    height, depth = (rest[skeleton.joint("left_eye")] - rest[number])[1:]
    middle = frame.position_world[person] + frame.joint_position_model[person, number]
    middle = middle + scale * ((height + 0.0005) * up + depth * ahead)
    camera = drawing.Camera(tuple(middle + ahead), tuple(middle), 0.0, scale * PICTURE_HEIGHT)
    renderer.draw(frame, camera, keeps_levels=False)
    bright = renderer.picture().astype(float).mean(axis=2)
    columns = (np.arange(SIZE[0]) + 0.5 - 0.5 * SIZE[0]) / PIXELS
    above = (0.5 * SIZE[1] - 0.5 - np.arange(SIZE[1])) / PIXELS
    for side in (1.0, -1.0):
        beside = columns - side * EYE_MIDDLE
        # The corners of the eye are as dark as the iris.
        inside = np.abs(beside) < 0.0105
        row = bright[np.abs(above).argmin(), inside]
        yield beside, above, inside & (bright < 0.5 * (row.min() + row.max()))


def aside(*what, **turns):
    """How far the irises are to the left of the middles of the eyes, pixels. (2,)."""
    return np.array(
        [
            PIXELS * np.average(beside, weights=iris[np.abs(above) < 0.0015].mean(axis=0))
            for beside, above, iris in eyes(*what, **turns)
        ]
    )


def widths(height, *what, **turns):
    """Widths of the irises around the middles of the eyes at a height above them, m, in pixels. (2,)."""
    width = []
    for beside, above, iris in eyes(*what, **turns):
        bright = beside[~iris[np.abs(above - height).argmin()]]
        width.append(PIXELS * (bright[bright > 0.0].min() - bright[bright < 0.0].max()) - 1.0)
    return np.array(width)


@pytest.fixture(params=PEOPLE)
def face(request, drawing, scene, renderer):
    """One person's face, for `aside` and `widths`."""
    return drawing, scene, renderer, request.param


def test_eyes_that_look_ahead_are_drawn_straight(face):
    assert np.abs(aside(*face)).max() < TOLERANCE
    assert np.abs(aside(*face, head=(-10.0, -25.0))).max() < TOLERANCE


@pytest.mark.parametrize("left", [20.0, -20.0, 8.0])
def test_irises_go_aside_with_the_eyes(face, left):
    expected = PIXELS * EYEBALL * math.sin(math.radians(left))
    assert aside(*face, left_eye=(0.0, left)) == pytest.approx([expected, expected], abs=TOLERANCE)
    turned = aside(*face, head=(-10.0, 30.0), left_eye=(0.0, left))
    assert turned == pytest.approx([expected, expected], abs=TOLERANCE)


def test_each_iris_follows_its_own_eye(face):
    inwards = PIXELS * EYEBALL * math.sin(math.radians(8.0))
    away = aside(*face, left_eye=(0.0, -8.0), right_eye=(0.0, 8.0))
    assert away == pytest.approx([-inwards, inwards], abs=TOLERANCE)


@pytest.mark.parametrize(
    ("up", "heights"),
    [
        (0.0, (-0.0025, 0.0, 0.0025)),
        (15.0, (0.0, 0.0025)),
        (-15.0, (-0.0025, 0.0)),
        (20.0, (0.005,)),
        (-20.0, (-0.006,)),
    ],
)
def test_irises_go_up_and_down_with_the_eyes_and_lids_with_them(face, up, heights):
    angle = math.radians(up)
    for height in heights:
        # A disc that is seen from above or below.
        off = (height - EYEBALL * math.sin(angle)) / math.cos(angle)
        expected = 2.0 * PIXELS * math.sqrt(IRIS**2 - off**2)
        # A pixel at each rim.
        assert widths(height, *face, left_eye=(-up, 0.0)) == pytest.approx([expected] * 2, abs=2.0)
