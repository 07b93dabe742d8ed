"""How all compiled functions of this project are made."""
