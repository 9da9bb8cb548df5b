"""Every physical small number, grouped by what it belongs to.

Each field states its unit, or what it is relative to, and why it has its value. A field without a unit is a pure number. Numbers that a
user chooses are elsewhere: `scene.accuracy` has those of a run.

A kernel reads them as globals of its module, which numba takes as constants:

    CONTACT_MARGIN = TOLERANCES.contact.margin
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Arithmetic:
    """Rounding of double precision."""

    round_off: float = 2e-15
    """Relative to the quantity itself: a few units in the last place, what a short sum or product of rounded numbers is off by."""
    least_divisor: float = 1e-300
    """In the unit of the quantity: added to a divisor, or its least value, so that 0 / 0 is 0. It changes no divisor that has digits."""


@dataclass(frozen=True)
class Surfaces:
    """Cleaning of triangle surfaces, and their edges."""

    flat_angle: float = 1e-5
    """Sine of the angle between neighbouring faces, or along a crease, below which they count as flat or straight: vertices of single
    precision turn faces by about that much."""
    weld: float = 1e-9
    """Distance of vertices that are joined where a surface is open, relative to its size: above round-off, far below any detail."""
    thin_triangle: float = 1e-9
    """Height of a triangle over its longest edge below which that edge is flipped: its normal would be mostly round-off."""


@dataclass(frozen=True)
class Inertia:
    """Mass properties."""

    enclosed_volume: float = 1e-12
    """Least volume of a solid, relative to its area times its size: an open sheet encloses less, by round-off."""
    equal_moments: float = 1e-12
    """Difference of principal moments, relative to the largest, below which they are made equal: integrals over meshes are off by less."""
    diagonal: float = 1e-13
    """Off-diagonal entries, relative to the largest moment, below which a tensor counts as diagonal, so that the axes stay as drawn."""
    jacobi_converged: float = 1e-30
    """Off-diagonal entries, relative to the largest moment, that no longer change a digit of the moments or of the axes."""
    realizable: float = 1e-9
    """Excess of the largest moment over the sum of the others, relative to it, that passes as rounding of given figures."""
    symmetric: float = 1e-9
    """Difference of mirrored entries of a given tensor, relative to the largest, that passes as rounding of given figures."""
    least_moment: float = 1e-14
    """Least principal moment, relative to the largest: with less, spin about that axis has no correct digit."""


@dataclass(frozen=True)
class Rotation:
    """Rotations, and the closed forms and power series of rotating bodies."""

    small_angle: float = 1e-5
    """rad, below which sin(a/2)/a comes from two terms of its series, which are then exact to round-off."""
    equal_moments: float = 4e-15
    """Relative difference of two moments below which they are equal: rates then err by half of it, a few units in the last place."""
    on_axis: float = 1e-40
    """Part of the spin off a stable principal axis that counts as none: nothing of it is ever seen, and its square would underflow."""
    on_unstable_axis: float = 1e-15
    """The same for the middle axis: the round-off that the world spin leaves must not make a body flip."""
    slow: float = 1e-150
    """rad/s, below which a body keeps its axis: squares would underflow."""
    least_complement: float = 1e-100
    """Least 1 - m, m the parameter of the elliptic functions; 0 is the separatrix. The body stays by the unstable axis for 2K > 230 / p."""
    agm_converged: float = 1e-8
    """Relative difference of the means of the arithmetic-geometric mean after which one more step is exact: convergence is quadratic."""
    carlson_converged: float = 0.003
    """Relative spread of the arguments of Carlson's R_F at which its series, whose error is of order 8, ends."""
    tiny_argument: float = 1e-60
    """Argument z, without unit, below which sn z = z: cotangents would overflow."""
    parallel_torque: float = 1e-15
    """Sine of the angle of two vectors that count as parallel: what round-off leaves when both are turned to the body."""
    no_torque: float = 1e-280
    """rad/s^2, and rad/s^3: angular acceleration and its rate that count as none: squares would underflow."""
    last_term: float = 1e-15
    """Size of the last terms of the power series at the end of a segment; the terms that are left out are an eighth of it or less."""


@dataclass(frozen=True)
class Contacts:
    """The gaps at which bodies touch, and the speeds that count as none there."""

    margin: float = 1e-6
    """Contact margin: gap at which lasting contacts are kept, relative to the size of the smaller body. Normals are good to 1e-9 there,
    and nobody can see it."""
    impact_margin: float = 1e-10
    """Impact margin: gap at which impacts of faces, edges and rims with each other take place, relative to the size of the smaller body.
    It turns normals by as little, and distances of meshes still have their digits there."""
    approach: float = 1e-13
    """Approach speed that counts as none, relative to the speed of the bodies: round-off of the velocities at the point."""
    slow_approach: float = 1e-9
    """Approach speed that counts as none, relative to the speed below which contacts last."""
    rest: float = 1e-8
    """Speed below which a body in contact is at rest, relative to what gravity and constant forces give it in a step."""
    as_fast: float = 1e-9
    """Part by which a contact may leave or approach slower than those that last and is kept like them: round-off of speeds."""


@dataclass(frozen=True)
class Distances:
    """Distance queries: closest features, GJK, EPA, cylinders."""

    parallel_segments: float = 1e-14
    """Sine of the angle of two segments below which any point of their overlap is as close as any other."""
    gjk_converged: float = 1e-12
    """Part of |v|^2 by which a new support point must come nearer to go on."""
    gjk_round_off: float = 4e-16
    """Part of the greatest |w|^2 of the simplex that is round-off of |v|^2."""
    depth_converged: float = 1e-3
    """Part of the inner radius by which the depth that EPA finds may be too small: it is corrected as the bodies come apart."""
    flat_polytope_face: float = 1e-14
    """Square of an area, over the fourth power of its sides, below which a face of EPA's polytope has no normal."""
    cylinder_round_off: float = 1e-13
    """Excess of a distance over its lower bound, relative to the sizes involved, that passes as rounding."""
    cylinder_thin_triangle: float = 1e-14
    """Area of a triangle over the squares of its sides below which it has no face for the distance to a cylinder."""
    cylinder_parallel_axes: float = 1e-12
    """Sine of the angle of two axes below which their common perpendicular is left to the rims."""
    plane_converged: float = 1e-15
    """Step, relative to the size of the bodies, at which the separating plane has been found."""
    least_plane_shift: float = 1e-12
    """Least shift of the Hessian of a separating plane, relative to the sum of its diagonal."""
    unit_quaternion: float = 1e-6
    """Error of the length of a given quaternion beyond round-off, at which FCL's queries are refused."""


@dataclass(frozen=True)
class Manifolds:
    """Contact points of two bodies."""

    inside: float = 1e-11
    """How far outside a face or an edge a point still counts as inside, relative to the edge."""
    arc: float = 1e-9
    """Sine of the angle by which a normal may miss the arc of an edge or the cone of a vertex."""
    point_round_off: float = 1e-15
    """Error of a point, relative to its coordinates."""
    depth: float = 6.0
    """Depth down to which contacts of bodies that are a little inside each other are found, relative to the margin within which contacts
    are looked for. Two contact margins of 1e-6 of a size make 1.2e-5 of it: more than rounding to single precision, and more than the depth
    beyond which bodies are moved apart before the first step (`InitialOverlap.depth`)."""
    most_depth: float = 1e-4
    """Greatest such depth, relative to the radius of the smaller primitive: the sub-stepped regime looks within large margins."""
    merge: float = 1e-9
    """Distance below which two contacts are one, relative to the edge."""
    same_normal: float = 1e-9
    """1 less the cosine of the angle below which normals at one place are one."""
    tie: float = 1e-9
    """Difference of positions along a direction, relative to the extent, below which both are extreme: round-off must not choose."""
    crossing_edges: float = 1e-7
    """Least sine of the angle of two edges that cross at one point."""
    box_parallel_edges: float = 1e-6
    """Square of the sine of the angle of two edges of boxes below which they have no common normal."""
    box_second_face: float = 1e-6
    """Part of the sides by which a face of the second box must have the larger gap to be chosen: a tie keeps the first."""
    hull_second_face: float = 1e-6
    """The same for hulls, as a part of the inner radius."""
    edge_wins: float = 2e-3
    """Part of the smaller inner radius by which two edges must be farther apart than the faces for the contact to be theirs: faces give
    more points."""
    on_face: float = 1e-6
    """Part of the distance by which the way to a face may differ from that along its normal; the normal is exact however near it is."""
    nudge: float = 1e-6
    """Part of the length of edges by which a point is moved into its own body before it is asked whether another contains it."""
    rim_border: float = 1e-11
    """How far outside a rim, a cap or a face a point still counts as inside, relative to the cylinder."""
    rim_level: float = 1e-12
    """Sine of the tilt below which a rim has no lowest point."""
    rim_merge: float = 1e-7
    """Distance below which two contacts of a cylinder are one, relative to it."""
    rim_converged: float = 1e-9
    """Step of Newton's method along a rim, in radians, that is small enough when round-off prevents a smaller one."""
    rim_round_off: float = 1e-15
    """Step of Newton's method along a rim, relative to its place, that is round-off."""
    rim_least_curvature: float = 1e-3
    """Least curvature of the distance of two curves, relative to that of line and circle: below it Newton's method leaves the bracket."""


@dataclass(frozen=True)
class TimeOfImpact:
    """The search for the time at which two bodies touch."""

    crossing_edges: float = 1e-4
    """Least sine of the angle of two edges whose common normal is taken from their directions."""
    on_cylinder_side: float = 1e-6
    """Cosine to the axis below which a normal is one of the side of a cylinder."""
    bound_round_off: float = 1e-12
    """Part by which bounds of motion are made larger: it covers the rounding of the bounds themselves."""
    sphere_depth: float = 1e-10
    """Depth that counts as round-off, relative to the radius of a sphere."""
    curved_path: float = 1e-9
    """Part of speeds, and of accelerations on curved paths, that rounding may take."""
    curved_pressure: float = 1e-9
    """Part of the acceleration on a curved path that rounding may add to what presses a contact."""
    trigger: float = 1e-9
    """s, to which the times are found at which bodies enter and leave triggers."""


@dataclass(frozen=True)
class Events:
    """The order of events of a run: contact again after contact."""

    near: float = 1e-6
    """Contacts farther away than the declared gap by this part of it are in contact too."""
    contact_margin_round_off: float = 1e-6
    """The same, as a part of the contact margin."""
    reach_round_off: float = 1e-9
    """Part of bounding radii and of contact margins that rounding may take."""
    stuck_step: float = 1e-3
    """Part of the contact margin by which the gap of contact is lowered after a contact without consequence, so that time goes on."""
    instant: float = 1e-6
    """Part of a step within which a pair that touches again does so at the same instant."""
    leaving: float = 1e-6
    """Part of its gap by which a leaving pair may come nearer before it counts as contact again."""
    grid: float = 1e-9
    """Part of a step by which a time may miss the grid of steps by rounding."""
    whole: float = 1e-9
    """Part of the rest of a step that may lack for it to count as all of it: what rounding of times leaves."""


@dataclass(frozen=True)
class ContactForces:
    """Forces of lasting contacts in the exact regime, and the energy that they may give."""

    residual: float = 1e-12
    """Residual asked of the solver, relative to the speed gained in the sub-step."""
    poor_residual: float = 1e-8
    """Residual, relative to the speed gained in the sub-step, with which a solution is still used."""
    no_slip: float = 1e-9
    """Slip that counts as none, relative to the speed gained in the sub-step."""
    cylinder_lean: float = 1e-3
    """Sine of the angle of a normal and a cylinder's axis below which no point of the cylinder is nearest to a face."""
    aligned: float = 1e-9
    """Cosine of a normal and a cylinder's axis, or 1 less it, that counts as none."""
    correction_residual: float = 1e-6
    """Residual asked of the solver for corrections of positions, relative to the correction: it is repeated anyway."""
    energy_gain: float = 1e-11
    """Part of their kinetic energy that bodies may gain by rounding."""
    same_direction: float = 1e-6
    """Sine of the angle of directions that count as one where energy is limited."""
    unsolved_energy: float = 1e-3
    """Energy that forces which are no solution may make, relative to the energy that moves."""
    shortest: float = 1e-5
    """Part of a step that is not split any more."""
    shortest_stop: float = 1e-3
    """Part of a step within which it does not matter when a contact stops."""
    steady_turn: float = 1e-9
    """rad in a step: a body that turns less does not count as turning."""


@dataclass(frozen=True)
class Joints:
    """Joints, their limits and motors."""

    closed: float = 1e-12
    """Distance at which a joint is closed, relative to the size of what it joins; for its angles in rad."""
    orthonormal_axes: float = 1e-9
    """Largest error of the products of given axes: they come from files of few digits, and are made orthonormal to round-off."""
    least_sine: float = 1e-8
    """Sine of half a turn, or of a swing, below which its limit value is used: the quotient would lose all digits."""
    series_angle: float = 1e-3
    """rad, below which a series is used."""
    impact_residual: float = 1e-12
    """Residual asked of the solver at an impact, relative to the fastest rate."""
    residual: float = 1e-12
    """Residual asked of the solver, and of closing, relative to the speed gained in the sub-step."""
    unsolved: float = 1e-6
    """Residual of the solver that counts as none, relative to the speed gained in the sub-step: a row of two limits has no better one."""
    least_weight: float = 1e-12
    """Least inverse mass of a row, relative to that of the row alone: one that the joint's hard rows fix has no mass of its own."""
    energy_drift: float = 1e-7
    """Part of its kinetic energy that an island may gain or lose in a sub-step and count as if nothing swung."""
    short_sub_step: float = 1e-5
    """Part of a step below which a sub-step is planned as a longer one: closing divides by its length."""


@dataclass(frozen=True)
class Impacts:
    """Impact laws, friction impulses, and sequences of impacts."""

    block_residual: float = 1e-14
    """Residual asked of the solver for simultaneous impacts, relative to the speed of the island."""
    block_no_slip: float = 1e-9
    """Slip that counts as none, relative to the speed of the island."""
    block_energy_round_off: float = 1e-13
    """Energy that counts as none, relative to the energy moved."""
    rebound_size: float = 1e-10
    """Relative accuracy of the size of the rebound."""
    coupling_round_off: float = 5e-16
    """Round-off of products: of K, relative to its normal part (below it normal and tangents do not couple), and of the velocity."""
    energy_round_off: float = 1e-6
    """Energy made by the round-off of one impact with friction, relative to the energy moved, beyond which it is solved again by steps."""
    collapsed: float = 1e-3
    """Part of its approach speed that a contact could still have after an inelastic collapse."""
    truncation: float = 1e-15
    """Truncation of a step of the slip's equation that counts as none, relative to the slip."""
    straight: float = 1e-14
    """Turn of the slip that counts as none, relative to the force."""
    impulse_error: float = 1e-14
    """Error of an impulse that counts as none, relative to it."""


@dataclass(frozen=True)
class Solvers:
    """Newton's method for rows, and the convex reference solver."""

    regularisation_start: float = 1e-3
    """Softness of rows at the start, relative to their own: it makes redundant rows harmless."""
    regularisation_least: float = 1e-12
    """Softness of rows at the end, relative to their own: the solution is off by as much."""
    regularisation_free: float = 1e-9
    """The least for rows without bounds, whose impulses may grow large."""
    round_off: float = 4e-16
    """Round-off of a residual, relative to the largest of its terms: two units in the last place."""
    qp_precision: float = 1e-11
    """Precision asked of the convex solver, for a problem scaled to 1."""
    qp_regularisation: float = 1e-9
    """Added to the diagonal of the scaled W, which redundant contacts make singular."""


@dataclass(frozen=True)
class SubStepping:
    """The sub-stepped regime and its solver."""

    skin: float = 8e-3
    """Gap at which sub-stepped contacts are kept, relative to the distance from the centre of mass to the nearest face: a soft contact
    needs a gap that it may use up without bodies entering each other."""
    least_divisor: float = 1e-30
    """In the unit of the quantity: least divisor of the solver; its squares are added to squares, so it may not be smaller."""
    one_patch: float = 1e-8
    """1 less the cosine of the angle of normals that are one and share their friction."""
    crossed: float = 1e-6
    """Depth, in inner radii, from which the surfaces of two inset surfaces cross."""
    joints_closed: float = 1e-8
    """Gap at which a joint counts as closed in sub-steps, relative to the smallest body that one joins; in rad for angles."""
    joints_open: float = 1e-4
    """The same from which open joints are reported: nobody sees less."""
    joint_residual: float = 1e-6
    """Residual asked of the solver of joints and contacts, relative to the fastest rate before impulses act."""
    joint_no_slip: float = 1e-5
    """Slip that counts as none there, relative to the same."""
    last_sub_step: float = 1e-9
    """Part of a sub-step that rounding may leave over."""
    even_path: float = 1e-6
    """Part of its way by which a body may miss where an even acceleration would have brought it, for its path to be a parabola."""


@dataclass(frozen=True)
class InitialOverlap:
    """Pairs that overlap where the run starts."""

    depth: float = 1e-5
    """Depth, relative to the smaller body's size, beyond which a pair counts as overlapping: files of single precision are off by less."""
    equal_ways: float = 1e-7
    """Difference of two ways out, relative to the size of the smaller body, below which they are equal."""
    softness: float = 1e-8
    """Softness of a demand, relative to its inverse mass: demands that contradict each other end in a compromise."""
    fit_softness: float = 1e-5
    """The same where bodies are looked for that have no space for their contact margins. Normals that single precision has turned by some
    1e-7 must not count as wedges, along which a body could get out of the way: those turned by less than its root count as parallel."""
    fit_residual: float = 1e-3
    """Residual asked for where bodies are looked for that have no space for their contact margins, relative to the margin."""
    most_scaled: float = 1e-4
    """Greatest part of its size by which a body is made smaller where it fills its space exactly: nobody sees that."""
    surely_apart: float = 1e-9
    """Part of their radii by which bounding spheres must be apart for bodies to be apart whatever rounding does."""


@dataclass(frozen=True)
class Penalty:
    """Penalty forces."""

    rest_depth: float = 4e-4
    """Depth at which a body rests on another by default, relative to the size of the smaller: not seen, and not too stiff to step."""


@dataclass(frozen=True)
class SoftBodies:
    """Soft bodies and cloth."""

    slips: float = 1e-3
    """Slip speed above which dynamic friction counts, relative to what gravity gives in the step."""
    force_round_off: float = 1e-15
    """Round-off of forces, relative to stiffness times coordinates."""
    shortest_step: float = 1e-9
    """Part of the run's step below which soft bodies are not stepped: what rounding leaves at the end of a run."""
    still: float = 1e-3
    """Speed below which what a soft body presses on stands still, relative to what gravity gives in a step."""
    energy_reported: float = 1e-6
    """Energy made by errors, relative to that of the soft bodies, that is reported."""
    midpoint_excess: float = 1e-3
    """Energy made by errors, relative to twice the kinetic energy, above which a step of the midpoint rule is done again by Euler's."""
    midpoint_energy: float = 1e-7
    """The same where no motion is left to take it from; the solver's tolerance alone makes 1e-8."""
    ray_slack: float = 1e-9
    """Part of a face by which it is taken wider: rays along the edges of a regular mesh must not pass between its faces."""


@dataclass(frozen=True)
class Forces:
    """Forces, and the steps that follow them."""

    spring_limit: float = 1e-6
    """Part of its greatest force that a spring may lack of it and still break."""
    aside: float = 1e-9
    """Part of a step by which forces are evaluated inside of its ends: where they jump, the step's own side counts."""
    switched: float = 1e-9
    """Part of a step by which it may end off a switch of forces."""
    least_piece: float = 1e-13
    """Part of the run's step to which switches are found."""


@dataclass(frozen=True)
class Energies:
    """Forces from an energy of touching surfaces, and its minimisation."""

    converged: float = 1e-12
    """Newton step, relative to the length of the problem, below which a minimum has been found."""
    first_shift: float = 1e-3
    """Shift of the Hessian at the start, relative to the largest curvature."""
    least_shift: float = 1e-10
    """Least shift, relative to the largest curvature."""
    value_round_off: float = 1e-14
    """Change of the value, relative to its parts, that rounding hides."""
    gradient_round_off: float = 5e-16
    """Gradient that is rounding, relative to the largest curvature times the extent, by the root of the number of variables."""
    negative_curvature: float = 1e-8
    """Negative curvature, relative to the largest, that counts as none."""
    flat_curvature: float = 1e-12
    """Curvature of an eliminated variable, relative to the largest, below which it changes nothing."""
    least_path_shift: float = 1e-15
    """Shift of the Hessian of a path, relative to the largest curvature; that of f frames comes down to f^-4 of it."""
    same_direction: float = 1e-7
    """Sine of the angle of edges, and 1 less the cosine of normals, that count as one direction."""


@dataclass(frozen=True)
class Tolerances:
    """All tolerances, by the part of the library that owns them."""

    arithmetic: Arithmetic = Arithmetic()
    surface: Surfaces = Surfaces()
    inertia: Inertia = Inertia()
    rotation: Rotation = Rotation()
    contact: Contacts = Contacts()
    distance: Distances = Distances()
    manifold: Manifolds = Manifolds()
    time_of_impact: TimeOfImpact = TimeOfImpact()
    events: Events = Events()
    contact_forces: ContactForces = ContactForces()
    joint: Joints = Joints()
    impact: Impacts = Impacts()
    solver: Solvers = Solvers()
    sub_stepping: SubStepping = SubStepping()
    initial_overlap: InitialOverlap = InitialOverlap()
    penalty: Penalty = Penalty()
    soft_body: SoftBodies = SoftBodies()
    force: Forces = Forces()
    energy: Energies = Energies()


TOLERANCES = Tolerances()
"""The values in use."""
