"""Kinematics and dynamics of a serial arm."""
