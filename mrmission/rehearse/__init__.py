"""Sail a plan with simulated vehicles and measure what was driven."""
