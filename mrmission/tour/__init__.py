"""A robot's share of the work -> lanes and transits in order -> its coverage path."""
