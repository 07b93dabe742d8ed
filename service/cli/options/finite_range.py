"""Numbers as options of commands."""

import math
from typing import Any

import click


class FiniteRange(click.FloatRange):
    """A number within limits. Click itself lets NaN pass any limit, as no comparison with it is true."""

    name = "number"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """The number.

        Raises:
            click.BadParameter: It is none, not finite, or beyond the limits.
        """
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"expected a finite number, got {number:g}", param, ctx)
        return number
