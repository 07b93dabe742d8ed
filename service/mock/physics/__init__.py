"""Dynamics of the simulated arm in real time: joint servos move it, and obstacles exert contact forces."""
