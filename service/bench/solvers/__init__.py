"""How exact and how fast the contact solvers are: the tables of `docs/solvers.md`."""
