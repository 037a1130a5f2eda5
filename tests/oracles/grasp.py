"""Slow twins of the grasp kernels: distances by search along the segment, contacts by small steps."""

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation


def nearest_on_triangle(point, corners):
    """By the plane, or by the edges where the foot lies outside."""
    a, b, c = corners
    normal = np.cross(b - a, c - a)
    foot = point - normal * ((point - a) @ normal) / (normal @ normal)
    signs = [np.cross(q - p, foot - p) @ normal for p, q in ((a, b), (b, c), (c, a))]
    if min(signs) >= 0:
        return foot
    best = None
    for p, q in ((a, b), (b, c), (c, a)):
        share = np.clip((point - p) @ (q - p) / ((q - p) @ (q - p)), 0, 1)
        found = p + share * (q - p)
        if best is None or np.linalg.norm(point - found) < np.linalg.norm(point - best):
            best = found
    return best


def point_distance(point, kind, half, triangles=()):
    """Distance of a point to a shape in its own frame; kinds as in `crowd_kernels.capsule`."""
    if kind == 0:
        return np.linalg.norm(point) - half[0]
    if kind == 1:
        return np.linalg.norm(np.maximum(np.abs(point) - half, 0))
    if kind == 2:
        reach = half[1] - half[0]
        return np.linalg.norm(point - [0, np.clip(point[1], -reach, reach), 0]) - half[0]
    return min(np.linalg.norm(point - nearest_on_triangle(point, corners)) for corners in triangles)


def segment_distance(start, end, kind, half, triangles=()):
    """Least over the segment: convex for solids; triangle by triangle for meshes."""
    if kind == 3:
        return min(
            _along(start, end, lambda p, t=t: np.linalg.norm(p - nearest_on_triangle(p, t)))
            for t in triangles
        )
    return _along(start, end, lambda p: point_distance(p, kind, half))


def _along(start, end, distance):
    def at(share):
        return distance(start + share * (end - start))

    found = minimize_scalar(at, bounds=(0, 1), method="bounded", options={"xatol": 1e-10}).fun
    return min(found, at(0.0), at(1.0))


def rotation(quaternion):
    return Rotation.from_quat(np.asarray(quaternion)[[1, 2, 3, 0]])


def finger_ends(hand, side, style, scale, finger, closure, position, turned):
    """Ends of the axes of a finger's segments, (3, 2, 3)."""
    ends = np.zeros((3, 2, 3))
    place, frame = np.asarray(position, float), turned
    for part in range(3):
        row = 3 * finger + part
        place = place + frame.apply(scale * hand.offset[side, row])
        frame = frame * rotation(hand.open_rotation[style, side, row])
        frame = frame * Rotation.from_rotvec(closure[part] * hand.sweep[style, side, row])
        ends[part] = place, place + frame.apply(scale * hand.tip[side, row])
    return ends


def finger_gaps(hand, side, style, scale, finger, closure, position, turned, shape):
    """Gaps of a finger's segments to a shape (kind, half, triangles)."""
    ends = finger_ends(hand, side, style, scale, finger, closure, position, turned)
    return [
        segment_distance(*ends[part], *shape) - scale * hand.radius[3 * finger + part] for part in range(3)
    ]


def close_finger(hand, side, style, scale, finger, position, turned, shape, steps=2000):
    """Close in small steps; a segment that has entered takes back the step and locks with its parents."""
    closure, locked, contact = np.zeros(3), 0, np.zeros(3, int)
    for step in range(1, steps + 1):
        while locked < 3:
            tried = closure.copy()
            tried[locked:] = step / steps
            gaps = finger_gaps(hand, side, style, scale, finger, tried, position, turned, shape)
            inside = [part for part in range(locked, 3) if gaps[part] < 0]
            if not inside:
                closure = tried
                break
            contact[inside[-1]] = 1
            locked = inside[-1] + 1
    return closure, contact


def place_hand(hand, side, scale, kind, half, position, quaternion):
    """Place a hand on a sphere, box or capsule: position, rotation matrix, style, whether it is too big."""
    outward = 1.0 if side == 1 else -1.0
    frame = rotation(quaternion).as_matrix()
    back, fingers, thumb = outward * frame[:, 0], -frame[:, 1], frame[:, 2]
    palm = position + fingers * 0.5 * scale * (hand.nearest_grip + hand.farthest_grip)
    span, room, far = scale * hand.span_half, scale * hand.palm_half_width, scale * hand.farthest_grip
    middle, up, way = np.zeros(3), half[0], half[0]

    def limited(value, bound):
        return np.clip(value, -max(bound, 0), max(bound, 0))

    if kind == 2:
        axis = np.array([0, 1.0 if thumb[1] >= 0 else -1.0, 0])
        flat = back - back @ axis * axis
        if np.linalg.norm(flat) < 0.25:
            aside = np.cross(thumb, back) * outward
            flat = aside - aside @ axis * axis
        back = flat / np.linalg.norm(flat)
        fingers = np.cross(back, axis) * outward
        middle[1] = limited(palm[1], half[1] - half[0] - room)
    elif kind == 1:
        face = int(np.argmax(np.abs(back)))
        edges = [(face + 1) % 3, (face + 2) % 3]
        cost = [0.5 * half[e] / span + (half[e] > span) for e in edges]
        cost = [c + (half[e] < scale * hand.pinch_half) for c, e in zip(cost, edges[::-1], strict=True)]
        chosen = int(np.argmax([abs(fingers[e]) - c for e, c in zip(edges, cost, strict=True)]))
        edge, other = edges[chosen], edges[1 - chosen]
        middle[edge] = 0 if half[edge] <= span else limited(palm[edge], half[edge] - far)
        middle[other] = limited(palm[other], half[other] - room)
        back = np.eye(3)[face] * (1 if back[face] >= 0 else -1)
        fingers = np.eye(3)[edge] * (1 if fingers[edge] >= 0 else -1)
        up, way = half[face], half[edge]
    frame = np.stack([outward * back, -fingers, np.cross(outward * back, -fingers)], axis=1)
    if way <= scale * hand.pinch_half:
        held = middle + back * (up - min(up, 0.018))
        return held - frame @ (scale * hand.pinch_point[side]), frame, 1, False
    along = np.clip(scale * hand.thumb_clearance + way, scale * hand.nearest_grip, far)
    on_palm = np.array([-outward * scale * hand.palm_depth, -along, 0])
    return middle + back * (up + 5e-4) - frame @ on_palm, frame, 0, way > span
