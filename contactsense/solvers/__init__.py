"""Where on a convex body a measured wrench enters: closed forms and Newton."""
