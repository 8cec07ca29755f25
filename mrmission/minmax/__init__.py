"""The lane planner: lanes shared among robots, its search, its bounds and its trips."""
