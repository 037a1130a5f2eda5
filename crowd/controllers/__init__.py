"""The controller stack: layers that write the pose, in the papers' order.

All layers have the same parts in the same order: settings, state fields, `activate`, `evaluate`. A layer
runs over a compact list of the characters on which it is active and costs nothing for the others.
"""
