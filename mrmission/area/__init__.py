"""Stage: area."""
