"""A bracket: an angle with bolt holes, an eye and a fillet."""

from itertools import pairwise

from contact.errors import InputError
from meshes.grading import Sizes, finish


def bracket(
    *,
    length: float = 60.0,
    width: float = 40.0,
    height: float = 60.0,
    thickness: float = 8.0,
    fillet: float = 8.0,
    bolt_diameter: float = 11.0,
    eye_diameter: float = 16.0,
    size: float = 6.0,
    contact_size: float = 2.5,
) -> None:
    """Angle of a base, z < ``thickness``, and a web, x < ``thickness``, with holes through both.

    Parts: ``base`` (z = 0), ``bolts`` (two holes in the base), ``eye`` (a hole in the web),
    ``fillet`` (between base and web), ``back`` (x = 0). The elements have ``contact_size`` at the
    base and at round parts, ``size`` far away.
    """
    import gmsh

    inner = thickness + fillet
    room = {"eye_diameter": min(height - inner, width), "bolt_diameter": width / 2}
    room["bolt_diameter"] = min(room["bolt_diameter"], length - inner)
    for key, diameter in (("eye_diameter", eye_diameter), ("bolt_diameter", bolt_diameter)):
        if diameter >= room[key]:
            raise InputError(
                f"{key} must be less than {room[key]:g}; given: {diameter:g}", "generator"
            )
    occ = gmsh.model.occ
    around = [(0, 0), (length, 0), (length, thickness), (inner, thickness)]
    around += [(thickness, inner), (thickness, height), (0, height)]
    points = [occ.addPoint(x, 0, z) for x, z in around]
    edges = [occ.addLine(a, b) for a, b in pairwise(points[:4])]
    edges.append(occ.addCircleArc(points[3], occ.addPoint(inner, 0, inner), points[4]))
    edges += [occ.addLine(a, b) for a, b in pairwise([*points[4:], points[0]])]
    profile = occ.addPlaneSurface([occ.addCurveLoop(edges)])
    angle = [entity for entity in occ.extrude([(2, profile)], 0, width, 0) if entity[0] == 3]
    along, up, bolt = (inner + length) / 2, (inner + height) / 2, bolt_diameter / 2
    holes = [
        occ.addCylinder(along, y, 0, 0, 0, thickness, bolt) for y in (width / 4, 3 * width / 4)
    ]
    holes.append(occ.addCylinder(0, width / 2, up, thickness, 0, 0, eye_diameter / 2))
    body, _ = occ.cut(angle, [(3, hole) for hole in holes])
    occ.synchronize()
    parts: dict[str, list[int]] = {"base": [], "bolts": [], "eye": [], "fillet": [], "back": []}
    for _, face in gmsh.model.getBoundary(body, oriented=False):
        x, y, z, *high = gmsh.model.getBoundingBox(2, face)
        near = 1e-6 * length
        if gmsh.model.getType(2, face) != "Plane":
            name = "fillet" if high[1] - y > width - near else "bolts" if abs(z) < near else "eye"
            parts[name].append(face)
        elif max(abs(z), abs(high[2])) < near:
            parts["base"].append(face)
        elif max(abs(x), abs(high[0])) < near:
            parts["back"].append(face)
    sizes = Sizes(size, contact_size, contact_size, 0.25)
    fine = [face for name in ("base", "bolts", "eye", "fillet") for face in parts[name]]
    finish(gmsh, 3, [tag for _, tag in body], parts, sizes, surfaces=fine)
