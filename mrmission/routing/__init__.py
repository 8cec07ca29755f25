"""Stage: routing."""
