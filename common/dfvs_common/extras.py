"""Check for the packages of an installation's extras."""

import importlib.util

from dfvs_core.errors import ConfigError


def require_package(needs: str, module: str, extra: str, package: str = "") -> None:
    """Raise ConfigError where a module is missing, with the command that installs it.

    ``needs`` is who needs it with the verb, ``package`` its name where that is not the module's.
    """
    if importlib.util.find_spec(module) is None:
        raise ConfigError(
            f"{needs} the Python package {package or module!r}",
            f"the extra {extra!r}",
            f"pip install 'dfvs[{extra}]'",
        )
