"""Crowds of whole people.

>>> import crowd
>>> scenario = crowd.load_scenario("plaza")
>>> simulation = crowd.Simulation(scenario, seed=7)
>>> for frame in simulation.run(seconds=10): ...
"""

import os

# Threads that wait for work by spinning would take the core of a viewer or of a second run.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

