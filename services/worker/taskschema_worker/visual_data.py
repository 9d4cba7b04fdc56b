"""The Sawyer's looks for `generate_data`: robosuite's visual meshes, merged by colour and decimated.

As robosuite ships them two arms have 569,000 faces, and a frame takes a third of a second without a GPU.
"""

import xml.etree.ElementTree as ET
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from taskschema.arrays import BoolArray, FloatArray, IntArray

SOURCES = ("robots/sawyer/robot.xml", "grippers/rethink_gripper.xml")
FACES_PER_SQUARE_METRE = 9000.0
"""Of a coloured part's own surface."""
FACES = (60, 1500)
"""Fewest and most faces of a coloured part."""
SMALLEST_PART = 1e-4
"""Coloured parts of less surface [m^2] are screws and labels: left out."""
WELD_SHARE = 0.005
"""Vertices closer than this share of a part's diagonal become one before the decimation: it closes the
seams between meshes, and takes what is too small to be seen, such as screws and threads."""
DIGITS = 4
"""Decimals of a vertex [m]: a tenth of a millimetre."""
PAINTS: dict[tuple[float, float, float], tuple[float, float, float]] = {(1.0, 0.0, 0.0): (0.7, 0.05, 0.06)}
"""What the model's colours become: its primary red is the Sawyer's dark one."""
GLOSS = {"specular": "0.3", "shininess": "0.3"}
"""Of painted and anodised metal, as in robosuite's materials."""

Colour = tuple[float, float, float]


@dataclass(frozen=True)
class Part:
    """All faces of one colour on one body."""

    body: str
    colour: Colour
    vertices: FloatArray
    """[V, 3] in the body's frame [m]."""
    faces: IntArray
    """[F, 3] indices of vertices."""

    @property
    def name(self) -> str:
        """Body and colour, which are together unique."""
        return f"{self.body}_{''.join(f'{round(255 * value):02x}' for value in self.colour)}"


def visual_mjcf(assets: Path, bodies: set[str]) -> ET.Element:
    """Return the looks of one arm: meshes, materials, and a flat list of the bodies that carry them.

    Args:
        assets: robosuite's model files.
        bodies: names of the bodies of `sawyer.xml`; what others carry goes to the next one above.

    """
    root = ET.Element("mujoco", {"model": "sawyer visual"})
    asset, world = ET.SubElement(root, "asset"), ET.SubElement(root, "worldbody")
    carriers: dict[str, ET.Element] = {}
    colours: set[Colour] = set()
    for part in sorted(coloured_parts(assets, bodies), key=lambda part: part.name):
        colours.add(part.colour)
        vertices = " ".join(f"{value:.{DIGITS}f}".rstrip("0").rstrip(".") for value in part.vertices.ravel())
        faces = " ".join(map(str, part.faces.ravel()))
        # A shell: the meshes are not closed, and their inertia counts for nothing.
        mesh = {"name": part.name, "inertia": "shell", "vertex": vertices, "face": faces}
        asset.append(ET.Element("mesh", mesh))
        if part.body not in carriers:
            carriers[part.body] = ET.SubElement(world, "body", {"name": part.body})
        carriers[part.body].append(_geom(part))
    for colour in sorted(colours):
        rgba = " ".join(f"{value:.3g}" for value in (*colour, 1.0))
        asset.append(ET.Element("material", {"name": _material(colour), "rgba": rgba} | GLOSS))
    ET.indent(root)
    return root


def coloured_parts(assets: Path, bodies: set[str]) -> list[Part]:
    """Return the arm's parts, decimated."""
    groups: dict[tuple[str, Colour], list[tuple[FloatArray, IntArray]]] = defaultdict(list)
    for source in SOURCES:
        for body, colour, vertices, faces in _meshes(assets / source, bodies):
            groups[body, colour].append((vertices, faces))
    parts = []
    for (body, colour), meshes in groups.items():
        vertices, faces = _welded(meshes)
        area = _area(vertices, faces)
        if area >= SMALLEST_PART:
            vertices, faces = _decimated(vertices, faces, area)
            parts.append(Part(body, colour, vertices, faces))
    return parts


def _meshes(path: Path, bodies: set[str]) -> Iterator[tuple[str, Colour, FloatArray, IntArray]]:
    """Yield the visual meshes of a model: body that carries it, colour, vertices in its frame, faces."""
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    for geom in range(model.ngeom):
        if model.geom_type[geom] != mujoco.mjtGeom.mjGEOM_MESH:
            continue
        mesh, material = model.geom_dataid[geom], model.geom_matid[geom]
        red, green, blue, _ = model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom]
        first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        local = model.mesh_vert[first : first + count].astype(np.float64)
        world = local @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
        body = model.geom_bodyid[geom]
        while body and model.body(body).name not in bodies:
            body = model.body_parentid[body]
        rotation, origin = data.xmat[body].reshape(3, 3), data.xpos[body]
        first, count = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
        colour = (round(float(red), 2), round(float(green), 2), round(float(blue), 2))
        faces = model.mesh_face[first : first + count]
        yield model.body(body).name, PAINTS.get(colour, colour), (world - origin) @ rotation, faces


def _welded(meshes: list[tuple[FloatArray, IntArray]]) -> tuple[FloatArray, IntArray]:
    """Join meshes into one whose faces share vertices; faces that collapse are dropped."""
    offsets = np.cumsum([0, *(len(vertices) for vertices, _ in meshes)])
    vertices = np.concatenate([vertices for vertices, _ in meshes])
    faces = np.concatenate([faces + offset for (_, faces), offset in zip(meshes, offsets, strict=False)])
    cell = WELD_SHARE * np.linalg.norm(np.ptp(vertices, axis=0))
    _, first, index = np.unique(
        np.round(vertices / cell).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    faces = index.reshape(-1)[faces]
    faces = faces[_has_three_corners(faces)]
    _, kept = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    return vertices[first], faces[np.sort(kept)]


def _decimated(vertices: FloatArray, faces: IntArray, area: float) -> tuple[FloatArray, IntArray]:
    """Reduce a mesh to as many faces as its surface deserves, its vertices rounded."""
    import fast_simplification  # of the extra `dev`: no part that runs needs it

    target = int(np.clip(FACES_PER_SQUARE_METRE * area, *FACES))
    if len(faces) > target:
        vertices, faces = fast_simplification.simplify(
            vertices.astype(np.float64), faces.astype(np.int64), target_count=target
        )
    rounded = np.round(vertices, DIGITS) + 0.0
    corners, index = np.unique(rounded, axis=0, return_inverse=True)
    faces = index.reshape(-1)[faces]
    faces = faces[_has_three_corners(faces)]
    used, index = np.unique(faces, return_inverse=True)
    return corners[used], index.reshape(faces.shape)


def _has_three_corners(faces: IntArray) -> BoolArray:
    a, b, c = faces.T
    distinct: BoolArray = (a != b) & (b != c) & (c != a)
    return distinct


def _area(vertices: FloatArray, faces: IntArray) -> float:
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    return 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())


def _material(colour: Colour) -> str:
    return f"sawyer_{''.join(f'{round(255 * value):02x}' for value in colour)}"


def _geom(part: Part) -> ET.Element:
    looks = {"type": "mesh", "mesh": part.name, "material": _material(part.colour)}
    return ET.Element("geom", looks | {"mass": "0", "contype": "0", "conaffinity": "0", "group": "1"})
