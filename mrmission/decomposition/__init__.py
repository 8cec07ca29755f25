"""Stage: decomposition."""
