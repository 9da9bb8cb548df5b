"""How bodies of heaps move in a sub-step, see `heap_solver`: gravity, free rotation, positions (kernels)."""

from math import sqrt

from rigidimpulse._jit import jit
from rigidimpulse.constrain.heap_rows import set_pose
from rigidimpulse.rotation import exponential, product


@jit
def _turn_freely(bodies, i, h):
    """Turn body i by its spin over h, keeping its angular momentum."""
    r, moments, v = bodies.rotation[i], bodies.inertia[i], bodies.velocity[i]
    wx, wy, wz = v[3], v[4], v[5]
    q = bodies.orientation[i]
    if bodies.mass[i, 0] > 0.0 and not (moments[0] == moments[1] == moments[2]):
        x0 = r[0, 0] * wx + r[1, 0] * wy + r[2, 0] * wz
        x1 = r[0, 1] * wx + r[1, 1] * wy + r[2, 1] * wz
        x2 = r[0, 2] * wx + r[1, 2] * wy + r[2, 2] * wz
        l0, l1, l2 = moments[0] * x0, moments[1] * x1, moments[2] * x2
        d0 = 0.5 * h * (x2 * l1 - x1 * l2) / moments[0]
        d1 = 0.5 * h * (x0 * l2 - x2 * l0) / moments[1]
        d2 = 0.5 * h * (x1 * l0 - x0 * l1) / moments[2]
        lx = r[0, 0] * l0 + r[0, 1] * l1 + r[0, 2] * l2
        ly = r[1, 0] * l0 + r[1, 1] * l1 + r[1, 2] * l2
        lz = r[2, 0] * l0 + r[2, 1] * l1 + r[2, 2] * l2
        wx += r[0, 0] * d0 + r[0, 1] * d1 + r[0, 2] * d2
        wy += r[1, 0] * d0 + r[1, 1] * d1 + r[1, 2] * d2
        wz += r[2, 0] * d0 + r[2, 1] * d1 + r[2, 2] * d2
        t0, t1, t2, t3 = exponential(h * wx, h * wy, h * wz)
        q[0], q[1], q[2], q[3] = product(t0, t1, t2, t3, q[0], q[1], q[2], q[3])
        set_pose(bodies, i)
        m = bodies.mass[i]
        v[3] = m[1] * lx + m[2] * ly + m[3] * lz
        v[4] = m[2] * lx + m[4] * ly + m[5] * lz
        v[5] = m[3] * lx + m[5] * ly + m[6] * lz
        return
    t0, t1, t2, t3 = exponential(h * wx, h * wy, h * wz)
    q[0], q[1], q[2], q[3] = product(t0, t1, t2, t3, q[0], q[1], q[2], q[3])
    set_pose(bodies, i)


@jit
def move(bodies, h):
    """Move all bodies by their velocities over h s; those that no contact pushed, on their parabola."""
    for i in range(bodies.mass.shape[0]):
        v, x = bodies.velocity[i], bodies.position[i]
        back = 0.5 * h * h if bodies.loose[i] else 0.0
        for k in range(3):
            x[k] += h * v[k] - back * bodies.gravity[i, k]
        speed = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
        spin = sqrt(v[3] * v[3] + v[4] * v[4] + v[5] * v[5])
        bodies.path[i] -= h * speed
        if spin > 0.0:
            _turn_freely(bodies, i, h)


@jit
def kick(bodies, h):
    """Let gravity act over h s."""
    for i in range(bodies.mass.shape[0]):
        bodies.loose[i] = bodies.mass[i, 0] > 0.0
        for k in range(3):
            bodies.velocity[i, k] += h * bodies.gravity[i, k]
