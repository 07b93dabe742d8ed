"""Reactions: rules that turn estimates into actions on the robot. Not a safety function."""
