"""Where the links of an arm are, and what its joints and its base carry."""
