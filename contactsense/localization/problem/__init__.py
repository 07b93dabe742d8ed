"""What each search for a contact is given: the measurement, the surface, and the arrays to fill."""
