"""The dense posterior: that of `contactsense.solvers.posterior` at every place on the skin, as the reference
for accuracy."""
