"""The viewer: the arm, its contacts and what is not known about them, in a browser (extra `viewer`)."""

READY = "viewer at "
"""Beginning of the line on stdout with which `contactsense view` names its address."""
