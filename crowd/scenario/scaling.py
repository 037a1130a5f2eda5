"""Change the number of people in a scenario."""

import math
from collections.abc import Sequence

from crowd.errors import ScenarioError, describe
from crowd.scenario.schema import Region, Scenario


def scaled(scenario: Scenario, characters: int) -> Scenario:
    """Change the number of people at the start: individuals stay, regions share the rest in proportion.

    Groups that stand around a circle do not grow beyond their own size.

    Raises
    ------
    ScenarioError
        More people are asked for than there are individuals, and there is no region to add them to.
    """
    if characters < 1:
        raise ScenarioError(describe("characters", "must be positive", characters, "at least 1"))
    individuals = scenario.characters[:characters]
    rest = characters - len(individuals)
    if rest and not scenario.regions:
        allowed = f"1 to {len(scenario.characters)} characters"
        where = scenario.source.label
        raise ScenarioError(
            describe(where, "has only individuals, no region to add people to", characters, allowed)
        )
    sizes = [region.count for region in scenario.regions]
    can_grow = [not _is_standing_group(region) for region in scenario.regions]
    if rest > sum(sizes) and any(can_grow):
        room = rest - sum(size for size, grows in zip(sizes, can_grow, strict=True) if not grows)
        grown = iter(shares(room, [size for size, grows in zip(sizes, can_grow, strict=True) if grows]))
        counts = [next(grown) if grows else size for size, grows in zip(sizes, can_grow, strict=True)]
    else:
        counts = shares(rest, sizes)
    regions = tuple(
        region.model_copy(update={"count": count})
        for region, count in zip(scenario.regions, counts, strict=True)
    )
    changed = scenario.model_copy(update={"characters": individuals, "regions": regions})
    changed._source = scenario.source
    return changed


def shares(total: int, sizes: Sequence[int]) -> list[int]:
    """Share a whole number in proportion to sizes; the largest remainders get what is left."""
    if not sizes:
        return []
    exact = [total * size / sum(sizes) for size in sizes]
    counts = [math.floor(share) for share in exact]
    by_remainder = sorted(range(len(sizes)), key=lambda index: (counts[index] - exact[index], index))
    for index in by_remainder[: total - sum(counts)]:
        counts[index] += 1
    return counts


def _is_standing_group(region: Region) -> bool:
    return region.circle is not None and not region.goals
