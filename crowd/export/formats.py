"""The formats that recordings are exported to, by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from crowd.characters import Character
from crowd.errors import SettingsError, describe, nearest_first
from crowd.export.bodies import Bodies
from crowd.export.coco import PictureCamera
from crowd.export.selection import Selection

FORMATS: Mapping[str, str] = {
    "bvh": "a folder of BVH files, one for each person",
    "gltf": "a folder of animated skinned .glb files, one for each person",
    "usd": "one UsdSkel file with instanced people (.usdc, .usd or .usda)",
    "jupedsim": "one JuPedSim trajectory file (sqlite), which PedPy reads",
    "csv": "one table of t, id, x, y, yaw",
    "npz": "one file of NumPy arrays: joint positions and rotations",
    "coco": "one JSON file of keypoints seen from a camera",
}


@dataclass(frozen=True)
class ExportSettings:
    """What some formats need beyond the selection.

    Attributes
    ----------
    characters : sequence of Character
        Skinned characters for glTF and USD, given to people in turn; when empty, people keep those that they
        were recorded with, and the others get built-in bodies.
    camera : PictureCamera
        For COCO.
    """

    characters: Sequence[Character] = ()
    camera: PictureCamera = PictureCamera()  # noqa: RUF009 - a frozen value


def export(
    selection: Selection,
    format_name: str,
    out: Path,
    settings: ExportSettings | None = None,
    on_block: Callable[[float], None] = lambda frames: None,
) -> None:
    """Export part of a recording, frame block by frame block.

    Parameters
    ----------
    selection : Selection
    format_name : str
        One of `FORMATS`.
    out : Path
        File, or folder where there is one file a person.
    settings : ExportSettings, optional
    on_block : callable, optional
        Called with the number of frames after each block.

    Raises
    ------
    SettingsError
        The format is unknown, or needs something that is not installed.
    RecordingError
        A file cannot be read or written.
    """
    told = settings or ExportSettings()
    match format_name:
        case "bvh":
            from crowd.export.bvh import export_bvh

            export_bvh(selection, out, on_block)
        case "gltf":
            from crowd.export.gltf import export_gltf

            export_gltf(selection, out, on_block, Bodies(selection.recording, told.characters))
        case "usd":
            from crowd.export.usd import export_usd

            export_usd(selection, out, on_block, Bodies(selection.recording, told.characters))
        case "jupedsim":
            from crowd.export.jupedsim import export_jupedsim

            export_jupedsim(selection, out, on_block)
        case "csv":
            from crowd.export.tables import export_csv

            export_csv(selection, out, on_block)
        case "npz":
            from crowd.export.tables import export_npz

            export_npz(selection, out, on_block)
        case "coco":
            from crowd.export.coco import export_coco

            export_coco(selection, out, on_block, told.camera)
        case _:
            allowed = nearest_first(format_name, FORMATS)
            raise SettingsError(describe("--to", "is no format", format_name, allowed))
