"""Detection: decides which residual is a contact, from the accepted false-alarm rate."""
