"""Reading and verification of a bundle folder."""

from dataclasses import dataclass
from pathlib import Path

from dfvs_core.errors import ModelError
from dfvs_core.messages.manifest import MANIFEST_NAME, Manifest, check_files
from dfvs_models.onnx_file import check_onnx

MAX_MANIFEST_BYTES = 1024 * 1024
MAX_FILE_BYTES = 2 * 1024**3


@dataclass(frozen=True, slots=True)
class Bundle:
    """A verified bundle: its manifest and the contents of its files by name."""

    manifest: Manifest
    contents: dict[str, bytes]

    def graph(self, role: str) -> bytes:
        """ONNX file of one of the manifest's graphs."""
        return self.contents[self.manifest.graphs[role].file]


def read_bundle(folder: Path) -> Bundle:
    """Read and verify a bundle.

    Raises
    ------
    ModelError
        If a file is missing, too large, outside the folder, damaged, or asks ONNX Runtime for
        more than the standard operators on its own weights.
    """
    if not folder.is_dir():
        raise ModelError(f"{str(folder)!r} is not a folder", f"a bundle with {MANIFEST_NAME}")
    manifest = Manifest.from_json(_read(folder, MANIFEST_NAME, MAX_MANIFEST_BYTES))
    contents = {name: _read(folder, name, MAX_FILE_BYTES) for name in manifest.files}
    check_files(manifest, contents)
    for graph in manifest.graphs.values():
        check_onnx(contents[graph.file], graph.file)
    return Bundle(manifest, contents)


def _read(folder: Path, name: str, most_bytes: int) -> bytes:
    """Read a file of the folder, and nothing that a link or a name leads to elsewhere."""
    path = folder / name
    if path.resolve().parent != folder.resolve():
        raise ModelError(f"{name!r} leads out of the bundle {str(folder)!r}", "a file inside it")
    if not path.is_file():
        raise ModelError(f"bundle {str(folder)!r} lacks the file {name!r}", "all files of a bundle")
    try:
        with path.open("rb") as file:
            data = file.read(most_bytes + 1)
    except OSError as error:
        raise ModelError(f"{str(path)!r} cannot be read ({error.strerror})") from error
    if len(data) > most_bytes:
        raise ModelError(f"{str(path)!r} is too large", f"{most_bytes} bytes at most")
    return data
