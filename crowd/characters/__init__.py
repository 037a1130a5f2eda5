"""Characters that users bring: skinned glTF people and creatures, driven by the crowd."""

from crowd.characters.cast import Cast
from crowd.characters.character import Character, MeshPart, load_character
from crowd.characters.driving import Driver

__all__ = ["Cast", "Character", "Driver", "MeshPart", "load_character"]
