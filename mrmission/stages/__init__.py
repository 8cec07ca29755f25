"""The stages of :func:`mrmission.pipeline.plan`, each with the hooks of what a plan may have."""
