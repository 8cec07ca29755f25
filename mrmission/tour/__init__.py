"""Stage: tour."""
