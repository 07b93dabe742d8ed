"""The most probable contact for a noisy wrench, its covariance and its evidence.

`contact_prior` is what is known before the measurement, `line_of_action` the first guess, `mode` the search
for the posterior's maximum, with the formulas of `equations` for several primitives at once (`block` and
`simd`), `friction_tails` its covariance and `region` what it means. `most_probable` does this for one body,
`energy` evaluates one contact.
"""
