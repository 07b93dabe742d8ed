"""Inform the robot program through RTDE input registers, with a heartbeat for a watchdog in the program."""

from collections.abc import Callable
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from contactsense.service.reactions.actions.base import ActionSettings
from contactsense.service.reactions.decision import Decision
from contactsense.service.wire.recipe import Number


def _number_in(prefix: str) -> Callable[[Any], Any]:
    """Accept the name of an RTDE field in place of the register's number, as it is in other programs."""

    def number(value: Any) -> Any:
        if not isinstance(value, str):
            return value
        digits = value.removeprefix(prefix)
        if not (digits.isascii() and digits.isdigit()):
            raise ValueError(f"expected the number N of a register {prefix}N, or this name, got {value!r}")
        return int(digits)

    return number


IntRegister = Annotated[int, Field(ge=0, le=47), BeforeValidator(_number_in("input_int_register_"))]
DoubleRegister = Annotated[int, Field(ge=0, le=47), BeforeValidator(_number_in("input_double_register_"))]
Bit = Annotated[int, Field(ge=64, le=127), BeforeValidator(_number_in("input_bit_register_"))]
LEVELS = {"contact": 1, "collision": 2}


class RegistersAction(ActionSettings):
    """Registers and the values written to them. They are written when a level begins or ends, with every
    sample while a level is active, and at least once per `period` as a heartbeat."""

    type: Literal["registers"]
    """Kind of the action."""
    code: IntRegister = 47
    """Integer register: level + 10 (link index + 1); level 0: none, 1: contact, 2: collision. If the link is
    unknown, 1 or 2."""
    force: DoubleRegister | None = 47
    """Double register: force [N]; None, here and below: not written."""
    link: IntRegister | None = None
    """Integer register: link index (base: 0); -1 if there is none."""
    point: tuple[DoubleRegister, DoubleRegister, DoubleRegister] | None = None
    """Double registers: contact centroid, base frame [m]."""
    time: DoubleRegister | None = None
    """Double register: time of the sample on the robot's clock [s]."""
    heartbeat: Bit | None = 64
    """Bit that changes with every write."""
    contact: Bit | None = 65
    """Bit: a contact or collision level is active."""
    collision: Bit | None = 66
    """Bit: a collision is latched."""
    degraded: Bit | None = 67
    """Bit: the latest estimate is degraded, or there has been none for 0.1 s."""
    period: Annotated[float, Field(ge=0.01, le=1.0)] = 0.02
    """Longest time between two writes [s]."""

    @model_validator(mode="after")
    def _are_different(self) -> Self:
        names = self.names
        twice = [name for name in names if names.count(name) > 1]
        if twice:
            raise ValueError(f"expected different registers, got {twice[0]} twice")
        return self

    @property
    def names(self) -> tuple[str, ...]:
        """The RTDE fields, in the order of `values`."""
        found = [f"input_int_register_{self.code}"]
        found += [f"input_double_register_{n}" for n in (self.force,) if n is not None]
        found += [f"input_int_register_{n}" for n in (self.link,) if n is not None]
        found += [f"input_double_register_{n}" for n in (*(self.point or ()), self.time) if n is not None]
        bits = (self.heartbeat, self.contact, self.collision, self.degraded)
        return (*found, *[f"input_bit_register_{n}" for n in bits if n is not None])

    def values(self, decision: Decision | None, t: float, beat: bool, degraded: bool) -> tuple[Number, ...]:
        """Values for `names`.

        Args:
            decision: The decision that began the highest active level, with the present force and point;
                None: no level is active.
            t: Time of the sample [s].
            beat: The heartbeat bit.
            degraded: The degraded bit.
        """
        level = 0 if decision is None else LEVELS[decision.level]
        index = -1 if decision is None else decision.link_index
        point = (0.0, 0.0, 0.0)
        if decision is not None and decision.point_base:
            point = (decision.point_base[0], decision.point_base[1], decision.point_base[2])
        found: list[Number] = [level + 10 * (index + 1)]
        if self.force is not None:
            found.append(0.0 if decision is None else decision.force)
        if self.link is not None:
            found.append(index)
        if self.point is not None:
            found += point
        if self.time is not None:
            found.append(t)
        bits = (
            (self.heartbeat, beat),
            (self.contact, level > 0),
            (self.collision, level > 1),
            (self.degraded, degraded),
        )
        return (*found, *[value for bit, value in bits if bit is not None])

    def describe(self) -> str:
        """Return a short description of the action."""
        return f"write {', '.join(self.names)} (heartbeat every {1e3 * self.period:g} ms)"
