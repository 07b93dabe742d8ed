"""Units of force and moment outside SI, which are defined by exact numbers."""

KILOGRAM_FORCE = 9.80665
"""Weight of a kilogram at standard gravity [N]."""
POUND_FORCE = 4.4482216152605
"""Weight of a pound at standard gravity [N]."""
POUND_FORCE_INCH = 0.0254 * POUND_FORCE
"""Moment of a pound-force at an inch [Nm]."""
POUND_FORCE_FOOT = 12.0 * POUND_FORCE_INCH
"""Moment of a pound-force at a foot [Nm]."""
