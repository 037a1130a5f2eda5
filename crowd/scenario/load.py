"""Find and read scenarios: bundled names, TOML files and SteerBench XML."""

import os
import re
import tomllib
import types
from collections.abc import Mapping
from functools import partial
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel, TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from crowd.errors import ScenarioError, describe, nearest_first
from crowd.scenario.checks import check
from crowd.scenario.schema import Scenario
from crowd.scenario.source import Location, Problems, ScenarioSource
from crowd.scenario.steerbench import read_steerbench
from crowd.scenario.task_table import ALTERNATIVES, TaskTable
from crowd.scenario.toml_lines import key_lines

SHOWN_INPUT = 60

# pydantic's error type: what is wrong, and what is allowed with the error's context filled in.
PHRASES = {
    "missing": ("is missing", None),
    "finite_number": ("must be finite", "a number"),
    "float_type": ("must be a number", "a number"),
    "float_parsing": ("must be a number", "a number"),
    "int_type": ("must be a whole number", "a whole number"),
    "int_parsing": ("must be a whole number", "a whole number"),
    "int_from_float": ("must be a whole number", "a whole number"),
    "string_type": ("must be text", "text in quotes"),
    "bool_type": ("must be true or false", "true or false"),
    "bool_parsing": ("must be true or false", "true or false"),
    "tuple_type": ("must be a list", "[...]"),
    "list_type": ("must be a list", "[...]"),
    "dict_type": ("must be a table", "a table of keys"),
    "model_type": ("must be a table", "a table of keys"),
    "model_attributes_type": ("must be a table", "a table of keys"),
    "greater_than": ("is out of range", "> {gt:g}"),
    "greater_than_equal": ("is out of range", ">= {ge:g}"),
    "less_than": ("is out of range", "< {lt:g}"),
    "less_than_equal": ("is out of range", "<= {le:g}"),
    "too_short": ("has too few items", "at least {min_length}"),
    "too_long": ("has too many items", "at most {max_length}"),
    "literal_error": ("is not one of the choices", "{expected}"),
}


def bundled_scenarios() -> dict[str, Path]:
    """Names of the scenarios that come with the engine, with their files."""
    folder = Path(str(resources.files("crowd") / "scenarios"))
    return {path.stem: path for path in sorted(folder.glob("*.toml"))}


def load_scenario(name_or_path: str | os.PathLike[str]) -> Scenario:
    """Read a scenario.

    Parameters
    ----------
    name_or_path : str or path
        Name of a bundled scenario such as ``"plaza"``, a ``.toml`` file, or a SteerBench ``.xml`` file.

    Returns
    -------
    Scenario
        Complete and consistent: what is left to find out needs random starts and routes (see `place`).

    Raises
    ------
    ScenarioError
        With one line for each problem: file, line, key, what was found and what is allowed.
    """
    path = find_scenario(name_or_path)
    scenario = read_steerbench(path) if path.suffix.lower() == ".xml" else read_toml(path)
    check(scenario)
    return scenario


def find_scenario(name_or_path: str | os.PathLike[str]) -> Path:
    """Find the file of a scenario by bundled name or path.

    Raises
    ------
    ScenarioError
        There is neither such a name nor such a file.
    """
    text = os.fspath(name_or_path)
    bundled = bundled_scenarios()
    if text in bundled:
        return bundled[text]
    path = Path(text)
    if path.suffix.lower() in (".toml", ".xml"):
        if path.is_file():
            return path
        raise ScenarioError(
            describe(text, "no such file", allowed=f"a file, or {nearest_first(path.stem, bundled)}")
        )
    if path.exists():
        raise ScenarioError(
            describe(text, "is not a scenario file", path.suffix or "no ending", ".toml or .xml")
        )
    raise ScenarioError(
        describe("scenario", "unknown name", text, f"a .toml or .xml file, or {nearest_first(text, bundled)}")
    )


def read_text(path: Path) -> str:
    """Read a whole text file.

    Raises
    ------
    ScenarioError
        It cannot be read, or is not UTF-8.
    """
    try:
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise ScenarioError(describe(str(path), "cannot be read", error.strerror or str(error))) from error
    except UnicodeDecodeError as error:
        raise ScenarioError(
            describe(
                str(path), "is not text", f"byte {error.object[error.start]:#04x} at {error.start}", "UTF-8"
            )
        ) from error


def read_toml(path: Path) -> Scenario:
    """Read a TOML scenario without the checks that concern several tables at once.

    Raises
    ------
    ScenarioError
        The text is not TOML, or a table is not as `Scenario` describes it.
    """
    text = read_text(path)
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ScenarioError(_toml_problem(path, str(error))) from error
    source = ScenarioSource(path.name, text, path.parent, partial(key_lines, text))
    content.setdefault("name", path.stem)
    return scenario_from(content, source)


def scenario_from(content: Mapping[str, Any], source: ScenarioSource) -> Scenario:
    """Validate the content of a scenario.

    Parameters
    ----------
    content : mapping
        As in a TOML file.
    source : ScenarioSource
        Used in messages.

    Raises
    ------
    ScenarioError
        With a line for each key that is wrong.
    """
    try:
        scenario = Scenario.model_validate(content)
    except ValidationError as error:
        problems = Problems(source)
        for details in error.errors(include_url=False):
            _add_problem(problems, details)
        problems.raise_if_any()
        raise
    scenario._source = source
    return scenario


def read_tasks(entries: object, source: ScenarioSource) -> tuple[TaskTable, ...]:
    """Check tasks as in a scenario file.

    Parameters
    ----------
    entries : sequence of mapping or TaskTable
    source : ScenarioSource
        Used in messages.

    Raises
    ------
    ScenarioError
        With a line for each key that is wrong.
    """
    try:
        return TypeAdapter(tuple[TaskTable, ...]).validate_python(entries)
    except ValidationError as error:
        problems = Problems(source)
        for details in error.errors(include_url=False):
            _add_problem(problems, details, TaskTable)
        problems.raise_if_any()
        raise


def _toml_problem(path: Path, message: str) -> str:
    """Turn ``Expected '=' after a key (at line 3, column 5)`` into the form of all messages."""
    match = re.search(r"\s*\(at (?:line (\d+), column (\d+)|end of document)\)$", message)
    if match is None:
        return describe(path.name, "is not TOML", message)
    place = f"line {match[1]}, column {match[2]}" if match[1] else "end of file"
    return describe(f"{path.name}: {place}", "is not TOML", message[: match.start()])


def _shown(value: object) -> object:
    """Form a value the way a TOML file writes it, short enough for one line."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Mapping):
        return "a table"
    if isinstance(value, int | float) or value is None:
        return value
    text = value if isinstance(value, str) else str(list(value) if isinstance(value, tuple) else value)
    text = text if len(text) <= SHOWN_INPUT else text[:SHOWN_INPUT] + "..."
    return text if isinstance(value, str) else _Verbatim(text)


class _Verbatim:
    """Text that is shown without quotes."""

    def __init__(self, text: str) -> None:
        self._text = text

    def __str__(self) -> str:
        return self._text


def _add_problem(problems: Problems, details: ErrorDetails, model: type[BaseModel] = Scenario) -> None:
    """Turn one of pydantic's errors into a line of ours."""
    location: Location = tuple(part for part in details["loc"] if part not in ALTERNATIVES)
    kind, context = details["type"], details.get("ctx", {})
    if kind == "extra_forbidden":
        known = _known_keys(location[:-1], model)
        problems.add(location, "unknown key", allowed=nearest_first(str(location[-1]), known))
        return
    if kind == "scenario":
        key = context.get("key")
        got = context.get("got")
        where = (*location, key) if key else location
        problems.add(where, context["text"], got, context.get("allowed"))
        return
    got = None if kind == "missing" else _shown(details["input"])
    what, allowed = PHRASES.get(kind, (details["msg"], None))
    problems.add(location, what, got, allowed.format(**context) if allowed else None)


def _known_keys(location: Location, root: type[BaseModel]) -> list[str]:
    """Keys of the table at a location of the schema."""
    model: type[BaseModel] | None = root
    for part in location:
        if isinstance(part, int) or model is None:
            continue
        found = model.model_fields.get(part)
        model = _model_in(found.annotation) if found is not None else None
    return list(model.model_fields) if model is not None else []


def _model_in(annotation: Any) -> type[BaseModel] | None:
    """First model that an annotation such as ``tuple[Goal, ...]`` or ``Area | None`` contains."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    if get_origin(annotation) in (tuple, list, dict, Union, types.UnionType, Annotated):
        for argument in get_args(annotation):
            model = _model_in(argument)
            if model is not None:
                return model
    return None
