"""Take recordings to other programs: BVH, glTF, USD, JuPedSim, CSV, NumPy arrays, COCO keypoints."""

from crowd.export.formats import FORMATS, export
from crowd.export.selection import Selection, Visit

__all__ = ["FORMATS", "Selection", "Visit", "export"]
