"""The world that people walk in."""

from crowd.world.world import World

__all__ = ["World"]
