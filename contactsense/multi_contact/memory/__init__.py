"""The arrays of the search for several contacts, and how their blocks are laid out for SIMD instructions."""
