"""Pictures of benchmark results."""
