"""SmartBody motions as text (.skm)."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NoReturn

import numpy as np

from crowd.motion.formats.smartbody_channels import CANONICAL_TYPE, CHANNEL_TYPES, Channel, ChannelData
from crowd.motion.formats.smartbody_skeleton import header_unit
from crowd.motion.formats.text import TextFile

WIDTHS = {"Quat": 3, "Swing": 2}
_HEADS = ("skmotion", "homotion", "knmotion")
_WORD = re.compile(r'"[^"]*"|\S+')
_RECORD = re.compile(r"\s*kt\s+(\S+)\s+fr\b(.*)", re.IGNORECASE)
_CONTINUED = re.compile(r"\s*[-+.0-9]")
_TAG = re.compile(r"\s*([^:]*[^:\s])\s*:\s*(.*?)\s*")
_SYNC_NAMES = {
    "ready": "ready",
    "strokestart": "strokeStart",
    "stroke_start": "strokeStart",
    "emphasis": "emphasis",
    "stroke_emphasis": "emphasis",
    "stroke": "stroke",
    "strokeend": "stroke",
    "stroke_end": "stroke",
    "relax": "relax",
}


def read_skm(path: Path) -> ChannelData:
    """Read a .skm file, to be applied to its skeleton.

    Raises
    ------
    MotionError
        The file is broken; names the line.
    """
    return _Reader(path).read()


class _Reader:
    """The lines of a file without comments, and how far they are read."""

    def __init__(self, path: Path) -> None:
        self.text = TextFile(path)
        stripped = ((number, line.partition("#")[0]) for number, line in enumerate(self.text.lines, 1))
        self.lines = [(number, line) for number, line in stripped if line.strip()]
        self.at = 0
        self.name = path.stem
        self.channels: list[Channel] | None = None
        self.start: float | None = None

    def read(self) -> ChannelData:
        """Read the whole file."""
        text = self.text
        declared, line = self._read_header()
        channels = self.channels
        if not channels:
            text.fail(line, "has no channels")
        width = 1 + sum(WIDTHS.get(kind, 1) for _, kind in channels)
        rows, numbers = self._read_records()
        if not rows:
            text.fail(line, "holds no frames")
        if abs(declared - len(rows)) > 1:
            text.fail(line, f"frames {declared}, but {len(rows)} records follow")
        table = text.table(rows, numbers, width, "a record, time included,")
        times = table[:, 0]
        if self.start is not None:
            times = times - times[0] + self.start

        def fail_at_frame(frame: int, what: str) -> NoReturn:
            text.fail(numbers[frame], what)

        return ChannelData(
            text.path,
            self.name,
            channels,
            WIDTHS,
            np.ascontiguousarray(times),
            table[:, 1:],
            header_unit(text),
            tuple(self._read_tags()),
            fail_at_frame,
        )

    def _next(self, what: str) -> tuple[int, str]:
        if self.at >= len(self.lines):
            self.text.fail(len(self.text.lines), f"ends where {what} should follow")
        self.at += 1
        return self.lines[self.at - 1]

    def _read_header(self) -> tuple[int, int]:
        """Read up to ``frames``; gives the declared number and its line."""
        line, content = self._next("SkMotion")
        words = _WORD.findall(content)
        if words[0].lower() not in _HEADS:
            self.text.fail(line, "a motion starts with SkMotion", words[0])
        words = words[1:]
        while True:
            if not words:
                line, content = self._next("frames")
                words = _WORD.findall(content)
            key = words.pop(0)
            if not words:
                self.text.fail(line, "a value should follow", key)
            value = words.pop(0)
            match key.lower():
                case "name":
                    self.name = value.strip('"') or self.name
                case "channels":
                    self._read_channels(self.text.integer(value, line, "channels"), line)
                case "start_kt":
                    self.start = self.text.number(value, line, "start_kt")
                case "frames":
                    return self.text.integer(value, line, "frames"), line
                case _:
                    self.text.fail(line, "unknown word", key, "name, channels, start_kt, frames")

    def _read_channels(self, count: int, line: int) -> None:
        if self.channels is not None:
            self.text.fail(line, "channels are listed twice")
        self.channels = []
        known: set[Channel] = set()
        for _ in range(count):
            line, content = self._next("a channel")
            joint, _, kind = content.strip().rpartition(" ")
            joint, _, kind = (joint, "", kind) if joint else content.strip().rpartition("\t")
            if kind.lower() not in CANONICAL_TYPE or not joint.strip():
                self.text.fail(line, "unknown channel", content.strip(), ", ".join(CHANNEL_TYPES))
            channel = (joint.strip().strip('"'), CANONICAL_TYPE[kind.lower()])
            if channel in known:
                self.text.fail(line, "a channel is listed twice", " ".join(channel))
            known.add(channel)
            self.channels.append(channel)

    def _read_records(self) -> tuple[list[str], list[int]]:
        """Time and values of each record as text, and the lines where they start."""
        rows: list[str] = []
        numbers: list[int] = []
        parts: list[str] = []
        while self.at < len(self.lines):
            number, content = self.lines[self.at]
            record = _RECORD.fullmatch(content)
            if record:
                if parts:
                    rows.append(" ".join(parts))
                parts = [record.group(1), record.group(2)]
                numbers.append(number)
            elif parts and _CONTINUED.match(content):
                parts.append(content)
            else:
                break
            self.at += 1
        if parts:
            rows.append(" ".join(parts))
        return rows, numbers

    def _read_tags(self) -> list[tuple[str, float]]:
        """Named times after the records; missing ones are stated as negative."""
        tags: list[tuple[str, float]] = []
        for line, content in self.lines[self.at :]:
            found = _TAG.fullmatch(content)
            if not found:
                self.text.fail(line, 'a record or "name: value" should stand here', content.strip())
            name, value = found.groups()
            base = re.sub(r"(?i)(\s+|(?<=[a-z]))time$", "", name)
            if base.lower() in _SYNC_NAMES:
                name = _SYNC_NAMES[base.lower()]
            elif base != name and name[-5].isspace():
                name = base
            else:
                try:
                    float(value)
                except ValueError:
                    continue  # Free metadata that is no time.
            time = self.text.number(value, line, "a time")
            if time >= 0.0:
                tags.append((name, time))
        return tags
