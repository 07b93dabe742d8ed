"""Programs in URScript: `parser`, the `functions` that the mock knows, and `program_runner`."""
