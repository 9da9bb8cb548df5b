"""What is seen of bodies of a USD file: rendered geometry beside colliders, in the colours of primvars and materials."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rigidimpulse as ri
from rigidimpulse.core.colors import linear_of

pytest.importorskip("pxr")

BLUE_GREY = tuple(linear_of([0.2, 0.4, 0.6]).round(7).tolist())
"""#336699 as USD has it: linear."""
HEAD = '#usda 1.0\n( metersPerUnit = 1\n upAxis = "Z" )\n'
BODY = 'prepend apiSchemas = ["PhysicsRigidBodyAPI"]'
SOLID = 'prepend apiSchemas = ["PhysicsCollisionAPI"]'
BOTH = 'prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsCollisionAPI"]'
SQUARES = """int[] faceVertexCounts = [4, 4]
    int[] faceVertexIndices = [0, 1, 4, 3, 1, 2, 5, 4]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0), (1, 1, 0), (2, 1, 0)]"""


def scene_of(tmp_path: Path, text: str) -> ri.Scene:
    path = tmp_path / "scene.usda"
    # Each statement on a line of its own.
    path.write_text(HEAD + text.replace("{", "{\n").replace("}", "\n}\n"))
    return ri.load_scene(path)


def test_display_colour_of_the_collider_is_inherited(tmp_path: Path) -> None:
    scene = scene_of(
        tmp_path,
        f'def Xform "crate" ( {BODY} ) {{ color3f[] primvars:displayColor = [{BLUE_GREY}] ( interpolation = "constant" )\n'
        f'def Cube "box" ( {SOLID} ) {{ double size = 1 }} }}',
    )
    visual = scene["crate"].visual
    assert visual is not None and visual.shape is None and visual.hex_color() == "#336699"


def test_a_body_without_colours_looks_as_it_collides(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, f'def Sphere "ball" ( {BOTH} ) {{ double radius = 0.5 }}')
    assert scene["ball"].visual is None


def test_a_material_goes_before_the_primvar(tmp_path: Path) -> None:
    scene = scene_of(
        tmp_path,
        f"""def Material "paint" {{ token outputs:surface.connect = </paint/shader.outputs:surface>
  def Shader "shader" {{ uniform token info:id = "UsdPreviewSurface"
    color3f inputs:diffuseColor = {BLUE_GREY}
    token outputs:surface }} }}
def Cube "crate" ( prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsCollisionAPI", "MaterialBindingAPI"] ) {{
  double size = 1
  color3f[] primvars:displayColor = [(1, 0, 0)]
  rel material:binding = </paint> }}""",
    )
    visual = scene["crate"].visual
    assert visual is not None and visual.hex_color() == "#336699"


def test_rendered_geometry_is_seen_in_the_place_of_hidden_colliders(tmp_path: Path) -> None:
    scene = scene_of(
        tmp_path,
        f"""def Xform "thing" ( {BODY} ) {{ double3 xformOp:translate = (0, 0, 3)
  double3 xformOp:scale = (2, 2, 2)
  uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
  def Cube "collider" ( {SOLID} ) {{ double size = 1
    token visibility = "invisible" }}
  def Sphere "seen" {{ double radius = 0.25
    double3 xformOp:translate = (0, 0, 1)
    uniform token[] xformOpOrder = ["xformOp:translate"] }}
  def Cube "part" ( {BOTH} ) {{ double size = 0.1 }} }}""",
    )
    visual = scene["thing"].visual
    assert visual is not None and visual.shape is not None
    (part,) = visual.shape.parts_flat()
    assert part.shape.kind == "sphere" and part.shape.radius == pytest.approx(0.5)
    assert part.position == pytest.approx([0.0, 0.0, 2.0])  # in the rigid frame of the body, which its scale has left


@pytest.mark.parametrize(
    ("interpolation", "values"),
    [
        ("uniform", [(1, 0, 0), (0, 0, 1)]),
        ("faceVarying", [(1, 0, 0)] * 4 + [(0, 0, 1)] * 4),
        ("vertex", [(1, 0, 0), (1, 0, 0), (0, 0, 1)] * 2),
    ],
)
@pytest.mark.parametrize("orientation", ["rightHanded", "leftHanded"])
def test_colours_of_polygons_corners_and_vertices(interpolation: str, values: list, orientation: str, tmp_path: Path) -> None:
    scene = scene_of(
        tmp_path,
        f"""def Mesh "sheet" ( {SOLID} ) {{ {SQUARES}
    uniform token orientation = "{orientation}"
    color3f[] primvars:displayColor = {values} ( interpolation = "{interpolation}" ) }}""",
    )
    visual = scene["sheet"].visual
    assert visual is not None and visual.shape is not None
    (part,) = visual.shape.parts_flat()
    assert part.shape.vertices is not None and part.shape.faces is not None and part.shape.colors is not None
    for face, colors in zip(part.shape.faces, part.shape.colors, strict=True):
        places = part.shape.vertices[face]
        if interpolation == "vertex":
            red = places[:, 0] < 1.5
        else:
            red = np.full(3, places[:, 0].mean() < 1.0)
        np.testing.assert_array_equal(colors, np.where(red[:, None], [255, 0, 0], [0, 0, 255]))
