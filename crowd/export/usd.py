"""USD: a crowd of UsdSkel people, one prototype for each body, instanced."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from crowd.errors import SettingsError, describe
from crowd.export.bodies import Bodies, Body
from crowd.export.output import whole_file
from crowd.export.selection import Selection, Visit

AnyArray = npt.NDArray[Any]


def export_usd(selection: Selection, out: Path, on_block: Callable[[float], None], bodies: Bodies) -> None:
    """Write one USD file: y up, metres, a time code for each frame.

    Parameters
    ----------
    selection : Selection
    out : Path
        ``.usdc`` (compact), ``.usd`` or ``.usda`` (text).
    on_block : callable
        Called with the number of frames after each block.
    bodies : Bodies

    Raises
    ------
    SettingsError
        usd-core is not installed, or the ending is none of these.
    """
    try:
        from pxr import Usd, UsdGeom
    except ImportError as error:
        raise SettingsError(
            describe("--to usd", "usd-core is not installed", allowed='pip install "crowd-engine[usd]"')
        ) from error
    if out.suffix not in (".usd", ".usda", ".usdc"):
        raise SettingsError(describe(str(out), "is no USD file", out.suffix, ".usdc, .usd, .usda"))
    with whole_file(out) as path:
        path.unlink(missing_ok=True)
        stage = Usd.Stage.CreateNew(str(path))
        UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
        UsdGeom.SetStageMetersPerUnit(stage, 1.0)
        stage.SetTimeCodesPerSecond(1.0 / selection.frame_seconds)
        stage.SetFramesPerSecond(1.0 / selection.frame_seconds)
        stage.SetStartTimeCode(0)
        stage.SetEndTimeCode(selection.frame_count - 1)
        stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/Crowd").GetPrim())
        stage.CreateClassPrim("/Bodies")
        for slot in {bodies.kind(visit.slot): visit.slot for visit in selection.visits}.values():
            _prototype(stage, bodies.of(slot), place_of(bodies, slot))
        people = [_instance(stage, visit, place_of(bodies, visit.slot)) for visit in selection.visits]
        for block in selection.blocks(1):
            for visit, person in zip(selection.visits, people, strict=True):
                _animate(selection, visit, bodies.of(visit.slot), person, block)
            # What is saved is read back from the file when asked for, so that memory does not grow.
            stage.GetRootLayer().Save()
            on_block(block.stop - block.start)
        stage.GetRootLayer().Save()
        del stage


def place_of(bodies: Bodies, slot: int) -> str:
    """Where the body of a person stands in the stage."""
    return f"/Bodies/{bodies.kind(slot)}"


def _prototype(stage: Any, body: Body, place: str) -> None:
    """A hidden body that people are instances of."""
    from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, Vt

    root = UsdSkel.Root.Define(stage, place)
    skeleton = UsdSkel.Skeleton.Define(stage, f"{place}/Skeleton")
    paths = joint_paths(body)
    bind = np.linalg.inv(body.inverse_bind)
    skeleton.CreateJointsAttr(Vt.TokenArray(paths))
    skeleton.CreateBindTransformsAttr(Vt.Matrix4dArray([Gf.Matrix4d(matrix.T.tolist()) for matrix in bind]))
    rest = [
        np.linalg.inv(bind[parent]) @ bind[joint] if parent >= 0 else bind[joint]
        for joint, parent in enumerate(body.parent)
    ]
    skeleton.CreateRestTransformsAttr(Vt.Matrix4dArray([Gf.Matrix4d(matrix.T.tolist()) for matrix in rest]))
    for index, part in enumerate(body.parts):
        mesh = UsdGeom.Mesh.Define(stage, f"{place}/Mesh_{index}")
        mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(part.position)))
        mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(part.normal)))
        mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
        mesh.CreateFaceVertexCountsAttr(Vt.IntArray([3] * len(part.triangle)))
        indices = np.ascontiguousarray(part.triangle.reshape(-1), np.int32)
        mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(indices))
        mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        mesh.CreateDisplayColorAttr([Gf.Vec3f(*part.colour[:3].tolist())])
        binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
        joints = np.ascontiguousarray(part.joint.reshape(-1), np.int32)
        binding.CreateJointIndicesPrimvar(False, 4).Set(Vt.IntArray.FromNumpy(joints))
        weights = np.ascontiguousarray(part.weight.reshape(-1), np.float32)
        binding.CreateJointWeightsPrimvar(False, 4).Set(Vt.FloatArray.FromNumpy(weights))
        binding.CreateGeomBindTransformAttr(Gf.Matrix4d(1.0))
        binding.CreateSkeletonRel().SetTargets([Sdf.Path(f"{place}/Skeleton")])
    root.GetPrim().SetSpecifier(Sdf.SpecifierDef)
    Usd.ModelAPI(root.GetPrim()).SetKind("component")


def joint_paths(body: Body) -> list[str]:
    """Joint tokens of UsdSkel: names joined from the root down."""
    paths: list[str] = []
    for joint, parent in enumerate(body.parent):
        name = "".join(c if c.isalnum() or c == "_" else "_" for c in body.joint_names[joint])
        paths.append(f"{paths[parent]}/{name}" if parent >= 0 else name)
    return paths


def _instance(stage: Any, visit: Visit, place: str) -> Any:
    """A person: an instance of its body with an animation of its own."""
    from pxr import Sdf, UsdGeom, UsdSkel

    animation = UsdSkel.Animation.Define(stage, f"/Crowd/Animations/{visit.name}")
    root = UsdSkel.Root.Define(stage, f"/Crowd/{visit.name}")
    prim = root.GetPrim()
    prim.GetReferences().AddInternalReference(Sdf.Path(place))
    prim.SetInstanceable(True)
    binding = UsdSkel.BindingAPI.Apply(prim)
    binding.CreateAnimationSourceRel().SetTargets([animation.GetPath()])
    return animation, UsdGeom.Xformable(prim).AddTranslateOp(), root


def _animate(selection: Selection, visit: Visit, body: Body, person: Any, block: slice) -> None:
    """Set the time samples of one person in a block of frames."""
    from pxr import Gf, UsdGeom, Vt

    begin, end = max(block.start, visit.first), min(block.stop, visit.last + 1)
    animation, move, root = person
    if begin >= end:
        return
    poses = selection.recording.poses(slice(begin, end), np.array([visit.slot]))
    tracks = body.tracks(selection.recording, poses, visit.slot)
    is_root = np.flatnonzero(np.asarray(body.parent) < 0)
    if begin == visit.first:
        animation.CreateJointsAttr(Vt.TokenArray(joint_paths(body)))
        animation.CreateScalesAttr(
            Vt.Vec3hArray([Gf.Vec3h(*([tracks.scale if joint in is_root else 1.0] * 3))
                           for joint in range(len(body.parent))])
        )  # fmt: skip
        _show(selection, visit, UsdGeom.Imageable(root.GetPrim()))
    translations, rotations = animation.CreateTranslationsAttr(), animation.CreateRotationsAttr()
    # The person's place is that of its prim; joints move within.
    place = tracks.scale * tracks.translation[:, int(is_root[0])]
    within = tracks.translation.copy()
    within[:, is_root] = tracks.scale * within[:, is_root] - place[:, None]
    is_still = bool(np.ptp(within, axis=0).max() < 1e-7)
    if is_still and begin == visit.first:
        translations.Set(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(within[0], np.float32)))
    turns = np.ascontiguousarray(tracks.rotation[..., [1, 2, 3, 0]], np.float32)
    for row in range(end - begin):
        time = begin + row - selection.first
        rotations.Set(Vt.QuatfArray.FromNumpy(turns[row]), time)
        if not is_still:
            translations.Set(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(within[row], np.float32)), time)
        move.Set(Gf.Vec3d(*place[row].tolist()), time)


def _show(selection: Selection, visit: Visit, prim: Any) -> None:
    """Hide a person before it enters and after it has left."""
    from pxr import UsdGeom

    visibility = prim.CreateVisibilityAttr()
    first, last = visit.first - selection.first, visit.last - selection.first
    if first > 0:
        visibility.Set(UsdGeom.Tokens.invisible, 0)
        visibility.Set(UsdGeom.Tokens.inherited, first)
    if last < selection.frame_count - 1:
        visibility.Set(UsdGeom.Tokens.inherited, first)
        visibility.Set(UsdGeom.Tokens.invisible, last + 1)
