"""What is known of contacts from earlier samples, as prior of the joint optimization.

`known_prior` is one normal distribution; where it is broad, `known_place_mixture` divides it into
`known_components`. `known_force_weights` weighs candidates of a further contact by whether the known forces
push beside them.
"""
