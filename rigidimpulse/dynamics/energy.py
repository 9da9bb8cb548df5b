"""Kinetic and mechanical energy of bodies at the instant being worked on."""

from rigidimpulse.core.kernels import jit


@jit
def add_kinetic(total, v, w, q, mass, inertia):
    """Kinetic energy of a body added to a total [J]: velocity, spin, orientation, principal moments (3,)."""
    total += 0.5 * mass * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    # Spin in the principal frame: q* w q.
    tx = 2.0 * (q[3] * w[1] - q[2] * w[2])
    ty = 2.0 * (q[1] * w[2] - q[3] * w[0])
    tz = 2.0 * (q[2] * w[0] - q[1] * w[1])
    x = w[0] + q[0] * tx - (q[2] * tz - q[3] * ty)
    y = w[1] + q[0] * ty - (q[3] * tx - q[1] * tz)
    z = w[2] + q[0] * tz - (q[1] * ty - q[2] * tx)
    return total + 0.5 * (inertia[0] * x * x + inertia[1] * y * y + inertia[2] * z * z)


@jit
def kinetic_of(velocity, angular_velocity, orientation, mass, inertia, members):
    """Kinetic energy of the members [J]; columns (n, ...) of all bodies."""
    total = 0.0
    for i in members:
        total = add_kinetic(total, velocity[i], angular_velocity[i], orientation[i], mass[i], inertia[i])
    return total


@jit
def kinetic_energy(bodies, constants, members):
    """Kinetic energy of the members (k,) [J]; constants: `World.constants`."""
    return kinetic_of(bodies.velocity, bodies.angular_velocity, bodies.orientation, constants.mass, constants.inertia, members)


@jit
def mechanical_energy(bodies, constants, members):
    """Kinetic energy and potential energy of gravity and constant forces of the members (k,) [J]."""
    work = 0.0
    for i in members:
        for k in range(3):
            work += constants.mass[i] * constants.steady_acceleration[i, k] * bodies.position[i, k]
    return kinetic_energy(bodies, constants, members) - work
