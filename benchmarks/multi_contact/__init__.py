"""`contactsense bench several`: one, two and three contacts at a time."""
