"""Everything is in pyproject.toml; this only puts ``sitl/*.parm`` into the package.

The files are written once, in ``sitl/``, where a reader of the checkout looks for them. A wheel
needs them inside the package, beside the launcher that hands them to ArduPilot.
"""

from pathlib import Path
from shutil import copyfile

from setuptools import setup
from setuptools.command.build_py import build_py

SOURCE = Path("sitl")
INSIDE = Path("mrmission/simulate/sitl")


class BuildWithParameters(build_py):
    """Copy the parameter files when a wheel is built; an editable install reads the checkout's."""

    def run(self) -> None:
        """Build the package, then add the files."""
        super().run()
        if self.editable_mode:
            return
        for source, target in self._parameters():
            target.parent.mkdir(parents=True, exist_ok=True)
            copyfile(source, target)

    def get_outputs(self, include_bytecode: bool = True) -> list[str]:
        """Return what is built, these files included."""
        outputs = super().get_outputs(include_bytecode)
        if self.editable_mode:
            return outputs
        return [*outputs, *(str(target) for _, target in self._parameters())]

    def get_source_files(self) -> list[str]:
        """Return what a source distribution must carry, these files included."""
        return [*super().get_source_files(), *(str(source) for source, _ in self._parameters())]

    def _parameters(self) -> list[tuple[Path, Path]]:
        build = Path(self.build_lib)
        return [(path, build / INSIDE / path.name) for path in sorted(SOURCE.glob("*.parm"))]


setup(cmdclass={"build_py": BuildWithParameters})
