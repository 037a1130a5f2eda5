"""Collect the furniture of a scenario: boxes with boards."""

import math

from crowd.scenario.schema import Scenario
from crowd.world.furniture import Furniture


def place_furniture(scenario: Scenario) -> tuple[Furniture, ...]:
    """Shelves, tables and seats that are always there, in the order of the file."""
    return tuple(
        Furniture(
            box.name or f"boxes[{index}]",
            box.x,
            box.z,
            box.boards,
            None if box.facing is None else math.radians(box.facing),
        )
        for index, box in enumerate(scenario.world.boxes)
        if box.boards and box.is_permanent
    )
