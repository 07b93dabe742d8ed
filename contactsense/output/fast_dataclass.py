"""Create frozen dataclasses with slots in a third of the time.

A frozen dataclass sets each field through `object.__setattr__`, which for a dozen fields takes as long as
Pinocchio's inverse dynamics. The mutable twin has the same slots: its instance is filled like any object and
then assigned the frozen class.
"""

from collections.abc import Callable
from dataclasses import field, fields, make_dataclass
from typing import Any, TypeVar, cast

T = TypeVar("T")


def mutable_twin(frozen: type[T]) -> Callable[..., T]:
    """A constructor of instances that still have to be made frozen by `instance.__class__ = frozen`.

    Its arguments are those of `frozen`, a frozen dataclass with slots.
    """
    same: list[Any] = [(f.name, f.type, field(default=f.default)) for f in fields(cast(Any, frozen))]
    return cast(Callable[..., T], make_dataclass(frozen.__name__, same, slots=True))
