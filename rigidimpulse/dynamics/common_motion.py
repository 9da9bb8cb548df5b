"""The motion of several bodies as one (kernels).

Bodies of mass m, inertia I, at x, with v and w, have as one rigid body about their centre of mass X

    P = sum m v,    L = sum ((x - X) x m v + I w),    J = sum (I + m (|x - X|^2 - (x - X)(x - X)^T)),    V = P / M,  W = J^-1 L

The kinetic energy is that of V and W and that of the motion against them. What is taken off the latter changes neither P nor L.
"""

from rigidimpulse.core.kernels import jit
from rigidimpulse.core.vector import along, cross


@jit
def add_turning(L, J, m, r, v, spin, inertia):
    """Return L and J with a body's part: its m, r = x - X, v, I w, and I about the world's axes (see `core.symmetric`)."""
    L = along(along(L, m, cross(r, v)), 1.0, spin)
    J = (
        J[0] + inertia[0] + m * (r[1] * r[1] + r[2] * r[2]),
        J[1] + inertia[1] - m * r[0] * r[1],
        J[2] + inertia[2] - m * r[0] * r[2],
        J[3] + inertia[3] + m * (r[0] * r[0] + r[2] * r[2]),
        J[4] + inertia[4] - m * r[1] * r[2],
        J[5] + inertia[5] + m * (r[0] * r[0] + r[1] * r[1]),
    )
    return L, J
