"""Obstacles near the simulated arm, as a script describes them: elastic bodies that do not move."""

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, PositiveFloat, model_validator

from contactsense.robots.files.file_model import FileModel
from contactsense.robots.units import within_one_turn

Vector = tuple[float, float, float]


class _Obstacle(FileModel):
    name: str = ""
    """Name in reports; default: its kind."""
    stiffness: Annotated[float, Field(gt=0.0, le=1e9)] = 20_000.0
    """Normal force per penetration depth [N/m]."""
    damping: Annotated[float, Field(ge=0.0, le=1e7)] = 100.0
    """Additional normal force per speed of approach [Ns/m]; the obstacle never pulls."""
    friction: Annotated[float, Field(ge=0.0, le=100.0)] = 0.0
    """Coefficient of Coulomb friction."""


class HalfSpace(_Obstacle):
    """Everything behind a plane: a floor, a wall."""

    kind: Literal["half_space"] = "half_space"
    point: Vector
    """A point on the plane, base frame [m]."""
    normal: Vector
    """Outward normal, base axes; any length."""

    @model_validator(mode="after")
    def _has_normal(self) -> "HalfSpace":
        if sum(x * x for x in self.normal) < 1e-12:
            raise ValueError(f"normal: expected a vector of some length, got {list(self.normal)}")
        return self


class BoxObstacle(_Obstacle):
    """A box with rounded edges."""

    kind: Literal["box"] = "box"
    center: Vector
    """Centre, base frame [m]."""
    rpy: Annotated[Vector, AfterValidator(within_one_turn)] = (0.0, 0.0, 0.0)
    """Orientation in the base frame: roll, pitch, yaw about fixed x, y, z [rad]."""
    half: tuple[PositiveFloat, PositiveFloat, PositiveFloat]
    """Half of the edge lengths, rounding included [m]."""
    rounding: PositiveFloat = 0.01
    """Radius of edges and corners [m]."""

    @model_validator(mode="after")
    def _fits(self) -> "BoxObstacle":
        if self.rounding > min(self.half):
            raise ValueError(f"rounding: expected at most the smallest of half, got {self.rounding} m")
        return self


class SphereObstacle(_Obstacle):
    """A ball."""

    kind: Literal["sphere"] = "sphere"
    center: Vector
    """Centre, base frame [m]."""
    radius: PositiveFloat
    """Radius [m]."""


Obstacle = Annotated[HalfSpace | BoxObstacle | SphereObstacle, Field(discriminator="kind")]
