"""Line numbers of the keys of a TOML text, which the standard library's parser does not report."""

import re
from bisect import bisect_right
from contextlib import suppress

from crowd.scenario.source import Location

BLANK = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
KEY_PART = re.compile(r"[ \t]*(?:\"((?:[^\"\\\n]|\\.)*)\"|'([^'\n]*)'|([A-Za-z0-9_-]+))[ \t]*")
SCALAR = re.compile(r"[^,\]}\n#]+")
STRINGS = ('"""', "'''", '"', "'")


class _Reader:
    """Walks a text that is known to be valid TOML and notes where each key and array item starts."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.place = 0
        self.line_starts = [0, *(match.end() for match in re.finditer("\n", text))]
        self.lines: dict[Location, int] = {}
        self.item_count: dict[Location, int] = {}

    def read(self) -> None:
        table: Location = ()
        while True:
            self._skip_blank()
            if self.place >= len(self.text):
                return
            if self.text.startswith("[[", self.place):
                table = self._table_header(is_array=True)
            elif self.text[self.place] == "[":
                table = self._table_header(is_array=False)
            else:
                self._pair(table)

    def _skip_blank(self) -> None:
        match = BLANK.match(self.text, self.place)
        assert match is not None
        self.place = match.end()

    def _note(self, location: Location) -> None:
        self.lines.setdefault(location, bisect_right(self.line_starts, self.place))

    def _key(self) -> tuple[str, ...]:
        parts: list[str] = []
        while True:
            match = KEY_PART.match(self.text, self.place)
            if match is None:
                raise ValueError("not a key")
            parts.append(next(group for group in match.groups() if group is not None))
            self.place = match.end()
            if not self.text.startswith(".", self.place):
                return tuple(parts)
            self.place += 1

    def _inside(self, names: tuple[str, ...], base: Location = ()) -> Location:
        """Locate a dotted name; within an array of tables that is its latest item."""
        location = base
        for name in names:
            location += (name,)
            if location in self.item_count:
                location += (self.item_count[location] - 1,)
        return location

    def _table_header(self, is_array: bool) -> Location:
        start = self.place
        self.place += 2 if is_array else 1
        names = self._key()
        end = self.place + (2 if is_array else 1)
        self.place = start
        location = self._inside(names[:-1])
        if is_array:
            location += (names[-1],)
            self._note(location)
            index = self.item_count.get(location, 0)
            self.item_count[location] = index + 1
            location += (index,)
        else:
            location = self._inside((names[-1],), location)
        self._note(location)
        self.place = end
        return location

    def _pair(self, table: Location) -> None:
        start = self.place
        names = self._key()
        after, self.place = self.place, start
        location = table
        for name in names:
            location += (name,)
            self._note(location)
        self.place = after + 1
        self._value(location)

    def _value(self, location: Location) -> None:
        self._skip_blank()
        opening = self.text[self.place]
        if opening == "[":
            self._items(location)
        elif opening == "{":
            self._inline_table(location)
        elif opening in "\"'":
            self._string()
        else:
            match = SCALAR.match(self.text, self.place)
            assert match is not None
            self.place = match.end()

    def _items(self, location: Location) -> None:
        self.place += 1
        index = 0
        while True:
            self._skip_blank()
            if self.text[self.place] == "]":
                self.place += 1
                return
            if self.text[self.place] == ",":
                self.place += 1
                continue
            self._note((*location, index))
            self._value((*location, index))
            index += 1

    def _inline_table(self, location: Location) -> None:
        self.place += 1
        while True:
            self._skip_blank()
            if self.text[self.place] == "}":
                self.place += 1
                return
            if self.text[self.place] == ",":
                self.place += 1
                continue
            self._pair(location)

    def _string(self) -> None:
        quote = next(q for q in STRINGS if self.text.startswith(q, self.place))
        self.place += len(quote)
        while not self.text.startswith(quote, self.place):
            self.place += 2 if quote[0] == '"' and self.text[self.place] == "\\" else 1
        self.place += len(quote)
        # A multi-line string may end with up to two quotes of its own.
        while len(quote) == 3 and self.text.startswith(quote[0], self.place):
            self.place += 1


def key_lines(text: str) -> dict[Location, int]:
    """Find the line of every key and array item.

    Parameters
    ----------
    text : str
        Valid TOML.

    Returns
    -------
    dict
        Location such as ``("regions", 2, "speed")`` to line, from 1. For text in an unforeseen form, what was
        found up to there.
    """
    reader = _Reader(text)
    with suppress(ValueError, IndexError, StopIteration):
        reader.read()
    return reader.lines
