"""Small motion files of every format, as text or bytes."""

import base64
import json
import struct

BVH = """HIERARCHY
ROOT Hips
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Left Leg
  {
    OFFSET 1 -4 0
    CHANNELS 3 Xrotation Yrotation Zrotation
    End Site
    {
      OFFSET 0 -5 0
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.0333333
0 9 0 0 0 0 0 0 0
1 9 2 0 0 90 90 0 0
"""

ASF = """# a comment
:version 1.10
:units
  mass 1.0
  length 0.45
  angle deg
:root
  order TX TY TZ RX RY RZ
  axis XYZ
  position 0 0 0
  orientation 0 0 0
:bonedata
  begin
    id 1
    name hip
    direction 1 0 0
    length 2
    axis 0 0 0 XYZ
  end
  begin
    id 2
    name leg
    direction 0 -1 0
    length 4
    axis 0 0 90 XYZ
    dof rx rz
    limits (-160 20)
           (-70 70)
  end
:hierarchy
  begin
    root hip
    hip leg
  end
"""

AMC = """#!OML:ASF
:FULLY-SPECIFIED
:DEGREES
1
root 0 10 0 0 0 0
leg 0 0
2
root 1 10 2 0 90 0
leg 0 90
"""

SK = """# Units: cm
set_name toy
skeleton
root base
{ offset 0 10 0
  channel XPos 0 free
  channel YPos 0 lim -1 1
  channel Quat
  joint left leg
  { offset 1 -4 0 prerot axis 0 0 1 ang 90
    channel Quat
    joint tip { offset 5 0 0 }
  }
}
end
"""

SKM = """# Units: cm
SkMotion
name "toy clip"
channels 4
base XPos
base Quat
left leg Quat
nobody Quat
frames 2
kt 0 fr 0 0 0 0 0 0 0 9 9 9
kt 0.033333 fr 2 0 1.5707963267948966 0
0 0 1.5707963267948966 9 9 9

ready time: 0.01
strokeStartTime: 0.02
heelStrikeLf: 0.033333
author: somebody
"""


def skmb() -> bytes:
    """The same clip as `SKM`, as a message."""
    half = 0.5**0.5
    frames = [
        (0.0, [0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0]),
        (0.033333, [2, half, 0, half, 0, half, 0, 0, half, 1, 0, 0, 0]),
    ]
    channels = [("base", 0), ("base", 6), ("left leg", 6), ("nobody", 6)]
    sync = [0.0, 0.01, 0.02, -1.0, -1.0, -1.0, 0.033333] * 2

    def text(number: int, content: bytes) -> bytes:
        return bytes([number << 3 | 2, len(content)]) + content

    def single(number: int, value: float) -> bytes:
        return bytes([number << 3 | 5]) + struct.pack("<f", value)

    return b"".join(
        [
            text(1, b"toy clip"),
            bytes([2 << 3, len(channels)]),
            *(text(3, joint.encode()) for joint, _ in channels),
            *(bytes([4 << 3, kind]) for _, kind in channels),
            bytes([5 << 3, len(frames)]),
            *(single(6, time) for time, _ in frames),
            *(single(7, value) for _, values in frames for value in values),
            *(single(8, value) for value in sync),
            text(9, text(1, b"heelStrikeLf") + single(2, 0.033333)),
        ]
    )


def gltf() -> str:
    """Two joints under a node that is turned a quarter about x; the second turns about z within a second."""
    half = 0.5**0.5
    data = struct.pack("<2f", 0.0, 1.0) + struct.pack("<8f", 0, 0, 0, 1, 0, 0, half, half)
    views = [{"buffer": 0, "byteOffset": start, "byteLength": size} for start, size in ((0, 8), (8, 32))]
    document = {
        "asset": {"version": "2.0"},
        "nodes": [
            {"name": "armature", "children": [1], "rotation": [half, 0, 0, half]},
            {"name": "hips", "children": [2], "translation": [0, 0, 1]},
            {"name": "leg", "translation": [0, 2, 0], "children": [3]},
            {"name": "foot", "translation": [0, 3, 0]},
        ],
        "skins": [{"joints": [1, 2, 3]}],
        "animations": [
            {
                "name": "bend",
                "channels": [{"sampler": 0, "target": {"node": 2, "path": "rotation"}}],
                "samplers": [{"input": 0, "output": 1}],
            }
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 2, "type": "SCALAR"},
            {"bufferView": 1, "componentType": 5126, "count": 2, "type": "VEC4"},
        ],
        "bufferViews": views,
        "buffers": [
            {
                "byteLength": len(data),
                "uri": "data:application/octet-stream;base64," + base64.b64encode(data).decode(),
            }
        ],
    }
    return json.dumps(document, indent=1)


def contents() -> dict[str, bytes]:
    """All sample files by name."""
    return {
        "toy.bvh": BVH.encode(),
        "toy.asf": ASF.encode(),
        "toy.amc": AMC.encode(),
        "toy.sk": SK.encode(),
        "toy.skm": SKM.encode(),
        "toy.skmb": skmb(),
        "toy.gltf": gltf().encode(),
    }
