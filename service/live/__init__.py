"""The 500 Hz pipeline and its supervision."""
