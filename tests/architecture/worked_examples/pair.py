"""Contacts of two balls, each with a soft coat of COAT metres that the narrow phase counts as part of it."""

from math import sqrt

from rigidimpulse.collision.distance.simplices import CORNER, inner
from rigidimpulse.collision.manifold.contact_points import Contact, write_contact
from rigidimpulse.core.vector import along, dot, moved, row, subtract

COAT = 0.25


@inner
def coated_ball_contacts(geometry, first, second, pose, margin, contacts, count):
    """Append the contact of two coated balls with gap <= margin, in the frame of the first."""
    a, b = geometry.vertex_first[first], geometry.vertex_first[second]
    radius_a, radius_b = geometry.radius[first] + COAT, geometry.radius[second] + COAT
    centre = row(geometry.vertex, a)
    between = subtract(moved(pose.R, pose.t, row(geometry.vertex, b)), centre)
    distance = sqrt(dot(between, between))
    gap = distance - radius_a - radius_b
    if gap > margin:
        return count
    normal = (between[0] / distance, between[1] / distance, between[2] / distance)
    near, far = along(centre, radius_a, normal), along(centre, distance - radius_b, normal)
    return write_contact(contacts.real, contacts.integer, count, Contact(near, far, normal, gap, CORNER, 2 * a, 2 * b))
