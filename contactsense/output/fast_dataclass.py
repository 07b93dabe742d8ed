"""Create frozen dataclasses with slots in a third of the time.

A frozen dataclass sets each field through `object.__setattr__`, which for a dozen fields takes as long as
Pinocchio's inverse dynamics. The mutable twin has the same slots: its instance is filled field by field, and
then assigned the frozen class.
"""

from typing import Any


def mutable_twin(frozen: type) -> type[Any]:
    """A class with the slots of `frozen`, a dataclass, and nothing else.

    An instance is made without arguments. Once all fields are set, it becomes one of the frozen class by
    `instance.__class__ = frozen`.
    """
    return type(frozen.__name__, (), {"__slots__": frozen.__slots__})  # type: ignore[attr-defined]
