"""Reading and writing the bytes of sensor protocols; no sockets in here."""
