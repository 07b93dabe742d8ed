"""The outside world: sensors, servers, recordings and the command line."""
