"""The dense posterior: it evaluates every place on the skin (theory, section 5), as the reference for
accuracy."""
