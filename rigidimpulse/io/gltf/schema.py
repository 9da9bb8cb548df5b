"""The parts of a glTF 2.0 file that are read, as pydantic models: every error is reported with its path in the file.

Types are strict (no number in quotes, no true for 1), numbers finite and not beyond `LARGEST`. What is not named here
is left alone. Sources: glTF 2.0 (Khronos, 2021), drafts of KHR_physics_rigid_bodies and KHR_implicit_shapes (2024).
Figures are those of the file: quaternions (x, y, z, w), matrices by columns, vectors in the space of the node.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field
from pydantic.alias_generators import to_camel

LARGEST = 1e9
"""Greatest magnitude of any number that is read: lengths in m, masses in kg and so on."""
LARGEST_STIFFNESS = 1e18

Index = Annotated[int, Field(ge=0, lt=2**53)]
Number = Annotated[float, Field(ge=-LARGEST, le=LARGEST, allow_inf_nan=False)]
Amount = Annotated[float, Field(ge=0.0, le=LARGEST, allow_inf_nan=False)]
Stiffness = Annotated[float, Field(ge=0.0, le=LARGEST_STIFFNESS, allow_inf_nan=False)]
Vector = tuple[Number, Number, Number]
Quaternion = tuple[Number, Number, Number, Number]
Axes = Annotated[list[Annotated[int, Field(ge=0, le=2)]], Field(min_length=1, max_length=3)]
Combine = Literal["average", "minimum", "maximum", "multiply"]

RIGID_BODIES, IMPLICIT_SHAPES = "KHR_physics_rigid_bodies", "KHR_implicit_shapes"
INSTANCING = "EXT_mesh_gpu_instancing"


class Part(BaseModel):
    """An object of the file."""

    model_config = ConfigDict(strict=True, extra="ignore", frozen=True, alias_generator=to_camel, populate_by_name=True)


class Geometry(Part):
    """Shape of a collider or trigger: an implicit shape or the mesh of a node."""

    shape: Index | None = None
    node: Index | None = None
    convex_hull: bool = False


class Motion(Part):
    """What makes a node a body that moves; velocities in node space."""

    is_kinematic: bool = False
    mass: Amount | None = None
    center_of_mass: Vector | None = None
    inertia_diagonal: tuple[Amount, Amount, Amount] | None = None
    inertia_orientation: Quaternion = (0.0, 0.0, 0.0, 1.0)
    linear_velocity: Vector = (0.0, 0.0, 0.0)
    angular_velocity: Vector = (0.0, 0.0, 0.0)
    gravity_factor: Number = 1.0


class Collider(Part):
    """Surface that is hit."""

    geometry: Geometry
    physics_material: Index | None = None
    collision_filter: Index | None = None


class Trigger(Part):
    """Volume that is only watched; `nodes` of a compound one."""

    geometry: Geometry | None = None
    nodes: list[Index] | None = None
    collision_filter: Index | None = None


class NodeJoint(Part):
    """Joint of the frame of this node with that of another."""

    connected_node: Index
    joint: Index
    enable_collision: bool = False


class NodePhysics(Part):
    """Physics of a node."""

    motion: Motion | None = None
    collider: Collider | None = None
    trigger: Trigger | None = None
    joint: NodeJoint | None = None


class Instancing(Part):
    """Where a node draws its mesh: accessors of TRANSLATION, ROTATION, SCALE."""

    attributes: dict[str, Index] = {}


class NodeExtensions(Part):
    """Extensions of a node that are read."""

    physics: NodePhysics | None = Field(default=None, alias=RIGID_BODIES)
    instancing: Instancing | None = Field(default=None, alias=INSTANCING)


class Node(Part):
    """A node of the hierarchy."""

    name: str | None = None
    children: list[Index] = []
    mesh: Index | None = None
    skin: Index | None = None
    weights: list[Number] | None = None
    matrix: Annotated[list[Number], Field(min_length=16, max_length=16)] | None = None
    translation: Vector = (0.0, 0.0, 0.0)
    rotation: Quaternion = (0.0, 0.0, 0.0, 1.0)
    scale: Vector = (1.0, 1.0, 1.0)
    extensions: NodeExtensions = NodeExtensions()
    extras: Any = None

    @property
    def physics(self) -> NodePhysics:
        """Its physics, empty if it has none."""
        return self.extensions.physics or NodePhysics()


class Limit(Part):
    """Bounds of axes of a joint together."""

    min: Number | None = None
    max: Number | None = None
    stiffness: Stiffness | None = None
    damping: Stiffness = 0.0
    linear_axes: Axes | None = None
    angular_axes: Axes | None = None


class Drive(Part):
    """Motor of one axis of a joint."""

    type: str
    mode: str
    axis: Annotated[int, Field(ge=0, le=2)]
    max_force: Stiffness | None = None
    position_target: Number = 0.0
    velocity_target: Number = 0.0
    stiffness: Stiffness = 0.0
    damping: Stiffness = 0.0


class Joint(Part):
    """Limits and drives."""

    limits: list[Limit] = []
    drives: list[Drive] = []


class PhysicsMaterial(Part):
    """Coefficients of contact."""

    static_friction: Amount = 0.6
    dynamic_friction: Amount = 0.6
    restitution: Amount = 0.0
    friction_combine: Combine = "average"
    restitution_combine: Combine = "average"
    extras: Any = None


class Filter(Part):
    """Who collides with whom."""

    collision_systems: list[str] = []
    collide_with_systems: list[str] | None = None
    not_collide_with_systems: list[str] | None = None


class Sphere(Part):
    """A sphere."""

    radius: Amount = 0.5


class Box(Part):
    """A box."""

    size: tuple[Amount, Amount, Amount] = (1.0, 1.0, 1.0)


class Tapered(Part):
    """A capsule or cylinder along Y."""

    height: Amount = 0.5
    radius_bottom: Amount = 0.25
    radius_top: Amount = 0.25


class Plane(Part):
    """A plane with normal Y."""

    double_sided: bool = False
    size_x: Amount | None = None
    size_z: Amount | None = None


class ImplicitShape(Part):
    """A shape given by figures."""

    type: str
    sphere: Sphere = Sphere()
    box: Box = Box()
    capsule: Tapered = Tapered()
    cylinder: Tapered = Tapered()
    plane: Plane = Plane()


class Physics(Part):
    """What nodes share."""

    physics_materials: list[PhysicsMaterial] = []
    collision_filters: list[Filter] = []
    physics_joints: list[Joint] = []


class Shapes(Part):
    """Implicit shapes."""

    shapes: list[ImplicitShape] = []


class Extensions(Part):
    """Extensions of the file that are read."""

    physics: Physics = Field(default=Physics(), alias=RIGID_BODIES)
    implicit: Shapes = Field(default=Shapes(), alias=IMPLICIT_SHAPES)


class SparseIndices(Part):
    """Where values are replaced."""

    buffer_view: Index
    byte_offset: Index = 0
    component_type: int


class SparseValues(Part):
    """What they are replaced by."""

    buffer_view: Index
    byte_offset: Index = 0


class Sparse(Part):
    """Values of an accessor that are replaced."""

    count: Index
    indices: SparseIndices
    values: SparseValues


class Accessor(Part):
    """An array in a buffer."""

    buffer_view: Index | None = None
    byte_offset: Index = 0
    component_type: int
    normalized: bool = False
    count: Index
    type: str
    sparse: Sparse | None = None


class BufferView(Part):
    """A piece of a buffer."""

    buffer: Index
    byte_offset: Index = 0
    byte_length: Index
    byte_stride: Annotated[int, Field(ge=4, le=252)] | None = None
    extensions: dict[str, Any] = {}


class Buffer(Part):
    """Bytes."""

    uri: str | None = None
    byte_length: Index


class Primitive(Part):
    """A piece of a mesh."""

    attributes: dict[str, Index]
    indices: Index | None = None
    material: Any = None
    mode: int = 4
    targets: list[dict[str, Index]] = []
    extensions: dict[str, Any] = {}


class Mesh(Part):
    """Triangles."""

    name: str | None = None
    primitives: list[Primitive]
    weights: list[Number] = []


class Skin(Part):
    """Bones of a mesh."""

    joints: list[Index]
    inverse_bind_matrices: Index | None = None


class Sampler(Part):
    """Keys of a channel."""

    input: Index
    output: Index
    interpolation: str = "LINEAR"


class Target(Part):
    """What a channel moves."""

    node: Index | None = None
    path: str


class Channel(Part):
    """One animated property of a node."""

    sampler: Index
    target: Target


class Animation(Part):
    """Channels that play together."""

    name: str | None = None
    channels: list[Channel]
    samplers: list[Sampler]


class SceneOfNodes(Part):
    """Root nodes."""

    nodes: list[Index] = []
    extras: Any = None


class Asset(Part):
    """Version and maker."""

    version: str
    min_version: str | None = None


class Document(Part):
    """A glTF file."""

    asset: Asset
    scene: Index | None = None
    scenes: list[SceneOfNodes] = []
    nodes: list[Node] = []
    meshes: list[Mesh] = []
    skins: list[Skin] = []
    animations: list[Animation] = []
    accessors: list[Accessor] = []
    buffer_views: list[BufferView] = []
    buffers: list[Buffer] = []
    extensions_used: list[str] = []
    extensions_required: list[str] = []
    extensions: Extensions = Extensions()
