"""Setting the values of controls."""

from typing import Any

import viser


def set_value(control: viser.GuiInputHandle[Any], value: object) -> None:
    """Set the value of a control, which then calls its listeners.

    viser hides its setter from type checkers.
    """
    writable: Any = control
    writable.value = value
