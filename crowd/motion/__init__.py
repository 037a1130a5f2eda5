"""Skeletons, clips and motion libraries, and the motion that the engine makes for itself."""
