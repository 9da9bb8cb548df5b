"""What a scene may hold beside bodies: forces, joints, soft bodies and triggers."""

from typing import ClassVar


class SceneEffect:
    """Something that acts on bodies or looks at them, as people write it; `Scene.add` takes it, and compiling the scene checks it."""

    stage: ClassVar[str]
    """Stage of the step that it belongs to: "forces", "constrain" or "observe"."""
    kind: ClassVar[str] = ""
    """What `explain` calls all forces of the class; empty for what is no force."""
    is_body: ClassVar[bool] = False
    """Whether it is something that moves, so that a scene with nothing else can be simulated."""
