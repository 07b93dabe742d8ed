"""Speed, losses and latency on this machine."""
