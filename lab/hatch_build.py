"""Build hook: packages that lie beside this folder."""

from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class Packages(BuildHookInterface):
    """Takes the package ``dfvs_NAME`` of each of ``dev-mode-dirs``; also the license."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Name the files of a wheel; an editable one has only paths."""
        if version == "editable":
            return
        for folder in self.build_config.dev_mode_dirs:
            package = (Path(self.root) / folder).resolve()
            name = f"dfvs_{package.name}"
            build_data["force_include"][str(package / name)] = name
        notice = Path(self.root).resolve().parent / "LICENSE"
        build_data["extra_metadata"][str(notice)] = "licenses/LICENSE"
