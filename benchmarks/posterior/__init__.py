"""The dense posterior: that of `contactsense.solvers.posterior.contact_prior` at every place on the skin, as
the reference for accuracy."""
