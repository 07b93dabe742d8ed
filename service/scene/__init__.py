"""Scene files: written with comments, shown as understood, described field by field."""
