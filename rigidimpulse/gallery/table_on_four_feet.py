"""A table on four feet bears a stack: resting contact, all forces found together (A11).

The feet are balls: four points, which the weight leaves undetermined by one number. Only sums are physics, and with a friction that is not
needed they are vertical:

    sum f_i = (M + sum m_k) g,    sum r_i x f_i = moment of the weights,    f_i >= 0

and between the storeys of the stack the weight of what is above. Bodies at rest stay at rest, to the bit. Contacts are solved to some
1e-12 of the weight; storeys of a thousandth of the weight above cost three digits: 1e-9. A solver with ten sweeps over the contacts is
off by 1e-2.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.gallery.record import Check, GalleryScene, at_least, at_most, equal
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

GRAVITY = 9.81
TOP, HEIGHT, LEG, FOOT = (1.2, 0.8, 0.05), 0.7, 0.05, 0.035
"""m: the top, its underside above the floor, side of a leg, radius of a foot."""
TABLE_MASS = 18.0
STACK = {
    "chest": ((0.5, 0.35, 0.2), 12.0),
    "cask": ((0.34, 0.34, 0.24), 25.0),
    "book": ((0.24, 0.17, 0.04), 0.6),
    "cup": ((0.08, 0.08, 0.1), 0.2),
}
"""Size m, mass kg of each storey, from below; casks and cups are cylinders across."""
PLACE = (0.28, 0.12)
"""m, where the stack stands on the table."""
DURATION = 4.0
BOUND = 1e-9
LIFT = 4e-6
"""m: contact margins, 1e-6 of a body's size, of up to five storeys."""


def scene() -> Scene:
    """Return floor, table and stack, drawn touching."""
    wood = Material(restitution=0.0, static_friction=0.4, dynamic_friction=0.4)
    scene = Scene(gravity=(0.0, 0.0, -GRAVITY))
    scene.add(Body("floor", Shape.half_space(), motion="static"))
    scene.add(Body("table", _table(), mass=TABLE_MASS, center_of_mass=(0.0, 0.0, HEIGHT), material=wood))
    height = HEIGHT + TOP[2]
    for name, (size, mass) in STACK.items():
        round_one = name in ("cask", "cup")
        shape = Shape.cylinder(0.5 * size[0], size[2]) if round_one else Shape.box(size)
        scene.add(Body(name, shape, position=(*PLACE, height + 0.5 * size[2]), mass=mass, material=wood))
        height += size[2]
    return scene


def check(run: Recording) -> list[Check]:
    """Check sums and moments of the forces, storey by storey, and that nothing moves."""
    names = ["floor", "table", *STACK]
    masses = [TABLE_MASS, *(mass for _, mass in STACK.values())]
    total = GRAVITY * sum(masses)
    checks = []
    for k in range(1, len(names)):
        weight = GRAVITY * sum(masses[k - 1 :])
        errors = [np.abs(_carried(run, frame, names[k - 1], names[k]) - [0.0, 0.0, weight]).max() for frame in range(1, len(run.times))]
        what = f"{names[k - 1]} bears {names[k]}: error of the force, of the weight"
        checks.append(at_most(what, max(errors) / weight, BOUND, "the weight above, at every frame"))
    feet = _contacts(run, -1, "floor", "table")
    up = np.where(feet["body_a"] == run.index("floor"), 1.0, -1.0)[:, None] * feet["force"]
    # The weights' lines of action: the table's through the origin, the stack's through its place.
    stack = total - GRAVITY * TABLE_MASS
    moment = np.cross(feet["point"], up).sum(axis=0) - np.cross([*PLACE, 0.0], [0.0, 0.0, stack])
    rest = run.positions[-1] - run.positions[1]
    changed = int(np.count_nonzero(rest) + np.count_nonzero(run.velocities[1:]) + np.count_nonzero(run.angular_velocities[1:]))
    return [
        *checks,
        equal("points that bear the table", len(feet), 4, "four feet"),
        at_most("moment of the feet less that of the weights, of m g l", np.abs(moment[:2]).max() / total, BOUND, "statics; l = 1 m"),
        at_least("least force of a foot, N", float(up[:, 2].min()) if len(feet) else -np.inf, 0.0, "feet push, they do not pull"),
        equal("numbers that change after the first frame", changed, 0, "bodies at rest stay at rest"),
        at_most("moved from the drawing, m", np.abs(run.positions[-1] - run.positions[0]).max(), LIFT, "contact margins"),
    ]


def _table() -> Shape:
    """Return top, legs and feet; origin on the floor."""
    upright = (1.0, 0.0, 0.0, 0.0)
    parts = [(Shape.box(TOP), (0.0, 0.0, HEIGHT + 0.5 * TOP[2]), upright)]
    for x in (-0.5, 0.5):
        for y in (-0.5, 0.5):
            place = (x * (TOP[0] - 2.0 * LEG), y * (TOP[1] - 2.0 * LEG))
            parts.append((Shape.box((LEG, LEG, HEIGHT - FOOT)), (*place, 0.5 * (HEIGHT + FOOT)), upright))
            parts.append((Shape.sphere(FOOT), (*place, FOOT), upright))
    return Shape.compound(parts)


def _contacts(run: Recording, frame: int, lower: str, upper: str) -> np.ndarray:
    """Return the contacts of two bodies at a frame."""
    contacts, pair = run.contacts_at(frame), {run.index(lower), run.index(upper)}
    return contacts[[{a, b} == pair for a, b in zip(contacts["body_a"].tolist(), contacts["body_b"].tolist(), strict=True)]]


def _carried(run: Recording, frame: int, lower: str, upper: str) -> np.ndarray:
    """Return the force (3,) of the lower body on the upper one, N."""
    contacts = _contacts(run, frame, lower, upper)
    sign = np.where(contacts["body_b"] == run.index(upper), 1.0, -1.0)
    return (sign[:, None] * contacts["force"]).sum(axis=0)


SCENES = (GalleryScene("table_on_four_feet", "A table on four feet bears a stack (animation notes A11)", scene, check, DURATION),)
