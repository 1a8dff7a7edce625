"""Rigid foundations: shapes, triangles, and gaps given as functions.

Each shape has its signed distance with normals, and its chord rule; gaps along other directions
follow (`protocol.Shape`).
"""

from contact.interface.obstacle.heights import Heights
from contact.interface.obstacle.protocol import GapFunction, Obstacle, Shape
from contact.interface.obstacle.shapes import (
    Cone,
    Cylinder,
    Level,
    Paraboloid,
    Plane,
    Punch,
    Sphere,
)
from contact.interface.obstacle.triangles import Triangles

__all__ = [
    "Cone",
    "Cylinder",
    "GapFunction",
    "Heights",
    "Level",
    "Obstacle",
    "Paraboloid",
    "Plane",
    "Punch",
    "Shape",
    "Sphere",
    "Triangles",
]
