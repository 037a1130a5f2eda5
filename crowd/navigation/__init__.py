"""Where people go: ways, way points, avoidance, right of way."""
