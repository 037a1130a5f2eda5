"""Motion that the engine makes for itself, from published gait data."""

from crowd.motion.procedural.library import built_in_library

__all__ = ["built_in_library"]
