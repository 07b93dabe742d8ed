"""The demonstration: mock arm and service in separate processes, and estimates next to the ground truth."""
