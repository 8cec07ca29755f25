"""Stage: vehicle."""
