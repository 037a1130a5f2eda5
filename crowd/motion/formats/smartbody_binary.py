"""SmartBody motions as protocol-buffer messages (.skmb)."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

import numpy as np

from crowd.errors import MotionError, describe
from crowd.motion.formats.smartbody_channels import CHANNEL_TYPES, SYNC_POINTS, Channel, ChannelData
from crowd.motion.formats.text import MAXIMUM_NUMBER, read_bytes
from crowd.motion.source import FloatArray

WIDTHS = {"Quat": 4, "Swing": 2}
NAME, CHANNEL_COUNT, JOINT, TYPE, FRAME_COUNT, TIME, VALUE, SYNC, METADATA = range(1, 10)
METADATA_NAME, METADATA_VALUE = 1, 2
VARINT, FIXED_64, BYTES, FIXED_32 = 0, 1, 2, 5
_LONGEST_VARINT = 10
_FIRST_RUN = 16


@dataclass
class Message:
    """Fields of a message by number: integers, byte strings, and four-byte numbers in arrays."""

    integers: dict[int, list[int]] = field(default_factory=dict)
    strings: dict[int, list[bytes]] = field(default_factory=dict)
    floats: dict[int, list[FloatArray]] = field(default_factory=dict)

    def integer(self, number: int) -> int:
        """Last value of a field that stands once; 0 when it is missing."""
        return self.integers.get(number, [0])[-1]

    def all_floats(self, number: int) -> FloatArray:
        """Values of a repeated field, one by one or packed."""
        packed = [_as_floats(content[: len(content) // 4 * 4]) for content in self.strings.get(number, [])]
        return np.concatenate([np.empty(0), *self.floats.get(number, []), *packed])


def read_skmb(path: Path) -> ChannelData:
    """Read a .skmb file, to be applied to its skeleton.

    Raises
    ------
    MotionError
        The file is broken; names the byte where the message breaks off, or the field that is wrong.
    """
    content = read_bytes(path)
    message = _Parser(path, content).read()
    channels = _channels(path, message)
    times, flat = message.all_floats(TIME), message.all_floats(VALUE)
    width = sum(WIDTHS.get(kind, 1) for _, kind in channels)
    declared = message.integer(FRAME_COUNT)
    if len(times) == 0:
        _fail(path, "holds no frames")
    if abs(declared - len(times)) > 1:
        _fail(path, f"declares {declared} frames, but holds {len(times)} key times")
    if len(flat) != len(times) * width:
        _fail(path, f"{len(times)} frames of {width} values need {len(times) * width}", len(flat))
    for what, values in (("key times", times), ("values", flat)):
        if not (np.abs(values) <= MAXIMUM_NUMBER).all():
            place = int(np.argmin(np.abs(values) <= MAXIMUM_NUMBER))
            _fail(path, f"number {place} of the {what} is no finite number", float(values[place]))

    def fail_at_frame(frame: int, what: str) -> NoReturn:
        _fail(path, f"frame {frame}: {what}")

    name = _text(message.strings.get(NAME, [b""])[-1]) or path.stem
    table = flat.reshape(len(times), width)
    return ChannelData(path, name, channels, WIDTHS, times, table, None, _tags(path, message), fail_at_frame)


def _fail(path: Path, what: str, got: object = None) -> NoReturn:
    raise MotionError(describe(str(path), what, got))


def _text(content: bytes) -> str:
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def _channels(path: Path, message: Message) -> list[Channel]:
    joints = [_text(content) for content in message.strings.get(JOINT, [])]
    types = list(message.integers.get(TYPE, []))
    for packed in message.strings.get(TYPE, []):
        types += packed  # Types are below 128: a byte each.
    declared = message.integer(CHANNEL_COUNT)
    if not joints or not declared == len(joints) == len(types):
        _fail(path, f"declares {declared} channels", f"{len(joints)} joints and {len(types)} types")
    for kind in types:
        if not 0 <= kind < len(CHANNEL_TYPES):
            _fail(path, f"unknown type of channel, allowed 0 to {len(CHANNEL_TYPES) - 1}", kind)
    channels = [(joint, CHANNEL_TYPES[kind]) for joint, kind in zip(joints, types, strict=True)]
    if len(set(channels)) != len(channels):
        twice = next(channel for channel in channels if channels.count(channel) > 1)
        _fail(path, "a channel is listed twice", " ".join(twice))
    return channels


def _tags(path: Path, message: Message) -> tuple[tuple[str, float], ...]:
    """Sync points between start and stop, and named values; missing ones are negative."""
    named = list(zip(SYNC_POINTS, message.all_floats(SYNC).tolist(), strict=False))[1:-1]
    for content in message.strings.get(METADATA, []):
        entry = _Parser(path, content).read()
        names, values = entry.strings.get(METADATA_NAME, []), entry.all_floats(METADATA_VALUE)
        if names and len(values):
            named.append((_text(names[-1]), float(values[-1])))
    return tuple((name, time) for name, time in named if 0.0 <= time <= MAXIMUM_NUMBER)


def _as_floats(content: bytes) -> FloatArray:
    with np.errstate(invalid="ignore"):  # Some bytes are no numbers; these are found later.
        return np.frombuffer(content, "<f4").astype(np.float64)


class _Parser:
    """Splits a message into fields."""

    def __init__(self, path: Path, content: bytes) -> None:
        self.path = path
        self.content = content
        self.at = 0

    def read(self) -> Message:
        """Read all fields."""
        message = Message()
        while self.at < len(self.content):
            start = self.at
            key = self._varint()
            number, kind = key >> 3, key & 7
            if number == 0:
                self._fail(start)
            if kind == VARINT:
                message.integers.setdefault(number, []).append(self._varint())
            elif kind == BYTES:
                message.strings.setdefault(number, []).append(self._take(self._varint()))
            elif kind == FIXED_32:
                message.floats.setdefault(number, []).append(self._run(start))
            elif kind == FIXED_64:
                self._take(8)
            else:
                self._fail(start)
        return message

    def _fail(self, at: int) -> NoReturn:
        raise MotionError(describe(f"{self.path}: byte {at}", "is no SmartBody message, or is cut short"))

    def _take(self, size: int) -> bytes:
        if self.at + size > len(self.content):
            self._fail(self.at)
        self.at += size
        return self.content[self.at - size : self.at]

    def _varint(self) -> int:
        value, place, start = 0, 0, self.at
        while True:
            byte = self._take(1)[0]
            value |= (byte & 0x7F) << (7 * place)
            place += 1
            if byte < 0x80:
                return value
            if place == _LONGEST_VARINT:
                self._fail(start)

    def _run(self, start: int) -> FloatArray:
        """Four-byte numbers that follow each other under the same key, which starts at `start`."""
        key = np.frombuffer(self.content[start : self.at], np.uint8)
        size = len(key) + 4
        count, looked = 1, _FIRST_RUN
        self._take(4)
        # Look twice as far each time: all at once would read the rest of the file for every short run.
        while True:
            end = start + size * min(count + looked, (len(self.content) - start) // size)
            rows = np.frombuffer(self.content[start + size * count : end], np.uint8).reshape(-1, size)
            equal = (rows[:, : len(key)] == key).all(axis=1)
            same = len(rows) if equal.all() else int(np.argmin(equal))
            count += same
            if same < looked:
                break
            looked *= 2
        self.at = start + size * count
        rows = np.frombuffer(self.content[start : self.at], np.uint8).reshape(-1, size)
        return _as_floats(rows[:, len(key) :].tobytes())
