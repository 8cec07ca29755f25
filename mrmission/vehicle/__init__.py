"""Vehicles over MAVLink: links, upload, read-back. The only place that imports mavsdk."""
