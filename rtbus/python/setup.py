"""Version from the project, and the C library beside the package when the tree has built it.

    tools/build rtbus_c && pip install --no-build-isolation rtbus/python
"""

import re
import shutil
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py
from setuptools.dist import Distribution

here = Path(__file__).resolve().parent
tree = here.parents[1]


class WithLibraries(build_py):
    def run(self):
        super().run()
        for soname in ("librtbus.so.1", "librtbus_engine.so.1"):
            built = tree / "build" / "lib" / soname
            if built.is_file():
                self.mkpath(str(Path(self.build_lib) / "rtbus"))
                shutil.copyfile(built, Path(self.build_lib) / "rtbus" / soname)


class OfThisMachine(Distribution):
    """A wheel with a library in it belongs to one kind of machine."""

    def has_ext_modules(self):
        return (tree / "build" / "lib" / "librtbus.so.1").is_file()


project = (tree / "CMakeLists.txt").read_text()
setup(
    version=re.search(r"project\(rtbus_haptics VERSION ([0-9.]+)", project).group(1),
    cmdclass={"build_py": WithLibraries},
    distclass=OfThisMachine,
)
