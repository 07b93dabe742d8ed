"""The routes: estimates, events, health and metrics, static samples, the arm, reactions, clips."""
