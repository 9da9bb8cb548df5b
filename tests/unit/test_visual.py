"""What is seen of bodies: colours of files, chosen colours and shapes that only are drawn; none of them moves a body."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

import rigidimpulse as ri
from rigidimpulse.core.colors import linear_of
from rigidimpulse.scene.origin import bodies_as_seen
from rigidimpulse.view.contents import page_contents
from rigidimpulse.view.materials import PALETTE
from rigidimpulse.view.picture import draw_picture

RED, GREEN, BLUE = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
CUBE = trimesh.creation.box((1.0, 1.0, 1.0))
BY_SIDE = np.array([RED if abs(n[2]) > 0.5 else GREEN if abs(n[1]) > 0.5 else BLUE for n in CUBE.face_normals])


def scene_of(*bodies: ri.Body) -> ri.Scene:
    scene = ri.Scene(gravity=(0.0, 0.0, -9.81))
    for body in bodies:
        scene.add(body)
    return scene


def colours_of(shape: ri.Shape) -> set[tuple[int, ...]]:
    assert shape.colors is not None
    return {tuple(color) for color in shape.colors.reshape(-1, 3).tolist()}


def manifest_of(scene: ri.Scene) -> dict:
    return page_contents(motion_of(scene))[0]


def motion_of(scene: ri.Scene) -> ri.Recording:
    return ri.simulate(scene, 0.1)


class TestColorsOfMeshes:
    def test_faces_and_corners(self) -> None:
        by_face = ri.Shape.mesh(CUBE.vertices, CUBE.faces, BY_SIDE)
        by_corner = ri.Shape.mesh(CUBE.vertices, CUBE.faces, np.repeat(BY_SIDE[:, None], 3, axis=1))
        plain = ri.Shape.mesh(CUBE.vertices, CUBE.faces)
        assert colours_of(by_face) == colours_of(by_corner) == {(255, 0, 0), (0, 255, 0), (0, 0, 255)}
        assert by_face.key == plain.key and by_face.drawn_key == by_corner.drawn_key != plain.drawn_key

    @pytest.mark.parametrize("colors", [np.ones((8, 3)), BY_SIDE * 255.0, -BY_SIDE, np.full_like(BY_SIDE, np.nan)])
    def test_wrong_ones_are_refused(self, colors: np.ndarray) -> None:
        with pytest.raises(ri.SceneError, match="colors"):
            ri.Shape.mesh(CUBE.vertices, CUBE.faces, colors)

    @pytest.mark.parametrize("suffix", ["ply", "glb", "obj"])
    def test_colours_of_vertices_in_files(self, suffix: str, tmp_path: Path) -> None:
        mesh = CUBE.copy()
        low = CUBE.vertices[:, 2] < 0.0
        mesh.visual.vertex_colors = np.where(low[:, None], [255, 0, 0, 255], [0, 0, 255, 255]).astype(np.uint8)
        mesh.export(tmp_path / f"cube.{suffix}")
        assert colours_of(ri.Shape.from_file(tmp_path / f"cube.{suffix}")) == {(255, 0, 0), (0, 0, 255)}
        assert colours_of(ri.Shape.from_trimesh(mesh)) == {(255, 0, 0), (0, 0, 255)}

    def test_a_texture_is_seen_as_coarse_as_the_triangles(self, tmp_path: Path) -> None:
        # A sheet of 32 x 32 squares; its picture is red on the left and blue on the right, with v upwards.
        n = 32
        u, v = (grid.ravel() for grid in np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1), indexing="ij"))
        first = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
        faces = np.vstack([np.column_stack([first, first + n + 1, first + n + 2]), np.column_stack([first, first + n + 2, first + 1])])
        picture = np.zeros((64, 64, 3), np.uint8)
        picture[:, :32, 0], picture[:, 32:, 2] = 255, 255
        picture[:8] = [0, 255, 0]  # the upper edge
        visual = trimesh.visual.TextureVisuals(np.column_stack([u, v]), image=Image.fromarray(picture))
        shape = ri.Shape.from_trimesh(trimesh.Trimesh(np.column_stack([u, v, 0 * u]), faces, visual=visual, process=False))
        assert shape.colors is not None and shape.vertices is not None and shape.faces is not None
        middles = shape.vertices[shape.faces].mean(axis=1)
        seen = shape.colors.mean(axis=1)
        assert np.all(seen[(middles[:, 0] < 0.45) & (middles[:, 1] < 0.8)] == [255, 0, 0])
        assert np.all(seen[(middles[:, 0] > 0.55) & (middles[:, 1] < 0.8)] == [0, 0, 255])
        assert np.all(seen[middles[:, 1] > 0.95] == [0, 255, 0])

    def test_one_grey_is_no_colour(self, tmp_path: Path) -> None:
        (tmp_path / "grey.mtl").write_text("newmtl stuff\nKd 0.8 0.8 0.8\n")
        lines = ["mtllib grey.mtl", "usemtl stuff", *(f"v {x} {y} {z}" for x, y, z in CUBE.vertices)]
        (tmp_path / "grey.obj").write_text("\n".join([*lines, *(f"f {a + 1} {b + 1} {c + 1}" for a, b, c in CUBE.faces)]))
        assert ri.Shape.from_file(tmp_path / "grey.obj").colors is None
        (tmp_path / "grey.mtl").write_text("newmtl stuff\nKd 0.8 0.1 0.1\n")
        assert colours_of(ri.Shape.from_file(tmp_path / "grey.obj")) == {(204, 26, 26)}

    def test_black_and_white_parts_are_colours(self, tmp_path: Path) -> None:
        colors = {"tyre": "0 0 0", "rim": "1 1 1", "cap": "0.5 0.5 0.5"}
        (tmp_path / "parts.mtl").write_text("".join(f"newmtl {name}\nKd {color}\n" for name, color in colors.items()))
        faces = [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in CUBE.faces]
        parts = [line for k, name in enumerate(colors) for line in (f"usemtl {name}", *faces[4 * k : 4 * k + 4])]
        (tmp_path / "parts.obj").write_text("\n".join(["mtllib parts.mtl", *(f"v {x} {y} {z}" for x, y, z in CUBE.vertices), *parts]))
        assert colours_of(ri.Shape.from_file(tmp_path / "parts.obj")) == {(0, 0, 0), (255, 255, 255), (128, 128, 128)}


class TestVisual:
    @pytest.mark.parametrize("color", ["red", "#12345", "#12345g", (1.0, 0.0), (0.0, 0.0, 2.0), (0.0, 0.0, float("nan")), 7])
    def test_colours_that_are_none_are_refused_by_name(self, color: object) -> None:
        scene = scene_of(ri.Body("cube", ri.Shape.box(1.0), visual=ri.Visual(color=color)))  # type: ignore[arg-type]
        with pytest.raises(ri.SceneError, match=r"(?s)color.*body 'cube'|body 'cube'.*color"):
            ri.compile_scene(scene)

    def test_what_has_no_surface_is_refused(self) -> None:
        for visual in (ri.Visual(shape=ri.Shape.half_space()), ri.Visual(shape="cow"), "#ff0000"):  # type: ignore[arg-type]
            with pytest.raises(ri.SceneError, match="visual"):
                ri.compile_scene(scene_of(ri.Body("cube", ri.Shape.box(1.0), visual=visual)))  # type: ignore[arg-type]

    def test_it_takes_no_part_in_the_motion(self) -> None:
        def run(visual: ri.Visual | None) -> str:
            floor = ri.Body("floor", ri.Shape.half_space(), motion="static", visual=visual)
            cube = ri.Body("cube", ri.Shape.box(0.5), position=(0.0, 0.0, 0.6), angular_velocity=(3.0, 1.0, 0.0), visual=visual)
            return ri.simulate(scene_of(floor, cube), 0.5).state_hash()

        assert run(None) == run(ri.Visual("#336699")) == run(ri.Visual(shape=ri.Shape.sphere(2.0)))

    def test_the_page_has_the_colour_or_the_shape(self) -> None:
        painted = ri.Shape.mesh(CUBE.vertices, CUBE.faces, BY_SIDE)
        floor = ri.Body("floor", ri.Shape.half_space(), motion="static", visual=ri.Visual((0.2, 0.4, 0.6)))
        chosen = ri.Body("chosen", ri.Shape.sphere(0.3), position=(0, 0, 1), visual=ri.Visual("#AA5500"))
        mesh = ri.Body("mesh", painted, position=(2, 0, 1))
        other = ri.Body("other", ri.Shape.box(0.5), position=(4, 0, 1), visual=ri.Visual(shape=painted))
        same = ri.Body("same", ri.Shape.box(0.5), position=(6, 0, 1), visual=ri.Visual(shape=painted))
        over = ri.Body("over", painted, position=(8, 0, 1), visual=ri.Visual("#000000"))
        table = ri.Body("table", ri.Shape.half_space(offset=-9.0), motion="static", visual=ri.Visual("#00ff00", ri.Shape.box(1.0)))
        entries = {body["name"]: body for body in manifest_of(scene_of(floor, chosen, mesh, other, same, over, table))["bodies"]}
        assert entries["floor"]["planes"][0]["color"] == "#336699"
        assert entries["chosen"]["surface"]["color"] == "#aa5500" and not entries["chosen"]["surface"]["octants"]
        assert entries["mesh"]["surface"]["painted"] and entries["mesh"]["rendered"] == -1
        assert entries["other"]["rendered"] == entries["same"]["rendered"] >= 0 and entries["other"]["shape"] >= 0
        assert not entries["over"]["surface"]["painted"] and entries["over"]["surface"]["color"] == "#000000"
        assert entries["table"]["planes"] == [] and entries["table"]["rendered"] >= 0 and entries["table"]["surface"]["color"] == "#00ff00"

    def test_the_inside_of_open_meshes_is_seen(self) -> None:
        corners, sheet = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [(0, 1, 2), (0, 2, 3)]
        bodies = [
            ri.Body("open", ri.Shape.mesh(corners, sheet), motion="static"),
            ri.Body("painted", ri.Shape.mesh(corners, sheet, [RED, BLUE]), motion="static"),
            ri.Body("closed", ri.Shape.mesh(CUBE.vertices, CUBE.faces, BY_SIDE), position=(0, 0, 3)),
        ]
        entries = {body["name"]: body["surface"]["open"] for body in manifest_of(scene_of(*bodies))["bodies"]}
        assert entries == {"open": True, "painted": True, "closed": False}

    def test_pictures_show_it(self) -> None:
        ball = ri.Body("ball", ri.Shape.sphere(0.5), position=(0, 0, 1), visual=ri.Visual("#00ff00"))
        floor = ri.Body("floor", ri.Shape.half_space(), motion="static", visual=ri.Visual("#0000ff"))
        picture = draw_picture(motion_of(scene_of(ball, floor)), 160, 100, 0).astype(int)
        green = (picture[..., 1] > 100) & (picture[..., 0] < 80) & (picture[..., 2] < 80)
        blue = (picture[..., 2] > 100) & (picture[..., 0] < 80) & (picture[..., 1] < 80)
        assert green.sum() > 500 and blue.sum() > 500


class TestFiles:
    def test_glb_has_colours_of_vertices_and_materials(self, tmp_path: Path) -> None:
        painted = ri.Shape.mesh(CUBE.vertices, CUBE.faces, BY_SIDE)
        scene = scene_of(
            ri.Body("painted", ri.Shape.sphere(0.5), visual=ri.Visual(shape=painted)),
            ri.Body("chosen", ri.Shape.box(1.0), position=(3, 0, 0), visual=ri.Visual((0.2, 0.4, 0.6))),
        )
        path = ri.simulate(scene, 0.1).export(tmp_path / "run.glb")
        read = trimesh.load_scene(path, process=False)
        seen = {node: read.geometry[read.graph[node][1]] for node in read.graph.nodes_geometry}
        colors = np.unique(np.asarray(seen["painted"].visual.vertex_attributes["color"]), axis=0)
        assert {tuple(color) for color in colors.tolist()} == {RED, GREEN, BLUE}
        factor = np.asarray(seen["chosen"].visual.material.baseColorFactor)[:3] / 255.0
        assert factor == pytest.approx(linear_of([0.2, 0.4, 0.6]), abs=3e-3)
        # Both are read again as they were: vertices (linear), and the material of the other cube.
        again = {tuple(np.round(np.array(color) / 51.0).astype(int).tolist()) for color in colours_of(ri.Shape.from_file(path))}
        assert again == {(5, 0, 0), (0, 5, 0), (0, 0, 5), (1, 2, 3)}

    def test_a_scene_keeps_its_looks_through_glb(self, tmp_path: Path) -> None:
        painted = ri.Shape.mesh(CUBE.vertices, CUBE.faces, BY_SIDE)
        scene = scene_of(
            ri.Body("cube", painted, visual=None),
            ri.Body("ball", ri.Shape.sphere(0.5), position=(3, 0, 0), visual=ri.Visual(shape=painted)),
        )
        entries = {body["name"]: body for body in manifest_of(ri.load_scene(scene.export(tmp_path / "scene.glb")))["bodies"]}
        assert entries["cube"]["surface"]["painted"] and entries["ball"]["surface"]["painted"]
        assert entries["ball"]["rendered"] >= 0

    def test_scenes_of_glb_files_have_their_looks_in_all_that_is_drawn_of_them(self, tmp_path: Path) -> None:
        painted = ri.Shape.mesh(CUBE.vertices, CUBE.faces, BY_SIDE)
        made = scene_of(
            ri.Body("cube", painted), ri.Body("ball", ri.Shape.sphere(0.5), position=(3, 0, 0), visual=ri.Visual(shape=painted)),
            ri.Body("red", ri.Shape.box((1, 1, 1)), position=(6, 0, 0), visual=ri.Visual("#ff0000")),
        )  # fmt: skip
        scene = ri.load_scene(made.export(tmp_path / "scene.glb"))
        colours = {body.name: colours_of(body.drawn_shape) for body in bodies_as_seen(scene)[:2]}
        sides = {tuple(round(255 * x) for x in color) for color in (RED, GREEN, BLUE)}
        assert colours["cube"] == colours["ball"] == sides
        again = ri.load_scene(scene.export(tmp_path / "again.glb"))
        for read in (scene, again):
            red = bodies_as_seen(read)[2]
            assert red.visual is not None and red.visual.hex_color() == "#ff0000" and red.drawn_shape is red.shape
            assert read.bodies[2].visual is None  # it is read when it is drawn
        pytest.importorskip("pxr")
        from pxr import Usd, UsdGeom

        stage = Usd.Stage.Open(str(ri.simulate(scene, 0.1).export(tmp_path / "run.usda")))
        found: dict[str, set] = {}
        for prim in stage.Traverse(Usd.TraverseInstanceProxies()):
            shade = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance("displayColor")
            if prim.IsA(UsdGeom.Gprim):
                name = next(part for part in str(prim.GetPath()).split("/") if part in ("cube", "ball", "red"))
                found.setdefault(name, set()).update(tuple(color) for color in shade.Get())
        assert found == {"cube": {RED, GREEN, BLUE}, "ball": {RED, GREEN, BLUE}, "red": {RED}}

    def test_usd_has_colours(self, tmp_path: Path) -> None:
        pytest.importorskip("pxr")
        from pxr import Usd, UsdGeom

        painted = ri.Shape.mesh(CUBE.vertices, CUBE.faces, BY_SIDE)
        scene = scene_of(ri.Body("cube", painted), ri.Body("plain", painted, position=(3, 0, 0), visual=ri.Visual("#ffffff")))
        stage = Usd.Stage.Open(str(ri.simulate(scene, 0.1).export(tmp_path / "run.usda")))
        found = {}
        for prim in stage.Traverse(Usd.TraverseInstanceProxies()):
            shade = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance("displayColor")
            if prim.IsA(UsdGeom.Mesh):
                found[str(prim.GetPath())] = {tuple(color) for color in shade.Get()}
        assert {frozenset(value) for value in found.values()} == {frozenset({RED, GREEN, BLUE}), frozenset({(1.0, 1.0, 1.0)})}


class TestGltfMaterials:
    def cube(self, material: dict, tmp_path: Path, image: bytes | None = None) -> dict:
        """What the page says of a cube with this material, from a file that somebody else wrote."""
        mesh = CUBE.copy()
        corners = mesh.vertices[:, :2] + 0.5
        mesh.visual = trimesh.visual.TextureVisuals(corners, material=trimesh.visual.material.PBRMaterial())
        data = trimesh.exchange.gltf.export_gltf(trimesh.Scene({"cube": mesh}))
        for name, content in data.items():
            (tmp_path / name).write_bytes(content)
        path = tmp_path / "model.gltf"
        tree = json.loads(path.read_text())
        tree["materials"] = [material]
        for primitive in tree["meshes"][0]["primitives"]:
            primitive["material"] = 0
        if image is not None:
            (tmp_path / "picture.png").write_bytes(image)
            tree["images"], tree["textures"] = [{"uri": "picture.png"}], [{"source": 0}]
        path.write_text(json.dumps(tree))
        (body,) = manifest_of(ri.load_scene(path))["bodies"]
        return body["surface"]

    def test_base_colour_is_linear(self, tmp_path: Path) -> None:
        surface = self.cube({"pbrMetallicRoughness": {"baseColorFactor": [*linear_of([0.2, 0.4, 0.6]).tolist(), 1.0]}}, tmp_path)
        assert surface["color"] == "#336699"

    def test_a_picture(self, tmp_path: Path) -> None:
        Image.new("RGB", (4, 4), (255, 0, 0)).save(tmp_path / "red.png")
        info = {"index": 0, "extensions": {"KHR_texture_transform": {"rotation": 1.0, "scale": [2, 2]}}}
        surface = self.cube({"pbrMetallicRoughness": {"baseColorTexture": info}}, tmp_path, (tmp_path / "red.png").read_bytes())
        assert surface["color"] == "#ff0000"

    @pytest.mark.parametrize("index", [None, 0, 7])
    def test_a_material_is_white_if_it_says_nothing_or_its_picture_cannot_be_read(self, index: int | None, tmp_path: Path) -> None:
        material = {} if index is None else {"pbrMetallicRoughness": {"baseColorTexture": {"index": index}}}
        surface = self.cube(material, tmp_path, b"no picture")
        assert surface["color"] == "#ffffff"

    @pytest.mark.parametrize(
        "material",
        [
            {"pbrMetallicRoughness": {"baseColorFactor": ["red"]}}, {"pbrMetallicRoughness": {"baseColorTexture": {"index": -7}}},
            {"pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2]}}, {"pbrMetallicRoughness": 3},
        ],
    )  # fmt: skip
    def test_broken_ones_are_left_out(self, material: dict, tmp_path: Path) -> None:
        assert self.cube(material, tmp_path, b"no picture")["color"] == PALETTE[0]


class Broken:
    """Colours as a reader of broken files may leave them."""

    def __init__(self, kind: str, colors: object) -> None:
        self.kind, self.defined, self.colors = kind, True, colors

    def __getattr__(self, name: str) -> object:
        if name in ("vertex_colors", "face_colors"):
            return self.colors
        raise RuntimeError(f"no {name}")


@pytest.mark.parametrize(
    ("kind", "colors"),
    [
        ("vertex", np.zeros((3, 4), np.uint8)), ("vertex", np.full((8, 4), np.nan)), ("face", np.zeros((2, 3))), ("texture", None),
        ("vertex", "red"),
    ],
)  # fmt: skip
def test_colours_that_cannot_be_read_refuse_no_mesh(kind: str, colors: object) -> None:
    mesh = CUBE.copy()
    mesh._visual = Broken("vertex", np.zeros((8, 4)))
    assert ri.Shape.from_trimesh(mesh).colors is not None
    mesh._visual = Broken(kind, colors)
    assert ri.Shape.from_trimesh(mesh).colors is None
