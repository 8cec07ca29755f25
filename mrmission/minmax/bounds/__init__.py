"""What no plan that sweeps the chosen lines can beat; the proofs are in ``docs/bounds.md``."""
