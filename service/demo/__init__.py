"""The demonstration: a mock arm and the service in processes of their own, and the truth beside the
answers."""
