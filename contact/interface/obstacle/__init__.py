"""Rigid foundations: shapes, one a file, and gaps given as functions.

Each shape says its signed distance with normals, and its chord rule; gaps along other directions
follow (`protocol.Shape`).
"""

from contact.interface.obstacle.cone import Cone
from contact.interface.obstacle.cylinder import Cylinder
from contact.interface.obstacle.gap import GapFunction
from contact.interface.obstacle.level import Level
from contact.interface.obstacle.paraboloid import Paraboloid
from contact.interface.obstacle.plane import Plane
from contact.interface.obstacle.protocol import Obstacle, Shape
from contact.interface.obstacle.punch import Punch
from contact.interface.obstacle.sphere import Sphere
from contact.interface.obstacle.triangles import Triangles

__all__ = [
    "Cone",
    "Cylinder",
    "GapFunction",
    "Level",
    "Obstacle",
    "Paraboloid",
    "Plane",
    "Punch",
    "Shape",
    "Sphere",
    "Triangles",
]
