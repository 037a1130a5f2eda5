"""``crowd list``: the scenarios that come with the engine."""

from rich.console import Console
from rich.table import Table

from crowd.scenario import bundled_scenarios, load_scenario


def print_scenarios() -> None:
    """Print a table of names, people, run times and descriptions."""
    table = Table(box=None, pad_edge=False)
    table.add_column("scenario", no_wrap=True)
    table.add_column("people", justify="right", no_wrap=True)
    table.add_column("seconds", justify="right", no_wrap=True)
    table.add_column("what happens")
    for name in bundled_scenarios():
        scenario = load_scenario(name)
        table.add_row(name, str(scenario.character_count), f"{scenario.seconds:g}", scenario.description)
    Console().print(table)
