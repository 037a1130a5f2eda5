"""Compiled crowd kernels: pure functions over plain NumPy arrays, no engine, no files, no globals.

Set ``OMP_WAIT_POLICY=PASSIVE`` in the environment before the first parallel call when other programs share
the cores; this package leaves the environment to its user.
"""
