"""Which readings are implausible, and which scenes in doubt, in words."""
