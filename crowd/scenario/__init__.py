"""Scenarios: what the user wrote, read and checked, and the people placed in it."""

from crowd.scenario.load import bundled_scenarios, load_scenario
from crowd.scenario.placement import PlacedCharacters, PlacedFlow, place
from crowd.scenario.schema import Scenario

__all__ = ["PlacedCharacters", "PlacedFlow", "Scenario", "bundled_scenarios", "load_scenario", "place"]
