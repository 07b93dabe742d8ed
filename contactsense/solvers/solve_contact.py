"""`solve`: the contact on a surface from a wrench, exact or noisy."""

from typing import overload

from numpy.typing import ArrayLike

from contactsense.solvers.bodies.surface import Surface
from contactsense.solvers.posterior.most_probable import ContactPrior, ProbableContact, most_probable_contact
from contactsense.solvers.solve_wrench import Method, Solution, solve_wrench


@overload
def solve(surface: Surface, force: ArrayLike, moment: ArrayLike, method: Method = "exact") -> Solution: ...


@overload
def solve(
    surface: Surface,
    force: ArrayLike,
    moment: ArrayLike,
    *,
    covariance: ArrayLike,
    prior: ContactPrior | None = None,
) -> ProbableContact: ...


def solve(
    surface: Surface,
    force: ArrayLike,
    moment: ArrayLike,
    method: Method = "exact",
    *,
    covariance: ArrayLike | None = None,
    prior: ContactPrior | None = None,
) -> Solution | ProbableContact:
    """Find where a wrench enters a surface.

    Args:
        surface: The surface.
        force: Force on the body [N], shape (3,).
        moment: Moment on the body about the frame's origin [Nm], shape (3,).
        method: As for `contactsense.solvers.solve_wrench.solve_wrench`; `exact` with a covariance.
        covariance: Covariance of the measured wrench, force first, shape (6, 6); None: the wrench is exact.
        prior: With a covariance: what is known of contacts beforehand; None: the defaults.

    Returns:
        The contact that balances the wrench, or the nearest surface point; with a covariance, the most
        probable contact with its covariance and evidence. In the frame of the wrench. No measurement makes
        this raise.

    Raises:
        ValueError: The method is unknown, or cannot solve this surface or with a covariance; a shape is
            wrong; the covariance is not symmetric and positive definite; a prior comes without a
            covariance.
        TypeError: `surface` or `prior` is none.
    """
    if covariance is None:
        if prior is not None:
            raise ValueError("prior: only with a covariance; an exact wrench needs no prior")
        return solve_wrench(surface, force, moment, method)
    if method != "exact":
        raise ValueError(f"method: with a covariance only 'exact', not {method!r}")
    return most_probable_contact(surface, force, moment, covariance, prior)
