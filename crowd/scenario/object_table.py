"""The table ``[[objects]]`` of a scenario file: things that people can grasp and carry."""

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from crowd.scenario.table import Coordinate, Number, Positive, Table, WholeNumber, YesOrNo, refuse

Length = Annotated[Number, Field(ge=0.002, le=5.0)]
Place = tuple[Coordinate, Annotated[Number, Field(ge=0.0, le=100.0)], Coordinate]
Tint = Annotated[Number, Field(ge=0.0, le=1.0)]
RowCount = Annotated[WholeNumber, Field(ge=1, le=1000)]
Angle = Annotated[Number, Field(ge=-360.0, le=360.0)]

SIZE_KEYS = {
    "sphere": ("radius",),
    "box": ("size",),
    "capsule": ("radius", "length"),
    "mesh": ("file",),
}
"""What tells how large each shape is."""
MOST_COPIES = 10_000


def _turn_of_number(value: Any) -> Any:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return (0.0, value, 0.0) if is_number else value


class Repeat(Table):
    """Copies of an object in rows along x, y and z."""

    count: tuple[RowCount, RowCount, RowCount] = (1, 1, 1)
    """Copies along each axis, the object itself included."""
    spacing: tuple[Coordinate, Coordinate, Coordinate]
    """Distance from one copy to the next along each axis, m."""

    @model_validator(mode="after")
    def _is_not_too_many(self) -> "Repeat":
        copies = self.count[0] * self.count[1] * self.count[2]
        if copies > MOST_COPIES:
            raise refuse("has too many copies", f"at most {MOST_COPIES}", "count", copies)
        return self


class ObjectTable(Table):
    """A thing that people can grasp."""

    name: str | None = None
    """For tasks and messages; copies are ``name[0]``, ``name[1]``, ..."""
    shape: Literal["sphere", "box", "capsule", "mesh"]
    radius: Length | None = None
    """Of a sphere or capsule, m."""
    length: Length | None = None
    """Of a capsule from end to end along its own y axis, m; at least twice the radius."""
    size: tuple[Length, Length, Length] | None = None
    """Of a box along its own x, y, z axes, m."""
    file: str | None = None
    """Of a mesh: .obj, .stl, .ply, .glb or .gltf, beside the scenario file."""
    scale: Positive = 1.0
    """Metres per unit of the mesh file."""
    position: Place
    """Its centre x, y, z, m; for meshes the centre of the bounding box."""
    resting: YesOrNo = False
    """It rests on a surface: y of `position` is the height of that surface."""
    rotation: Annotated[tuple[Angle, Angle, Angle], BeforeValidator(_turn_of_number)] = (0.0, 0.0, 0.0)
    """Turn about x, then z, then y (the heading), degrees, written [x, y, z]; one number is the heading."""
    colour: tuple[Tint, Tint, Tint] = (0.75, 0.45, 0.25)
    """Red, green, blue, 0 to 1."""
    repeat: Repeat | None = None
    """Copies in rows."""

    @model_validator(mode="after")
    def _has_the_sizes_of_its_shape(self) -> "ObjectTable":
        wanted = SIZE_KEYS[self.shape]
        for key in ("radius", "length", "size", "file"):
            is_given = getattr(self, key) is not None
            if key in wanted and not is_given:
                raise refuse(f"is missing; a {self.shape} needs {' and '.join(wanted)}", key=key)
            if key not in wanted and is_given:
                raise refuse(f"means nothing for a {self.shape}", " and ".join(wanted), key)
        if self.length is not None and self.radius is not None and self.length < 2.0 * self.radius:
            raise refuse(
                "must be at least twice the radius", f">= {2.0 * self.radius:g} m", "length", self.length
            )
        return self
