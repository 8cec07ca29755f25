"""mrmission: MAVLink survey missions for fleets of boats and drones."""

__version__ = "0.1.0"
