"""Skins and limbs of one shape look alike, whatever the level, and a wrong pose is seen in the picture."""

import importlib.util
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

SIZE = (640, 360)
FOLDER = Path(__file__).parent


def load(name):
    spec = importlib.util.spec_from_file_location(name, FOLDER / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def tubes(drawing, walkers):
    from crowd_viewer.bodies import Body, simple_limbs

    limbs = simple_limbs(walkers.model.skeleton)
    tube_mesh = load("tube_body").tube_mesh
    return Body(tuple(tube_mesh(limbs, around) for around in (24, 16, 10)), limbs)


def renderer_of(source, quality, bodies=None):
    from crowd_viewer.context import headless_context
    from crowd_viewer.renderer import Renderer

    return Renderer(headless_context(), source.scene, SIZE, quality, bodies)


@pytest.mark.parametrize("level", [0, 1, 2])
def test_a_skin_of_tubes_covers_the_pixels_of_the_limbs(drawing, walkers, close_camera, tubes, level):
    from crowd_viewer.frame import source_of

    source, camera = source_of(walkers), close_camera[1]
    heights = [1e9 if k < level else 0.0 for k in range(5)]
    skins = replace(drawing.FINE, least_height=tuple(heights), shadow_size=0)
    limbs = replace(drawing.FINE, least_height=(1e9, 1e9, 1e9, 0.0, 0.0), shadow_size=0)
    with renderer_of(source, skins, (tubes, tubes, tubes)) as renderer:
        seen, depth = renderer.identities(source.frame(), camera)
        counts = renderer.people.counts()
    with renderer_of(source, limbs, (tubes, tubes, tubes)) as renderer:
        expected, expected_depth = renderer.identities(source.frame(), camera)
    assert counts[level] == sum(counts) > 3
    # The coarse tubes have ten corners: some pixels along every rim differ.
    assert (seen != expected).mean() < 0.012
    both = (seen == expected) & (seen > 0)

    assert np.median(np.abs(depth[both] - expected_depth[both])) < 0.01


def test_skins_in_every_level_and_build_are_drawn_once(drawing, walkers, tubes):
    from crowd_viewer.frame import source_of

    source = source_of(walkers)
    quality = replace(drawing.FINE, least_height=(60.0, 45.0, 35.0, 25.0, 20.0))
    camera = drawing.Camera((0.0, 6.0, 22.0), (0.0, 0.5, 0.0))
    with renderer_of(source, quality, (tubes, tubes)) as renderer:
        seen, _ = renderer.identities(source.frame(), camera)
        counts = renderer.people.counts()
        renderer.draw(source.frame(), camera, keeps_levels=False)
        picture = renderer.picture()
    assert min(counts) > 0
    with renderer_of(source, replace(quality, least_height=(0.0,) * 5), (tubes, tubes)) as renderer:
        expected, _ = renderer.identities(source.frame(), camera)
        assert renderer.people.counts()[0] == sum(counts)
    assert (seen != expected).mean() < 0.006
    assert set(np.unique(seen)) == set(np.unique(expected))
    assert picture.std() > 15


def test_no_more_skins_are_drawn_than_allowed(drawing, walkers, tubes):
    from crowd_viewer.frame import source_of

    source = source_of(walkers)
    quality = replace(drawing.FINE, least_height=(0.5, 0.4, 0.3, 0.2, 0.1), mesh_count=7)
    with renderer_of(source, quality, (tubes,)) as renderer:
        renderer.draw(source.frame(), drawing.Camera((0.0, 6.0, 22.0), (0.0, 0.5, 0.0)))
        counts = renderer.people.counts()
    assert 0 < sum(counts[:3]) <= 7
    assert sum(counts) > 20


def block_difference(first, second):
    """Largest difference of the means of 8 by 8 pixels, and the mean difference."""
    rows, columns = (length // 8 * 8 for length in first.shape[:2])
    away = second[:rows, :columns].astype(float) - first[:rows, :columns]
    blocks = away.reshape(rows // 8, 8, columns // 8, 8, 3).mean(axis=(1, 3))
    return float(np.abs(blocks).max()), float(away.mean())


def bent(frame, skeleton, slot, angle):
    """The same frame with one left knee bent further."""
    position, rotation = frame.joint_position_model.copy(), frame.joint_rotation_model.copy()
    knee = skeleton.joint("left_shank")
    turn = np.array([np.cos(angle / 2), np.sin(angle / 2), 0.0, 0.0])
    for name in ("left_shank", "left_foot", "left_toe"):
        joint = skeleton.joint(name)
        away = position[slot, joint] - position[slot, knee]
        y, z = away[1], away[2]
        away[1], away[2] = np.cos(angle) * y - np.sin(angle) * z, np.sin(angle) * y + np.cos(angle) * z
        position[slot, joint] = position[slot, knee] + away
        w, x, y, z = rotation[slot, joint]
        c, s = turn[:2]
        rotation[slot, joint] = c * w - s * x, c * x + s * w, c * y - s * z, c * z + s * y
    return replace(frame, joint_position_model=position, joint_rotation_model=rotation)


def test_a_wrongly_bent_knee_is_seen_by_the_block_difference(drawing, walkers, close_camera):
    from crowd_viewer.frame import source_of

    chosen, camera = close_camera
    source = source_of(walkers)
    frame = source.frame()
    skeleton = walkers.model.skeleton
    with renderer_of(source, drawing.FINE) as renderer:

        def draw(shown, view):
            renderer.draw(shown, view, keeps_levels=False)
            return renderer.picture()

        right = draw(frame, camera)
        wrong = draw(bent(frame, skeleton, chosen, 0.6), camera)
        moved = draw(frame, camera.moved(np.array([0.002, 0.0, 0.0])))
    assert block_difference(right, wrong)[0] > 6.0
    block, mean = block_difference(right, moved)
    assert block < 6.0
    assert abs(mean) < 1.0


@pytest.mark.parametrize("level", range(4))
def test_levels_change_where_nobody_notices(drawing, walkers, close_camera, level):
    """At the height on the screen where one level takes over from the other both cover the same pixels."""
    from crowd_viewer.frame import source_of

    source, chosen = source_of(walkers), close_camera[0]
    height = drawing.FINE.least_height[level]
    place, yaw = walkers.state.position_world[chosen], float(walkers.state.yaw[chosen])
    far = drawing.Camera.around(place + [0.0, 0.9, 0.0], 10.0, yaw + 0.5, 0.3)
    away = 10.0 * far.pixels_at_one_metre(SIZE[1]) * float(source.scene.stature[chosen]) / (10.0 * height)
    camera = drawing.Camera.around(place + [0.0, 0.9, 0.0], away, yaw + 0.5, 0.3)
    covered = []
    for chosen_level in (level, level + 1):
        heights = tuple(1e9 if k < chosen_level else 0.0 for k in range(5))
        with renderer_of(source, replace(drawing.FINE, least_height=heights)) as renderer:
            seen, _ = renderer.identities(source.frame(), camera)
        covered.append(seen > 0)
    fine, coarse = covered
    # The smaller people are, the larger is the share of their rims.
    assert (fine & coarse).sum() > (0.93, 0.90, 0.72, 0.64)[level] * (fine | coarse).sum()


def test_strokes_have_the_colours_of_the_limbs_they_take_the_place_of(drawing, walkers):
    from crowd_viewer.frame import source_of

    source = source_of(walkers)
    camera = drawing.Camera((0.0, 25.0, 50.0), (0.0, 0.5, 0.0))
    pictures = []
    for heights in ((1e9,) * 5, (1e9,) * 4 + (0.0,), (1e9,) * 3 + (0.0,) * 2):
        quality = replace(drawing.FAST, least_height=heights, shadow_size=0)
        with renderer_of(source, quality) as renderer:
            renderer.draw(source.frame(), camera, keeps_levels=False)
            pictures.append(renderer.picture().astype(float))
            count = max(renderer.people.counts())
    strokes, few, whole = pictures
    assert count > 20
    people = np.abs(few - np.median(few, axis=(0, 1))).max(axis=2) > 40
    assert people.sum() > 100
    # Between strokes and few limbs less may change than between few limbs and all of them.
    assert block_difference(few, strokes)[0] < 1.2 * block_difference(whole, few)[0]
    assert abs(block_difference(few, strokes)[1]) < 0.3
