"""Covariance of a contact's place where the real surface is not exactly the primitive.

Two errors of the surface move a place along it. An offset s along the normal moves the place of a slanted
force by s f_t / F, with f_t the tangential and F the normal force; the covariance of the posterior has this
part. A tilt d of the normal turns the torsion xi, changes the moment by xi d, and so moves the place by
xi d / F.

The search takes wider errors than the root mean squares of a cell, so that a place in their long tails is
not ruled out (`contactsense.localization.surface.local_prior.LONG_TAILS`). Few places are that far out: the
region of 90 % follows from the root mean squares themselves.
"""

from contactsense.localization.candidates.place_covariance import Tangents
from contactsense.localization.surface.local_prior import SurfaceError
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.vectors import dot
from contactsense.solvers.posterior.contact_prior import Contact
from contactsense.solvers.posterior.friction_tails import Variances


@fused_kernel
def with_surface_error(
    variances: Variances, tangents: Tangents, contact: Contact, error: SurfaceError
) -> Variances:
    """Covariance of a contact's place along two tangents, with the tilt of the real surface and without the
    tails of its errors [m^2].

    Args:
        variances: Of the posterior, with the surface's offset [m^2].
        tangents: Unit vectors, in the frame of the contact.
        contact: The contact.
        error: Of the surface there.
    """
    v11, v12, v22 = variances
    shift = error.tilt * contact.torsion / dot(contact.force, contact.normal)
    v11, v22 = v11 + shift * shift, v22 + shift * shift
    det = v11 * v22 - v12 * v12
    if not det > 0.0:
        return v11, v12, v22
    # The share of the surface's part S in the covariance V is the mean of the eigenvalues of V^-1 S.
    s11, s12, s22 = surface_part(tangents, contact, error)
    share = min(0.5 * (s11 * v22 - 2.0 * s12 * v12 + s22 * v11) / det, 1.0)
    factor = 1.0 - share * (1.0 - 1.0 / (error.tails * error.tails))
    return factor * v11, factor * v12, factor * v22


@fused_kernel
def surface_part(tangents: Tangents, contact: Contact, error: SurfaceError) -> Variances:
    """Covariance of a contact's place along two tangents that offset and tilt of the surface cause, with the
    tails of both [m^2]; arguments as for `with_surface_error`."""
    push = dot(contact.force, contact.normal)
    shift, step = error.tilt * contact.torsion / push, error.offset / push
    r1, r2 = step * dot(contact.force, tangents[0]), step * dot(contact.force, tangents[1])
    return r1 * r1 + shift * shift, r1 * r2, r2 * r2 + shift * shift
