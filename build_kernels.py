"""Builds the package, and compiles its kernels for a wheel: no first plan waits for them.

The build backend is hatchling's, with two differences. A wheel needs the packages that run it,
since kernels are compiled with them. And the metadata is written without building the wheel, which
pip would else do twice.

The wheel takes compiled kernels along beside the sources: numba's cache knows sources by a hash,
not by place or time. They are for the processor of the build, or for that of NUMBA_CPU_NAME and
NUMBA_CPU_FEATURES (`make wheel`); then `kernels.json` says which, and the package uses them on
every processor with these features. On any other, and where compilation fails here, kernels are
compiled when they are first called. An editable install compiles none: `selfmotion warm-up` does.
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path
from typing import Any

from hatchling import build as _hatchling
from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from hatchling.builders.wheel import WheelBuilder

# Compilation takes a minute on two cores; it is given up after [s].
PATIENCE = 900.0
# What numba keeps: an index of each function, and the code of each signature.
KEPT = ("*.nbi", "*.nbc")
WARM_UP = "import sys; from selfmotion.shell.cli import main; sys.argv[1:] = ['warm-up']; main()"

build_sdist = _hatchling.build_sdist
build_wheel = _hatchling.build_wheel
build_editable = _hatchling.build_editable
get_requires_for_build_sdist = _hatchling.get_requires_for_build_sdist
get_requires_for_build_editable = _hatchling.get_requires_for_build_editable


def get_requires_for_build_wheel(config_settings: dict[str, Any] | None = None) -> list[str]:
    """Return what a wheel is built with: the packages that run it as well."""
    project = tomllib.loads(Path("pyproject.toml").read_text())["project"]
    return [*_hatchling.get_requires_for_build_wheel(config_settings), *project["dependencies"]]


def prepare_metadata_for_build_wheel(
    metadata_directory: str, config_settings: dict[str, Any] | None = None
) -> str:
    """Write the metadata, and return the name of their folder."""
    builder = WheelBuilder(str(Path.cwd()))
    folder = Path(metadata_directory, f"{builder.artifact_project_id}.dist-info")
    folder.mkdir(exist_ok=True)
    text = builder.config.core_metadata_constructor(builder.metadata)
    (folder / "METADATA").write_text(text, encoding="utf-8")
    return folder.name


prepare_metadata_for_build_editable = prepare_metadata_for_build_wheel


class Kernels(BuildHookInterface):
    """Compiles kernels before a wheel is written."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile kernels of a copy of the sources, and hand their files over to the wheel."""
        if version == "editable":
            return
        self._folder = Path(tempfile.mkdtemp())
        for name in ("src", "robots"):
            shutil.copytree(
                Path(self.root, name), self._folder / name, ignore=shutil.ignore_patterns("*.nb?")
            )
        source = self._folder / "src"
        # The version of a package is asked of its metadata.
        prepare_metadata_for_build_wheel(str(source))
        if not self._compile(source):
            return
        files = [file for pattern in KEPT for file in source.rglob(pattern)]
        if cpu := os.environ.get("NUMBA_CPU_NAME"):
            built_for = source / "selfmotion" / "kernels.json"
            features = os.environ.get("NUMBA_CPU_FEATURES", "")
            built_for.write_text(json.dumps({"cpu": cpu, "features": features}))
            files.append(built_for)
        build_data["force_include"] |= {str(file): str(file.relative_to(source)) for file in files}
        build_data["pure_python"], build_data["infer_tag"] = False, True

    def _compile(self, source: Path) -> bool:
        """Compile all kernels of a copy of the sources; return whether that went well."""
        # Packages of an isolated build are on the path of this process only.
        paths = [str(source), *filter(None, sys.path)]
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(paths)}
        environment.pop("NUMBA_CACHE_DIR", None)
        try:
            subprocess.run(
                [sys.executable, "-c", WARM_UP],
                cwd=source,
                env=environment,
                check=True,
                capture_output=True,
                text=True,
                timeout=PATIENCE,
            )
        except (OSError, subprocess.SubprocessError) as error:
            reason = getattr(error, "stderr", None) or str(error)
            self.app.display_warning(
                f"kernels are not in the wheel, and compiled at the first plan: {reason[-2000:]}"
            )
            return False
        return True

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove the copy."""
        if version != "editable":
            shutil.rmtree(self._folder, ignore_errors=True)
