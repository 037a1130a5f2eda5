"""Reciprocal avoidance by plain geometry: nearest points of drawn shapes, and optima among all corners."""

import itertools

import numpy as np


def cross(a, b):
    """z component of the cross product of two vectors of the plane."""
    return a[0] * b[1] - a[1] * b[0]


def smallest_change(offset, relative_velocity, radius_sum, horizon):
    """Smallest change that brings a relative velocity to the boundary of a velocity obstacle.

    The obstacle of two bodies apart is bounded by the near arc of a circle around offset / horizon and by two
    rays that start where the tangents from the origin touch that circle.
    """
    offset, velocity = np.asarray(offset, float), np.asarray(relative_velocity, float)
    centre, size = offset / horizon, radius_sum / horizon
    distance = np.linalg.norm(offset)
    if distance <= radius_sum:
        away = velocity - centre
        return (size / np.linalg.norm(away) - 1.0) * away
    half_angle = np.arcsin(radius_sum / distance)
    middle = np.arctan2(offset[1], offset[0])
    reach = np.sqrt(distance**2 - radius_sum**2) / horizon
    candidates = []
    for side in (-1.0, 1.0):
        direction = np.array([np.cos(middle + side * half_angle), np.sin(middle + side * half_angle)])
        candidates.append(direction * max(velocity @ direction, reach))
    away = velocity - centre
    on_circle = centre + size * away / np.linalg.norm(away)
    # The near arc is what the origin sees: between the two tangent points.
    if (on_circle - centre) @ -offset >= size * radius_sum - 1e-15:
        candidates.append(on_circle)
    nearest = min(candidates, key=lambda point: np.linalg.norm(point - velocity))
    return nearest - velocity


def is_admissible(lines, velocity, slack):
    """Tell whether a velocity lies on the left of all lines."""
    return all(cross(line[2:], velocity - line[:2]) >= -slack for line in lines)


def corner_points(lines, speed):
    """All points where an optimum can lie: crossings of lines with each other and with the speed circle."""
    points = []
    for first, second in itertools.combinations(lines, 2):
        sine = cross(first[2:], second[2:])
        if abs(sine) > 1e-9:
            share = cross(second[:2] - first[:2], second[2:]) / sine
            points.append(first[:2] + share * first[2:])
    for line in lines:
        middle = -line[:2] @ line[2:]
        squared = middle**2 + speed**2 - line[:2] @ line[:2]
        if squared >= 0:
            points += [line[:2] + (middle + sign * np.sqrt(squared)) * line[2:] for sign in (-1, 1)]
    return points


def nearest_admissible(lines, speed, preferred, slack=1e-9):
    """Best velocity by trying every candidate, or None when no velocity is admissible."""
    preferred = np.asarray(preferred, float)
    length = np.linalg.norm(preferred)
    points = [preferred if length <= speed else preferred * speed / length]
    points += [line[:2] + ((preferred - line[:2]) @ line[2:]) * line[2:] for line in lines]
    points += corner_points(lines, speed)
    fitting = [p for p in points if np.linalg.norm(p) <= speed + slack and is_admissible(lines, p, slack)]
    return min(fitting, key=lambda p: np.linalg.norm(p - preferred)) if fitting else None


def least_violation(lines, hard_count, speed, samples=400):
    """Smallest possible largest violation of the soft lines, over velocities that satisfy the rest."""
    axis = np.linspace(-speed, speed, samples)
    x, z = (a.ravel() for a in np.meshgrid(axis, axis))
    fits = x**2 + z**2 <= speed**2
    worst = np.full(x.shape, -np.inf)
    for index, (px, pz, dx, dz) in enumerate(lines):
        violation = dx * (pz - z) - dz * (px - x)
        if index < hard_count:
            fits &= violation <= 0.0
        else:
            worst = np.maximum(worst, violation)
    return worst[fits].min() if fits.any() else None
