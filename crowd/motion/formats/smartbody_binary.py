"""SKMB of SmartBody: the same motion as SKM in a protocol buffer message."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from crowd.errors import MotionError, describe
from crowd.motion.formats.smartbody import (
    SYNC_POINTS,
    WIDTHS,
    Channel,
    frame_rate_of,
    place_values,
    read_sk,
)
from crowd.motion.formats.text import read_bytes
from crowd.motion.source import SourceMotion

KINDS = ("XPos", "YPos", "ZPos", "XRot", "YRot", "ZRot", "Quat", "Swing", "Twist")
VARINT, FIXED_64, BYTES, FIXED_32 = 0, 1, 2, 5
NAME, JOINTS, TYPES, FRAMES, TIMES, VALUES, SYNC = 1, 3, 4, 5, 6, 7, 8
SYNC_COUNT = 7
"""start, ready, strokeStart, emphasis, stroke, relax, stop."""


@dataclass
class _Message:
    joints: list[str] = field(default_factory=list)
    types: list[int] = field(default_factory=list)
    frames: int = 0
    times: list[bytes] = field(default_factory=list)
    values: list[bytes] = field(default_factory=list)
    sync: list[bytes] = field(default_factory=list)


def _fields(content: bytes, path: Path) -> Iterator[tuple[int, int, bytes | int]]:
    """Field number, wire type and content of a message, with checked lengths."""
    at, end = 0, len(content)

    def varint() -> int:
        nonlocal at
        result = shift = 0
        while True:
            if at >= end or shift > 63:
                raise MotionError(describe(f"{path}: byte {at}", "is no SKMB motion, or cut short"))
            byte = content[at]
            at += 1
            result |= (byte & 0x7F) << shift
            if byte < 0x80:
                return result
            shift += 7

    while at < end:
        key = varint()
        number, kind = key >> 3, key & 7
        if kind == VARINT:
            yield number, kind, varint()
            continue
        size = {FIXED_64: 8, FIXED_32: 4}.get(kind, -1)
        if kind == BYTES:
            size = varint()
        if size < 0 or at + size > end or number == 0:
            raise MotionError(describe(f"{path}: byte {at}", "is no SKMB motion, or cut short"))
        yield number, kind, content[at : at + size]
        at += size


def _read_message(path: Path) -> _Message:
    message = _Message()
    for number, kind, content in _fields(read_bytes(path), path):
        if number == JOINTS and isinstance(content, bytes):
            message.joints.append(content.decode("utf-8", errors="replace"))
        elif number == TYPES and isinstance(content, int):
            message.types.append(content)
        elif number == TYPES and isinstance(content, bytes):
            message.types.extend(content)
        elif number == FRAMES and isinstance(content, int):
            message.frames = content
        elif number in (TIMES, VALUES, SYNC) and isinstance(content, bytes) and kind in (BYTES, FIXED_32):
            {TIMES: message.times, VALUES: message.values, SYNC: message.sync}[number].append(content)
    return message


def _floats(parts: list[bytes], path: Path) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    content = b"".join(parts)
    if len(content) % 4:
        raise MotionError(describe(str(path), "a list of numbers is cut short"))
    values = np.array(struct.unpack(f"<{len(content) // 4}f", content), np.float64)
    if not np.isfinite(values).all():
        raise MotionError(describe(str(path), "a value is no finite number"))
    return values


def read_channels(path: Path) -> tuple[Channel, ...]:
    """Read the channels of an SKMB file.

    Raises
    ------
    MotionError
        The file is broken; the byte is named.
    """
    message = _read_message(path)
    if len(message.joints) != len(message.types) or not message.joints:
        told = f"{len(message.joints)} joints, {len(message.types)} types"
        raise MotionError(describe(str(path), "joints and types of channels differ in number", told))
    for kind in message.types:
        if kind >= len(KINDS):
            raise MotionError(describe(str(path), "unknown channel", kind, f"0 to {len(KINDS) - 1}"))
    return tuple(
        Channel(joint, KINDS[kind]) for joint, kind in zip(message.joints, message.types, strict=True)
    )


def read_skmb(path: Path, skeleton_path: Path) -> SourceMotion:
    """Read an SKMB motion on an SK skeleton.

    Parameters
    ----------
    path, skeleton_path : Path

    Raises
    ------
    MotionError
        A file is broken, or motion and skeleton have no joint in common.
    """
    channels = read_channels(path)
    message = _read_message(path)
    time, flat = _floats(message.times, path), _floats(message.values, path)
    width = sum(4 if channel.kind == "Quat" else WIDTHS[channel.kind] for channel in channels)
    if len(time) == 0 or abs(message.frames - len(time)) > 1:
        told = f"{message.frames} declared, {len(time)} times"
        raise MotionError(describe(str(path), "count of frames does not fit", told))
    if flat.size != len(time) * width:
        told = f"{len(time)} frames of {width}"
        raise MotionError(describe(str(path), "wrong count of numbers", flat.size, told))
    sk = read_sk(skeleton_path)
    rotation, position = place_values(sk, channels, flat.reshape(len(time), width), path)
    sync = _floats(message.sync, path)[:SYNC_COUNT]
    named = zip(SYNC_POINTS, sync[1:-1].tolist(), strict=False) if len(sync) == SYNC_COUNT else ()
    tags = tuple((name, value) for name, value in named if value >= 0.0)
    return SourceMotion(
        path, path.stem, sk.skeleton, frame_rate_of(time, path), rotation, position, sk.metres_per_unit, tags
    )
