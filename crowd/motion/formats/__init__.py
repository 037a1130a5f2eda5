"""Readers of motion files: BVH, Acclaim, SmartBody and glTF, each in its own units and axes."""

from crowd.motion.formats.reading import EXTENSIONS, find_motion_files, read_motions

__all__ = ["EXTENSIONS", "find_motion_files", "read_motions"]
