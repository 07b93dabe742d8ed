"""Description of an arm: a serial chain of links and joints, with their inertia and surface. Frozen data."""

from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import NamedTuple

import numpy as np

from contactsense.robots.primitives import Primitive


def _frozen(array: np.ndarray, shape: tuple[int, ...], name: str) -> np.ndarray:
    result = np.array(array, dtype=np.float64)
    if result.shape != shape:
        raise ValueError(f"{name}: expected shape {shape}, got {result.shape}")
    if not np.all(np.isfinite(result)):
        raise ValueError(f"{name}: expected finite numbers, got {result.tolist()}")
    result.setflags(write=False)
    return result


class _WithArrays:
    """Equality of dataclasses with arrays: the one that dataclasses have asks an array for a single truth."""

    __slots__ = ()

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return all(
            np.array_equal(own, others) if isinstance(own, np.ndarray) else own == others
            for own, others in (
                (getattr(self, each.name), getattr(other, each.name))
                for each in fields(self)  # type: ignore[arg-type]
            )
        )

    __hash__ = None  # type: ignore[assignment]


@dataclass(frozen=True, slots=True, eq=False)
class Inertia(_WithArrays):
    """Mass distribution of one body, in the body's own frame."""

    mass: float
    """Mass [kg]."""
    com: np.ndarray
    """Centre of mass [m], shape (3,)."""
    tensor: np.ndarray
    """Inertia tensor about the centre of mass, body axes [kg m^2], shape (3, 3)."""

    def __post_init__(self) -> None:
        if not (np.isfinite(self.mass) and self.mass >= 0.0):
            raise ValueError(f"mass: expected a finite number >= 0, got {self.mass}")
        object.__setattr__(self, "com", _frozen(self.com, (3,), "com"))
        object.__setattr__(self, "tensor", _frozen(self.tensor, (3, 3), "tensor"))


NO_MASS = Inertia(0.0, np.zeros(3), np.zeros((3, 3)))
"""Inertia of a body without mass."""


@dataclass(frozen=True, slots=True, eq=False)
class Joint(_WithArrays):
    """A revolute joint: the pose of its child link in the frame of its parent link.

    The carried link's frame is `rotation` @ Rot(axis, q), placed at `translation`.
    """

    name: str
    rotation: np.ndarray
    """Orientation of the joint frame in the parent link's frame at q = 0, shape (3, 3)."""
    translation: np.ndarray
    """Origin of the joint frame in the parent link's frame [m], shape (3,)."""
    axis: np.ndarray
    """Unit axis in the joint frame, shape (3,)."""
    position_limits: tuple[float, float]
    """Lowest and highest angle [rad]."""
    velocity_limit: float
    """Largest speed [rad/s]."""
    torque_limit: float
    """Largest torque [Nm]."""
    rotor_inertia: float = 0.0
    """Inertia of the rotor reflected to the joint, gear ratio squared included [kg m^2]."""
    torque_constant: float | None = None
    """Joint torque per motor current [Nm/A], gear included; None if it has not been measured."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "rotation", _frozen(self.rotation, (3, 3), f"joint {self.name}: rotation"))
        translation = _frozen(self.translation, (3,), f"joint {self.name}: translation")
        object.__setattr__(self, "translation", translation)
        axis = _frozen(self.axis, (3,), f"joint {self.name}: axis")
        if abs(float(axis @ axis) - 1.0) > 1e-9:
            raise ValueError(f"joint {self.name}: axis: expected a unit vector, got {axis.tolist()}")
        object.__setattr__(self, "axis", axis)

    @property
    def range_within_turn(self) -> tuple[float, float]:
        """Lowest and highest angle between which the child link takes all of its poses [rad]: the limits, or
        half a turn to either side where they leave room for a whole one."""
        low, high = self.position_limits
        return (-np.pi, np.pi) if high - low >= 2.0 * np.pi else (low, high)


class LocalDeviation(NamedTuple):
    """How far the real surface is from a link's primitives about one place of them.

    Where it is on average is the primitive's surface, turned about the place, then shifted. The standard
    deviations are from that.
    """

    primitive: int
    """Number of the primitive, of the link's own."""
    point: tuple[float, float, float]
    """The place, link frame [m]."""
    offset: float
    """Standard deviation of the distance from the primitive [m]."""
    tilt: float
    """Standard deviation of the angle between the normals, along each tangent [rad]."""
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Mean shift of the surface, link frame [m]."""
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Mean rotation vector of the surface, link frame [rad]."""


@dataclass(frozen=True, slots=True)
class Link:
    """A rigid body of the arm and the convex primitives of its surface, in its own frame."""

    name: str
    inertia: Inertia
    primitives: tuple[Primitive, ...] = ()
    """The surface as a union of convex primitives."""
    coarse: tuple[Primitive, ...] = ()
    """The same with only one or two primitives, for scenes where speed matters more."""
    deviation: tuple[LocalDeviation, ...] = ()
    """How far the real surface is from `primitives`; empty if it was not measured."""
    coarse_deviation: tuple[LocalDeviation, ...] = ()
    """The same for `coarse`."""


@dataclass(frozen=True, slots=True, eq=False)
class Robot(_WithArrays):
    """A serial arm: `links[0]` is fixed to the base, `joints[j]` carries `links[j + 1]`."""

    name: str
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    flange_rotation: np.ndarray = field(default_factory=lambda: np.eye(3))
    """Orientation of the tool flange in the last link's frame, shape (3, 3)."""
    flange_translation: np.ndarray = field(default_factory=lambda: np.zeros(3))
    """Origin of the tool flange in the last link's frame [m], shape (3,)."""
    file: Path | None = None
    """File that the arm was read from; None if it was built otherwise."""
    tip: str | None = None
    """Last link of the arm in that URDF, if it was named."""
    held: tuple[str, ...] = ()
    """Movable joints of that URDF that are not the arm's, such as a gripper's; they are held at zero."""

    def __post_init__(self) -> None:
        if len(self.links) != len(self.joints) + 1:
            raise ValueError(
                f"robot {self.name}: {len(self.joints)} joints carry {len(self.joints)} links, "
                f"and one base: expected {len(self.joints) + 1} links, got {len(self.links)}"
            )
        object.__setattr__(self, "flange_rotation", _frozen(self.flange_rotation, (3, 3), "flange_rotation"))
        translation = _frozen(self.flange_translation, (3,), "flange_translation")
        object.__setattr__(self, "flange_translation", translation)

    def __repr__(self) -> str:
        """A few words: all numbers of an arm fill pages, in notebooks and in error messages."""
        return f"<robot {self.name}: {len(self.joints)} joints, {self.mass:.4g} kg>"

    @property
    def link_names(self) -> tuple[str, ...]:
        """Names of all links, base first."""
        return tuple(link.name for link in self.links)

    @property
    def mass(self) -> float:
        """Mass of the whole arm, base included [kg]."""
        return sum(link.inertia.mass for link in self.links)
