"""Real touches on a Franka Panda whose touched link is known."""
