"""Rotation of a body without torque, exact at any time.

Symbols: principal moments I, angular velocity w in the body, angular momentum L = |I w|, T2 = w . I w (twice energy).
    spherical inertia, or w on a principal axis:   q(t) = exp(w t) q0
    symmetric (I_b = I_c = I, axis e of I_a):      q(t) = exp(L t / I) q0 exp((1 - I_a / I) w_a t e)
    asymmetric: a frame (e1, e2, e3) of principal axes with e1 the middle moment and L circling about e3, w3 > 0:
        w1 = b sn u,  w2 = c cn u,  w3 = a dn u,  u = p t + u0,  m = |I1 - I2| r2 / (|I3 - I1| d2),
        r2 = |T2 I3 - L^2|,  d2 = |T2 I2 - L^2|,  p^2 = |I3 - I1| d2 / (I1 I2 I3),
        a^2 = d2 / (I3 |I3 - I2|),  b^2 = r2 / (I1 |I3 - I1|),  c^2 = r2 / (I2 |I3 - I2|),  sign b = sign(I1 - I3)

Attitude of the asymmetric top: let g = (g0, g1, g2, g3) turn (e1, e2, e3) into a fixed frame whose third axis is L. Its
Cayley-Klein parameters A = g0 + i g3, B = g1 + i g2 obey
    |A|^2 = (1 + I3 w3 / L) / 2,   B = -i (I1 w1 + i I2 w2) A / (L + I3 w3),   arg(A)' = (T2 + L w3) / (2 (L + I3 w3)),
so that A is never zero and only its phase is left to find. A is a theta function of half the usual lattice:
    A ~ exp(i lambda t) theta4(z - i y; Q),   z = pi u / 2K,   y = sign(I3 - I1) pi y0 / 2K,   Q = exp(-2 pi K' / K),
where y0 is the zero of L - I3 a dn(i y0),
    y0 = tau RF(1, G, G + m1 tau^2),   G = (L / I3 a)^2,   tau^2 = I2 |I3 - I1| / (I3 |I1 - I2|),   m1 = 1 - m,
and lambda follows from the rate at z = 0. Near the separatrix (Q > exp(-pi)) Jacobi's imaginary transformation is used:
    theta4(z - i y; exp(-pi T)) ~ exp(2 i z y / (pi T)) theta2(y / T + i z / T; exp(-pi / T)),   T = 2K' / K.
Phases are counted from the nearest maximum of dn, so that errors grow only as the round-off of the phase itself.

Sources: C. G. J. Jacobi, J. reine angew. Math. 39, 1850; F. Klein and A. Sommerfeld, Theorie des Kreisels, chapter VI;
R. van Zon and J. Schofield, J. Comput. Phys. 225:145, 2007 (sections 2-3); sn, cn, dn after R. Bulirsch, Numer. Math.
7:78, 1965; RF after B. C. Carlson, DLMF 19.36.
"""

import math

import numpy as np

from rigidimpulse.core.kernels import inlined, jit, jit_making_arrays
from rigidimpulse.core.quaternion import exponential, product, rotated
from rigidimpulse.core.tolerances import TOLERANCES

# Kinds of rotation, and places in the row of constants.
REST, FIXED_AXIS, SYMMETRIC, ASYMMETRIC = 0.0, 1.0, 2.0, 3.0
KIND = 0
BASE = 1  # (4,) orientation at the start; asymmetric: from the frame of L to the world
RATE = 5  # (3,) world angular velocity (fixed axis), precession L / I (symmetric)
_SPIN = 8  # (3,) turning in the body (symmetric)
_START_RATE = 11  # (3,) world angular velocity at the start (symmetric)

_FRAME = 5  # (4,) from (e1, e2, e3) to the principal frame
_AMPLITUDE = 9  # (3,) b, c, a
_SHARE = 12  # (3,) I b / L, I c / L, I a / L
_PHASE_RATE = 15  # lambda
_PHASE_SLOPE = 16  # 2 y / (pi T), or 0
_HALF_TURNS = 17  # p / 2K
_START_HALF_TURNS = 18  # u0 / 2K
_NEAR = 19  # 1 if the series are those of the imaginary transformation
_NOME_SCALE = 20  # 1 / T
_THETA = 21  # (_TERMS,) coefficients of the real part
_THETA_IMAGINARY = 25  # (_TERMS,) of the imaginary part
_MEAN = 29  # final mean of the AGM of (1, k')
_M1 = 30  # 1 - m
_LEVELS = 31  # number of levels
_TERMS = 4
_MAX_LEVELS = 14
_ARITHMETIC = 32  # (_MAX_LEVELS,) arithmetic means
_GEOMETRIC = _ARITHMETIC + _MAX_LEVELS  # (_MAX_LEVELS,) geometric means
FREE_ROTATION_SIZE = _GEOMETRIC + _MAX_LEVELS

_EQUAL = TOLERANCES.rotation.equal_moments
_ON_AXIS = TOLERANCES.rotation.on_axis
_ON_UNSTABLE_AXIS = TOLERANCES.rotation.on_unstable_axis
_SLOW = TOLERANCES.rotation.slow
_LEAST_M1 = TOLERANCES.rotation.least_complement
_AGM_DONE = TOLERANCES.rotation.agm_converged
_RF_DONE = TOLERANCES.rotation.carlson_converged
_TINY_ANGLE = TOLERANCES.rotation.tiny_argument
_NOME_SWITCH = 1.0
"""T = 2K'/K below which the imaginary transformation converges faster"""


@jit
def _carlson_rf(x, y, z):
    """Carlson's symmetric elliptic integral of the first kind; at most one argument zero."""
    while True:
        mean = (x + y + z) / 3.0
        dx, dy, dz = (mean - x) / mean, (mean - y) / mean, (mean - z) / mean
        if not max(abs(dx), abs(dy), abs(dz)) >= _RF_DONE:  # so written, it ends for NaN too
            break
        sx, sy, sz = math.sqrt(x), math.sqrt(y), math.sqrt(z)
        shift = sx * sy + sy * sz + sz * sx
        x, y, z = 0.25 * (x + shift), 0.25 * (y + shift), 0.25 * (z + shift)
    e2, e3 = dx * dy - dz * dz, dx * dy * dz
    series = e2 * (-0.1 + e2 / 24.0 - 3.0 * e3 / 44.0) + e3 / 14.0
    return (1.0 + series - 5.0 * e2 * e2 * e2 / 208.0 + 3.0 * e3 * e3 / 104.0) / math.sqrt(mean)


@jit
def _agm(k):
    """Arithmetic-geometric mean of 1 and k."""
    a, g = 1.0, k
    while abs(a - g) > _AGM_DONE * a:
        a, g = 0.5 * (a + g), math.sqrt(a * g)
    return 0.5 * (a + g)


@jit
def _store_agm(k, constants_out):
    """Mean of 1 and k, with every level kept for `_jacobi`."""
    a, g = 1.0, k
    level = 0
    while True:
        constants_out[_ARITHMETIC + level] = a
        constants_out[_GEOMETRIC + level] = g
        level += 1
        if abs(a - g) <= _AGM_DONE * a or level == _MAX_LEVELS:
            break
        a, g = 0.5 * (a + g), math.sqrt(a * g)
    mean = 0.5 * (a + g)
    constants_out[_MEAN] = mean
    constants_out[_LEVELS] = level
    return mean


@jit
def _jacobi(constants, sin_z, cos_z):
    """sn, cn, dn of u = z / mean, by descending Landen steps on the cotangent of the amplitude."""
    if abs(sin_z) < _TINY_ANGLE:
        return sin_z / constants[_MEAN], 1.0, 1.0
    ratio = cos_z / sin_z
    cotangent = ratio * constants[_MEAN]
    dn = 1.0
    for level in range(int(constants[_LEVELS]) - 1, -1, -1):
        a = constants[_ARITHMETIC + level]
        g = constants[_GEOMETRIC + level]
        ratio *= cotangent
        cotangent *= dn
        dn = (g + ratio) / (a + ratio)
        ratio = cotangent / a
    sn = math.copysign(1.0 / math.sqrt(1.0 + cotangent * cotangent), sin_z)
    cn = cotangent * sn
    # From the others once more: so the energy keeps its last digits.
    return sn, cn, math.sqrt(cn * cn + constants[_M1] * sn * sn)


@jit
def _theta(constants, z, sin_z, cos_z):
    """Real and imaginary part of the theta function that carries the phase of A, up to a positive factor."""
    c = constants
    real, imaginary = 0.0, 0.0
    if c[_NEAR] == 0.0:
        cos_2, sin_2 = cos_z * cos_z - sin_z * sin_z, 2.0 * sin_z * cos_z
        cos_n, sin_n = 1.0, 0.0
        for n in range(_TERMS):
            real += c[_THETA + n] * cos_n
            imaginary += c[_THETA_IMAGINARY + n] * sin_n
            cos_n, sin_n = cos_n * cos_2 - sin_n * sin_2, sin_n * cos_2 + cos_n * sin_2
        return real, imaginary
    # Divided by exp(|x|), which is left to the final normalisation: cosh, sinh of (2n + 1) x without overflow.
    x = z * c[_NOME_SCALE]
    growth = math.exp(2.0 * abs(x))
    growing, shrinking = 1.0, 1.0 / growth
    for n in range(_TERMS):
        real += c[_THETA + n] * (growing + shrinking)
        imaginary += c[_THETA_IMAGINARY + n] * (growing - shrinking)
        growing *= growth
        shrinking /= growth
    return real, imaginary if x >= 0.0 else -imaginary


@jit
def _asymmetric_frame(c, t):
    """Quaternion of (e1, e2, e3) relative to the frame of L, and w1, w2, w3, t seconds after the start."""
    turns = c[_HALF_TURNS] * t + c[_START_HALF_TURNS]
    whole = math.floor(turns + 0.5)
    z = math.pi * (turns - whole)
    sin_z, cos_z = math.sin(z), math.cos(z)
    sn, cn, dn = _jacobi(c, sin_z, cos_z)
    if whole % 2.0 != 0.0:
        sn, cn = -sn, -cn
    l1, l2, l3 = c[_SHARE], c[_SHARE + 1], c[_SHARE + 2]
    l1, l2, l3 = l1 * sn, l2 * cn, l3 * dn
    real, imaginary = _theta(c, z, sin_z, cos_z)
    phase = c[_PHASE_RATE] * t + c[_PHASE_SLOPE] * z
    cos_phase, sin_phase = math.cos(phase), math.sin(phase)
    # B = (l2 - i l1) A, and |A| from |A|^2 + |B|^2 = 1: a unit quaternion to the last digit.
    l1, l2 = l1 / (1.0 + l3), l2 / (1.0 + l3)
    size = 1.0 / math.sqrt((real * real + imaginary * imaginary) * (1.0 + l1 * l1 + l2 * l2))
    a_real = size * (cos_phase * real - sin_phase * imaginary)
    a_imaginary = size * (sin_phase * real + cos_phase * imaginary)
    b_real = l2 * a_real + l1 * a_imaginary
    b_imaginary = l2 * a_imaginary - l1 * a_real
    b, c2, a = c[_AMPLITUDE], c[_AMPLITUDE + 1], c[_AMPLITUDE + 2]
    return a_real, b_real, b_imaginary, a_imaginary, b * sn, c2 * cn, a * dn


@jit
def _store_phase(c, start_rate, speed, sigma, y, t_ratio):
    """Coefficients of the theta function and lambda, given arg(A)' at z = 0, z', sigma, |y| and T."""
    # Near the separatrix Jacobi's imaginary transformation makes the series short.
    near = t_ratio < _NOME_SWITCH
    turn = y / t_ratio
    slope, total = 0.0, 0.0
    for n in range(_TERMS):
        if near:
            nome = math.exp(-n * (n + 1) * math.pi / t_ratio)
            frequency = (2 * n + 1) / t_ratio
            real, imaginary = nome * math.cos((2 * n + 1) * turn), -nome * math.sin((2 * n + 1) * turn)
        else:
            high = math.exp(2 * n * y - n * n * math.pi * t_ratio)
            low = math.exp(-2 * n * y - n * n * math.pi * t_ratio)
            frequency = 2.0 * n
            sign = 0.5 if n == 0 else (-1.0 if n % 2 == 1 else 1.0)
            real, imaginary = sign * (high + low), sign * (high - low)
        c[_THETA + n] = real
        c[_THETA_IMAGINARY + n] = sigma * imaginary
        total += real
        slope += frequency * sigma * imaginary
    c[_NEAR] = 1.0 if near else 0.0
    c[_NOME_SCALE] = 1.0 / t_ratio
    c[_PHASE_SLOPE] = 2.0 * sigma * turn / math.pi if near else 0.0
    # lambda follows from arg(A)' at z = 0.
    c[_PHASE_RATE] = start_rate - speed * (c[_PHASE_SLOPE] + slope / total)


@jit
def _store_motion(c, moments, differences, w):
    """Constants of the asymmetric motion: moments (I1, I2, I3), differences (|I3 - I1|, |I1 - I2|) and spin w, all of order one."""
    i1, i2, i3 = moments
    d13, d12 = differences
    w1, w2, w3 = w
    d23 = d13 + d12
    r2 = i1 * d13 * w1 * w1 + i2 * d23 * w2 * w2
    d2 = i3 * d23 * w3 * w3 + i1 * d12 * w1 * w1
    m = min(d12 * r2 / (d13 * d2), 1.0)
    m1 = max(d23 * (i3 * d13 * w3 * w3 - i2 * d12 * w2 * w2) / (d13 * d2), _LEAST_M1)
    sigma = 1.0 if i3 > i1 else -1.0
    a, b, c2 = math.sqrt(d2 / (i3 * d23)), -sigma * math.sqrt(r2 / (i1 * d13)), math.sqrt(r2 / (i2 * d23))
    momentum_3, momentum_2 = i3 * a, i2 * c2
    momentum = math.sqrt(momentum_3 * momentum_3 + momentum_2 * momentum_2)
    c[_AMPLITUDE], c[_AMPLITUDE + 1], c[_AMPLITUDE + 2] = b, c2, a
    c[_SHARE], c[_SHARE + 1], c[_SHARE + 2] = i1 * b / momentum, momentum_2 / momentum, momentum_3 / momentum

    c[_M1] = m1
    mean = _store_agm(math.sqrt(m1), c)
    speed = mean * math.sqrt(d13 * d2 / (i1 * i2 * i3))  # z'
    c[_HALF_TURNS] = speed / math.pi
    sn, cn = w1 / b, w2 / c2
    size = math.sqrt(sn * sn + cn * cn)
    sn, cn = sn / size, cn / size
    half_turns = abs(sn) * mean / math.pi * _carlson_rf(cn * cn, cn * cn + m1 * sn * sn, 1.0)
    if cn < 0.0:
        half_turns = 1.0 - half_turns
    c[_START_HALF_TURNS] = math.copysign(half_turns, sn)

    steepness = momentum / momentum_3
    steepness *= steepness  # G
    tau2 = i2 * d13 / (i3 * d12)
    y = mean * math.sqrt(tau2) * _carlson_rf(1.0, steepness, steepness + m1 * tau2)
    start_rate = 0.5 * (i3 * a * a + i2 * c2 * c2 + momentum * a) / (momentum + momentum_3)
    _store_phase(c, start_rate, speed, sigma, y, 2.0 * mean / _agm(math.sqrt(m)))


@jit
def _prepare_asymmetric(inertia, low, middle, high, c):
    """Choose (e1, e2, e3), store the motion in it, and turn the base so that it starts at the given orientation.

    The angular velocity in the body is read from the place _SPIN.
    """
    w_low, w_middle, w_high = c[_SPIN + low], c[_SPIN + middle], c[_SPIN + high]
    # Powers of two: scaling then rounds nothing.
    scale_i = math.ldexp(1.0, -math.frexp(inertia[high])[1])
    scale_w = math.ldexp(1.0, -math.frexp(max(abs(w_low), abs(w_middle), abs(w_high)))[1])
    w_low, w_middle, w_high = scale_w * w_low, scale_w * w_middle, scale_w * w_high
    i_low, i_middle, i_high = scale_i * inertia[low], scale_i * inertia[middle], scale_i * inertia[high]
    # Differences are taken before scaling: of two nearly equal moments they are exact then.
    d_high, d_low = scale_i * (inertia[high] - inertia[middle]), scale_i * (inertia[middle] - inertia[low])
    circles_high = i_high * d_high * w_high * w_high >= i_low * d_low * w_low * w_low
    third = high if circles_high else low
    step = third - middle
    sign_3 = math.copysign(1.0, c[_SPIN + third])
    sign_2 = sign_3 if step == 2 or step == -1 else -sign_3
    if circles_high:
        _store_motion(c, (i_middle, i_low, i_high), (d_high, d_low), (w_middle, sign_2 * w_low, abs(w_high)))
    else:
        _store_motion(c, (i_middle, i_high, i_low), (d_low, d_high), (w_middle, sign_2 * w_high, abs(w_low)))
    for k in range(3):
        c[_AMPLITUDE + k] /= scale_w
    c[_PHASE_RATE] /= scale_w
    c[_HALF_TURNS] /= scale_w

    # (e1, e2, e3) is (x, y, z) turned by 0, 120 or 240 degrees about (1, 1, 1), after 0, 90, 180 or 270 about x.
    around = 0.25 * middle * (5 - 3 * middle)
    half_angle = 0.25 * math.pi * ((1.0 - sign_3) if sign_2 == sign_3 else -sign_3)
    cos_half, sin_half = math.cos(half_angle), math.sin(half_angle)
    e0, e1, e2, e3 = product(1.0 - abs(around), around, around, around, cos_half, sin_half, 0.0, 0.0)
    c[_FRAME], c[_FRAME + 1], c[_FRAME + 2], c[_FRAME + 3] = e0, e1, e2, e3
    g0, g1, g2, g3, _, _, _ = _asymmetric_frame(c, 0.0)
    e0, e1, e2, e3 = product(e0, e1, e2, e3, g0, -g1, -g2, -g3)
    q0, q1, q2, q3 = c[BASE], c[BASE + 1], c[BASE + 2], c[BASE + 3]
    q0, q1, q2, q3 = product(q0, q1, q2, q3, e0, e1, e2, e3)
    c[BASE], c[BASE + 1], c[BASE + 2], c[BASE + 3] = q0, q1, q2, q3
    c[KIND] = ASYMMETRIC


@jit
def _prepare_symmetric(axis, excess, c):
    """Constants for two equal moments; `axis` is that of the third, which is larger by the fraction `excess`.

    The angular velocity in the body is read from the place _SPIN.
    """
    along = c[_SPIN + axis] * excess
    c[_SPIN], c[_SPIN + 1], c[_SPIN + 2] = 0.0, 0.0, 0.0
    c[_SPIN + axis] = -along
    x, y, z = rotated(c[BASE], c[BASE + 1], c[BASE + 2], c[BASE + 3], c[_SPIN], c[_SPIN + 1], c[_SPIN + 2])
    wx, wy, wz = c[RATE], c[RATE + 1], c[RATE + 2]
    c[_START_RATE], c[_START_RATE + 1], c[_START_RATE + 2] = wx, wy, wz
    c[RATE], c[RATE + 1], c[RATE + 2] = wx - x, wy - y, wz - z
    c[KIND] = SYMMETRIC


@inlined
def keep_axis(q, w_world, constants_out):
    """Write the constants of a turn at constant angular velocity, whatever the inertia."""
    c = constants_out
    q0, q1, q2, q3 = q[0], q[1], q[2], q[3]
    wx, wy, wz = w_world[0], w_world[1], w_world[2]
    c[RATE], c[RATE + 1], c[RATE + 2] = wx, wy, wz
    c[KIND] = REST
    if wx != 0.0 or wy != 0.0 or wz != 0.0:
        # Only a body that turns is normalised: one at rest keeps the very bits of its orientation.
        c[KIND] = FIXED_AXIS
        norm = math.sqrt(q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3)
        q0, q1, q2, q3 = q0 / norm, q1 / norm, q2 / norm, q3 / norm
    c[BASE], c[BASE + 1], c[BASE + 2], c[BASE + 3] = q0, q1, q2, q3


@jit
def prepare(inertia, q, w_world, constants_out):
    """Write the constants (FREE_ROTATION_SIZE,) of the motion from orientation q (4,) and angular velocity (3,), rad/s.

    `w_world` is in the world. `inertia` (3,): principal moments, kg m^2, all > 0; any ratios.
    """
    c = constants_out
    keep_axis(q, w_world, c)
    spin = max(abs(c[RATE]), abs(c[RATE + 1]), abs(c[RATE + 2]))
    low = high = np.int64(0)  # a plain 0 would compile what is called below a second time
    for k in range(1, 3):
        if inertia[k] < inertia[low]:
            low = k
        if inertia[k] >= inertia[high]:
            high = k
    middle = 3 - low - high
    equal = _EQUAL * inertia[high]
    if spin < _SLOW or inertia[high] - inertia[low] <= equal:
        return
    c[_SPIN], c[_SPIN + 1], c[_SPIN + 2] = rotated(
        c[BASE], -c[BASE + 1], -c[BASE + 2], -c[BASE + 3], c[RATE], c[RATE + 1], c[RATE + 2]
    )
    i_low, i_middle, i_high = inertia[low], inertia[middle], inertia[high]
    if i_high - i_middle <= equal:
        _prepare_symmetric(low, 2.0 * i_low / (i_middle + i_high) - 1.0, c)
    elif i_middle - i_low <= _EQUAL * i_middle:
        _prepare_symmetric(high, 2.0 * i_high / (i_middle + i_low) - 1.0, c)
    else:
        off_low, off_middle, off_high = abs(c[_SPIN + low]), abs(c[_SPIN + middle]), abs(c[_SPIN + high])
        stable = min(max(off_low, off_middle), max(off_middle, off_high)) <= _ON_AXIS * spin
        if not (stable or max(off_low, off_high) <= _ON_UNSTABLE_AXIS * spin):
            _prepare_asymmetric(inertia, low, middle, high, c)


@jit
def rotation(constants, t):
    """Quaternion and world angular velocity t seconds after the start, as seven numbers."""
    c = constants
    q0, q1, q2, q3 = c[BASE], c[BASE + 1], c[BASE + 2], c[BASE + 3]
    if c[KIND] == REST:
        return q0, q1, q2, q3, 0.0, 0.0, 0.0
    if c[KIND] == ASYMMETRIC:
        g0, g1, g2, g3, wx, wy, wz = _asymmetric_frame(c, t)
        q0, q1, q2, q3 = product(q0, q1, q2, q3, g0, g1, g2, g3)
        wx, wy, wz = rotated(q0, q1, q2, q3, wx, wy, wz)
        s0, s1, s2, s3 = c[_FRAME], c[_FRAME + 1], c[_FRAME + 2], c[_FRAME + 3]
        s1, s2, s3 = -s1, -s2, -s3
    else:
        wx, wy, wz = c[RATE], c[RATE + 1], c[RATE + 2]
        e0, e1, e2, e3 = exponential(t * wx, t * wy, t * wz)
        q0, q1, q2, q3 = product(e0, e1, e2, e3, q0, q1, q2, q3)
        if c[KIND] == FIXED_AXIS:
            return q0, q1, q2, q3, wx, wy, wz
        # Symmetric: q = exp(L t / I) q0 exp((1 - I_a / I) w_a t e).
        wx, wy, wz = c[_START_RATE], c[_START_RATE + 1], c[_START_RATE + 2]
        wx, wy, wz = rotated(e0, e1, e2, e3, wx, wy, wz)
        x, y, z = c[_SPIN], c[_SPIN + 1], c[_SPIN + 2]
        s0, s1, s2, s3 = exponential(t * x, t * y, t * z)
    q0, q1, q2, q3 = product(q0, q1, q2, q3, s0, s1, s2, s3)
    return q0, q1, q2, q3, wx, wy, wz


@jit_making_arrays
def evaluate(constants, t, q_out, w_out):
    """Write quaternion (4,) and world angular velocity (3,) t >= 0 seconds after the start."""
    q_out[0], q_out[1], q_out[2], q_out[3], w_out[0], w_out[1], w_out[2] = rotation(constants, t)
