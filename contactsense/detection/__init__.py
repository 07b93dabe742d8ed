"""Detection: which residual is a contact, from the false alarms that the user accepts."""
