"""Rigid foundations: shapes, triangles, and gaps given as functions.

Each shape has its signed distance with normals; gaps along other directions
follow (`shapes.Shape`).
"""

from contact.model.obstacle.shapes import (
    Cone,
    Cylinder,
    GapFunction,
    Level,
    Obstacle,
    Paraboloid,
    Plane,
    Punch,
    Shape,
    Sphere,
)
from contact.model.obstacle.surfaces import Heights, Triangles

#: The shapes that a case file has, by their names as `shape`.
SHAPES = (Plane, Sphere, Cylinder, Cone, Paraboloid, Punch, Level, Heights, Triangles)

__all__ = [
    "SHAPES",
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
