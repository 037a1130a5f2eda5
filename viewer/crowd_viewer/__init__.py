"""Placeholder package of the renderer."""
