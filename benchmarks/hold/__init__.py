"""A contact that is held gets better with time, one that slides is followed."""
