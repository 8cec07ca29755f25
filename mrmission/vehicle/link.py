"""Names of the MAVSDK client, for the upload until it takes them from `links`."""

from __future__ import annotations

from mrmission.vehicle.links import LinkTimeouts, TransferError, sd_limits
from mrmission.vehicle.mavsdk_link import Vehicle, heartbeat_ids, open_links

__all__ = ["LinkTimeouts", "TransferError", "Vehicle", "heartbeat_ids", "open_links", "sd_limits"]
