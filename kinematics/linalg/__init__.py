"""Small fixed-size linear algebra for kernels."""
