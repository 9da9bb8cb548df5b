"""A scene file for the command line: one of every kind of shape tumbles onto the floor.

rigidimpulse simulate demos/shapes.py -o shapes.html
rigidimpulse explain demos/shapes.py
"""

import rigidimpulse as ri

SOFT = ri.Material(density=800, restitution=0.3, static_friction=0.5, dynamic_friction=0.4)


def scene() -> ri.Scene:
    """Return the scene."""
    corners = [(0.3, 0, 0), (-0.2, 0.25, 0), (-0.2, -0.25, 0), (0, 0, 0.4), (0, 0, -0.2)]
    wedge = ([(0, 0, 0), (0.5, 0, 0), (0, 0.4, 0), (0, 0, 0.3)], [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)])
    upright = (1, 0, 0, 0)
    cross = [(ri.Shape.box((0.6, 0.1, 0.1)), (0, 0, 0), upright), (ri.Shape.box((0.1, 0.6, 0.1)), (0, 0, 0), upright)]
    shapes = {
        "sphere": ri.Shape.sphere(0.2),
        "box": ri.Shape.box((0.4, 0.3, 0.2)),
        "capsule": ri.Shape.capsule(0.12, 0.3),
        "cylinder": ri.Shape.cylinder(0.2, 0.25),
        "hull": ri.Shape.convex_hull(corners),
        "wedge": ri.Shape.mesh(*wedge),
        "cross": ri.Shape.compound(cross),
    }
    made = ri.Scene()
    made.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    for k, (name, shape) in enumerate(shapes.items()):
        made.add(
            ri.Body(
                name, shape, position=(0.9 * (k - 3), 0, 0.8 + 0.1 * k), angular_velocity=(1, 2, 0.5), material=SOFT
            )
        )
    return made
