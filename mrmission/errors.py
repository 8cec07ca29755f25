"""The error hierarchy. Caught once, in :mod:`mrmission.cli`, and turned into an exit code.

A message says what is wrong, where (file, feature, robot, item), the value, the limit, and what
to do next, in one line.
"""


class MrMissionError(Exception):
    """Root of every error that mrmission raises on purpose."""

    exit_code = 70


class ConfigError(MrMissionError, ValueError):
    """An option or a combination of options that cannot be carried out."""

    exit_code = 2


class InputError(MrMissionError, ValueError):
    """A file that cannot be used."""

    exit_code = 3


class GeometryError(InputError):
    """A survey area whose geometry cannot be used."""


class PlanFormatError(InputError):
    """A ``.plan``, ``.waypoints`` or report file that cannot be read."""


class PlanningError(MrMissionError):
    """No plan could be made for a valid input."""

    exit_code = 4


class InfeasibleError(PlanningError):
    """The request contradicts itself: no plan can exist."""


class VehicleError(MrMissionError):
    """A vehicle did not do what it was asked."""

    exit_code = 5


class LinkTimeoutError(VehicleError):
    """A vehicle did not answer in time."""


class UploadError(VehicleError):
    """A vehicle refused a mission, fence or rally points."""


class ReadbackMismatchError(VehicleError):
    """A vehicle stores something else than what was sent."""


class SimulatorError(VehicleError):
    """A simulated vehicle could not be started or died."""
