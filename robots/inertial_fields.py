"""Inertial parameters as files state them, of arms, tools and single links."""

from typing import Annotated

from pydantic import Field

LARGEST_MASS = 1e6
"""[kg]: even in grams, no arm's is larger, and squares of huge numbers overflow."""
Mass = Annotated[float, Field(ge=0.0, le=LARGEST_MASS)]
"""Mass of a body [kg]."""
_Moment = Annotated[float, Field(ge=-1e9, le=1e9)]
"""Component of an inertia tensor [kg m^2]: even in kg mm^2, none is larger."""
Tensor = tuple[_Moment, _Moment, _Moment, _Moment, _Moment, _Moment]
"""Inertia tensor as ixx, ixy, ixz, iyy, iyz, izz [kg m^2]."""
