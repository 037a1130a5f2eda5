"""Trajectories of other programs and of observed people, with bodies that walk along them."""

from crowd.trajectories.files import load_trajectories
from crowd.trajectories.following import FollowingSimulation, record_bodies
from crowd.trajectories.opening import open_recording
from crowd.trajectories.trajectories import Trajectories, Way

__all__ = [
    "FollowingSimulation",
    "Trajectories",
    "Way",
    "load_trajectories",
    "open_recording",
    "record_bodies",
]
