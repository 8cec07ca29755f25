"""Stage: mission."""
