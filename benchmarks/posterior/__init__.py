"""The dense posterior: every place on the skin is tried (theory, section 5), the yardstick for accuracy."""
