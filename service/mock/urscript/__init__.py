"""Programs in URScript: a `parser`, and the `functions` that the mock knows."""
