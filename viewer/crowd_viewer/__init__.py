"""The renderer. This version holds no code yet; the engine runs without it."""
