"""Content of a flight's page, and its HTML."""

import base64
import hashlib
import importlib.resources
from dataclasses import dataclass

from dfvs_common.extras import require_package
from dfvs_common.templates import templates
from dfvs_core.geometry.arrays import ImageArray
from dfvs_core.messages.image import encode_jpeg
from dfvs_service.image_drawing import at_width
from dfvs_service.page.charts import Plot, TimeLine, time_chart

_VIEW_WIDTH = 480


@dataclass(frozen=True, slots=True)
class View:
    """An image (H, W, 3) RGB with its caption."""

    caption: str
    image: ImageArray


@dataclass(frozen=True, slots=True)
class Video:
    """A video: address for the page's player, name of the file beside the page, start in s."""

    source: str
    file: str
    from_s: float


@dataclass(frozen=True, slots=True)
class Table:
    """Rows of text under their headings; columns named in ``numbers`` are aligned as numbers."""

    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    numbers: tuple[str, ...] = ()
    empty: str = "None."


@dataclass(frozen=True, slots=True)
class Page:
    """A page about a flight.

    ``tone`` is ``good``, ``bad`` or nothing. ``facts``, ``figures``, ``charts`` and ``texts`` are
    pairs of a name or title and its content; a text opens on a click. ``views`` are large images,
    ``strip`` small ones in the order of time, and ``note`` says what has to be known of them.
    ``path`` is an SVG, and ``line`` the time of the charts.
    """

    title: str
    verdict: str
    tone: str
    facts: tuple[tuple[str, str], ...]
    figures: tuple[tuple[str, str], ...]
    charts: tuple[tuple[str, Plot], ...]
    line: TimeLine
    views: tuple[View, ...] = ()
    strip: tuple[View, ...] = ()
    path: str = ""
    tables: tuple[Table, ...] = ()
    texts: tuple[tuple[str, str], ...] = ()
    video: Video | None = None
    note: str = ""


def render(page: Page) -> str:
    """HTML that needs nothing else, but for a video that it names as a file beside it."""
    environment = templates("dfvs_service.page")
    environment.filters["image"] = data_url
    environment.globals["zip"] = zip
    files = importlib.resources.files("dfvs_service.page")
    script = files.joinpath("page.js").read_text(encoding="utf-8")
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    charts = [(title, plot, time_chart(plot, page.line)) for title, plot in page.charts]
    return environment.get_template("page.html.j2").render(
        page=page,
        charts=charts,
        style=files.joinpath("page.css").read_text(encoding="utf-8"),
        script=script,
        script_digest=digest,
    )


def require_page_extra(command: str) -> None:
    """Say what is missing before any work.

    Raises
    ------
    ConfigError
        If Jinja2 is not installed.
    """
    require_package(f"{command} needs", "jinja2", "report")


def data_url(image: ImageArray) -> str:
    """An image (H, W, 3) RGB as a data URL of a JPEG, no wider than the page shows it."""
    if image.shape[1] > _VIEW_WIDTH:
        image = at_width(image, _VIEW_WIDTH)
    return "data:image/jpeg;base64," + base64.b64encode(encode_jpeg(image)).decode()
