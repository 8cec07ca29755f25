"""Simulated boats: light vehicles that speak ArduPilot's MAVLink on loopback and sail missions.

``wire`` packs and parses; ``storage`` says what an autopilot keeps of an item, ``stores`` keeps it,
``transfer`` is the mission protocol; ``parameters``, ``motion``, ``fence``, ``execution`` and
``autopilot`` are the boat; ``telemetry`` builds what it streams; ``vehicle`` ties them into one
state machine without sockets or clocks; ``transport`` and ``fleet`` put it on the network.
``ardupilot`` runs ArduPilot's own simulated vehicles instead, with ``ardupilot_process`` and
``ardupilot_ready``.
"""

from mrmission.simulate.ardupilot import ArdupilotFleet
from mrmission.simulate.fleet import FleetThread, SimulatedFleet, berths_lonlat
from mrmission.simulate.transport import Faults
from mrmission.simulate.vehicle import SimVehicle, VehicleSetup

__all__ = [
    "ArdupilotFleet",
    "Faults",
    "FleetThread",
    "SimVehicle",
    "SimulatedFleet",
    "VehicleSetup",
    "berths_lonlat",
]
