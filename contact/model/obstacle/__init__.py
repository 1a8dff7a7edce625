"""Rigid foundations: shapes, triangles, and gaps given as functions.

Each shape has its signed distance with normals, and its chord rule; gaps along other directions
follow (`protocol.Shape`).
"""

from contact.model.obstacle.heights import Heights
from contact.model.obstacle.protocol import GapFunction, Obstacle, Shape
from contact.model.obstacle.shapes import (
    Cone,
    Cylinder,
    Level,
    Paraboloid,
    Plane,
    Punch,
    Sphere,
)
from contact.model.obstacle.triangles import Triangles

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
